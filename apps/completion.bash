# Bash completion of cadmorph: commands and options as its own help lists them, files otherwise.
_cadmorph() {
  local current=${COMP_WORDS[COMP_CWORD]} program=${COMP_WORDS[0]} command=() help
  help=$("$program" --help 2>/dev/null) || return
  local commands
  commands=$(awk '/^Subcommands:/ { inside = 1; next } /^$/ { inside = 0 } inside { print $1 }' \
    <<<"$help")
  if grep -qx -- "${COMP_WORDS[1]}" <<<"$commands" && ((COMP_CWORD > 1)); then
    command=("${COMP_WORDS[1]}")
    help=$("$program" "${command[@]}" --help 2>/dev/null) || return
  fi
  if [[ $current == -* ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$(grep -oE '^ +-[^ ]+' <<<"$help" | tr ',' '\n')" -- \
      "$current")
    return
  fi
  # The values of a choice: --untangle auto|never|always
  local previous=${COMP_WORDS[COMP_CWORD - 1]} values=''
  if [[ $previous == --* ]]; then
    values=$(grep -oE -- "^ +$previous [a-z0-9|-]+\|[a-z0-9|-]+" <<<"$help" | awk '{ print $2 }')
  fi
  if [[ -n $values ]]; then
    mapfile -t COMPREPLY < <(compgen -W "${values//|/ }" -- "$current")
    return
  fi
  mapfile -t COMPREPLY < <(
    if ((COMP_CWORD == 1)); then compgen -W "$commands" -- "$current"; fi
    compgen -o filenames -f -- "$current"
  )
  compopt -o filenames 2>/dev/null
}
complete -F _cadmorph cadmorph
