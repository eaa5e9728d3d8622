#!/usr/bin/env bash
# page_commands.py notices each way of showing a command that nobody runs.
set -euo pipefail
check=$(realpath "$(dirname "$0")/page_commands.py")
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
mkdir -p "$root/.ci" "$root/scripts"
echo 'tests/docs/run_in_tree.sh GOOD.md' >"$root/.ci/run"
install -m 755 /dev/null "$root/scripts/build"

fail() {
  echo "FAILED: $*" >&2
  exit 1
}

# expect_refused WHAT TEXT: a page of this text is a mistake that the message tells as WHAT.
expect_refused() {
  local message
  printf '%b\n' "$2" >"$root/page.md"
  if message=$("$check" check "$root" "$root/GOOD.md" "$root/page.md" 2>&1); then
    fail "passes: $2"
  fi
  [[ $message == "page.md: $1"* ]] || fail "another message for $2: $message"
  rm "$root/page.md"
}

good='<!-- run by .ci/run -->\n```sh\nscripts/build\n```\n\n```sh\nls \\\n  -l  # exit 0\n# no command\n```
`scripts/build` and `cadmorph quality MESH`.\n\n```text\ncadmorph match BASE VARIANT\n```'
printf '%b\n' "$good" >"$root/GOOD.md"
"$check" check "$root" "$root/GOOD.md" || fail "a good page is refused"
[[ $("$check" list .ci/run "$root/GOOD.md") == scripts/build ]] || fail "the marked block"
[[ $("$check" list ctest "$root/GOOD.md") == 'ls   -l  # exit 0' ]] || fail "the other block"
if "$check" check "$root" "$root/other.md" 2>/dev/null; then fail "a page without a test passes"; fi

expect_refused "a block without a tag" '```\nls\n```'
expect_refused "a block without a tag" '```bash\nls\n```'
expect_refused "a command in a block tagged text" '```text\ncadmorph match a.step b.step\n```'
expect_refused "a command in a block tagged text" '```text\nscripts/build\n```'
expect_refused "a command in the text" 'Run `scripts/build a/b` first.'
expect_refused "nobody knows how me runs" '<!-- run by me -->\n```sh\nls\n```'
expect_refused ".ci/run does not run" '<!-- run by .ci/run -->\n```sh\nls\n```'
expect_refused "a block is left open or indented" '- one:\n\n  ```sh\n  ls\n  ```'
