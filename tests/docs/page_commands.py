#!/usr/bin/python3
"""The command lines that the pages show, and who runs each of them.

usage: page_commands.py list WHO PAGE...      prints the lines that WHO runs
       page_commands.py check ROOT PAGE...    checks that no line is left to nobody

Commands stand in blocks tagged ```sh. WHO is "ctest" (the tests docs.commands:PAGE), or what the line
before a block names, as in <!-- run by .ci/run -->. Lines that go on after a backslash are joined,
comment lines left out. A block with another tag, or a span of code in the text, shows no command but
as a synopsis, with words in capitals; ROOT's pages with commands are all among PAGE.
"""

import re
import shutil
import sys
from pathlib import Path

# Who runs marked blocks, and what its file must contain to do so, besides the page's name.
RUNNERS = {
    ".ci/run": "tests/docs/run_in_tree.sh",
    "tests/formats/walks_test.sh": "run_shown_commands",
    "tests/python/freecad_test.py": "run_shown_commands",
    "tests/python/optimisation_test.py": "run_shown_commands",
    "tests/schedulers/dakota_test.sh": "run_shown_commands",
    "tests/schedulers/slurm_test.sh": "run_shown_commands",
    "tests/schedulers/snakemake_test.sh": "run_shown_commands",
}
SHELLS = {"bash", "console", "shell", "zsh"}
NOT_EVERYWHERE = {"dakota", "docker", "ninja", "sbatch", "snakemake", "sudo"}
BLOCK = re.compile(r"(?:^<!-- run by (\S+) -->\n)?^```(.*)\n((?:(?!```).*\n)*)^```$", re.M)
SPAN = re.compile(r"`([^`\n]+)`")


def blocks_of(page):
    """(who, tag, text) of each block."""
    return [(who or "ctest", tag, text) for who, tag, text in BLOCK.findall(page.read_text())]


def commands_of(text):
    lines = text.replace("\\\n", "").splitlines()
    return [line for line in lines if line.strip() and not line.lstrip().startswith("#")]


def begins_with_program(root, line):
    words = [word for word in line.split() if "=" not in word]
    if not words:
        return False
    is_ours = re.fullmatch(r"cadmorph[\w-]*", words[0]) is not None
    return (
        is_ours or words[0] in NOT_EVERYWHERE or shutil.which(words[0]) is not None
        or "/" in words[0] and shutil.which(root / words[0]) is not None
    )


def is_synopsis(line):
    return re.search(r"\b[A-Z]{2,}\b|<\w+>|\.\.\.", line) is not None


def mistakes_of_block(root, page, who, tag, text):
    if tag == "sh":
        if who == "ctest":
            return []
        if who not in RUNNERS:
            return [f"nobody knows how {who} runs commands"]
        runner = (root / who).read_text()
        if RUNNERS[who] not in runner or str(page.relative_to(root)) not in runner:
            return [f"{who} does not run the commands of this page"]
        return []
    if not tag or tag in SHELLS:
        return ["a block without a tag, or a shell's other than sh: " + text.partition("\n")[0]]
    if who != "ctest":
        return [f"a block tagged {tag} is not run by {who}"]
    return [
        f"a command in a block tagged {tag}: {line}"
        for line in commands_of(text)
        if begins_with_program(root, line) and not is_synopsis(line)
    ]


def mistakes_of_page(root, page, is_run):
    blocks = blocks_of(page)
    mistakes = [mistake for block in blocks for mistake in mistakes_of_block(root, page, *block)]
    if not is_run and any(tag == "sh" for _, tag, _ in blocks):
        mistakes.append("has commands, but there is no test of them")
    text = page.read_text()
    if len(re.findall(r"^\s*(?:```|~~~)", text, re.M)) != 2 * len(blocks):
        mistakes.append("a block is left open or indented")
    shown = {line.partition(" #")[0].strip() for _, tag, text in blocks if tag == "sh"
             for line in commands_of(text)}
    for span in SPAN.findall(BLOCK.sub("", text)):
        has_file = re.search(r" \S*[./]\w", span)
        if has_file and begins_with_program(root, span) and not is_synopsis(span):
            if span not in shown:
                mistakes.append(f"a command in the text: {span}")
    return mistakes


def is_page(path):
    return not any(p.startswith((".", "build", "node_modules")) or p == "out" for p in path.parts)


def check(root, run_pages):
    mistakes = []
    for path in sorted(root.rglob("*.md")):
        if is_page(path.relative_to(root)):
            found = mistakes_of_page(root, path, path.resolve() in run_pages)
            mistakes += [f"{path.relative_to(root)}: {mistake}" for mistake in found]
    return mistakes


def main():
    if len(sys.argv) < 4 or sys.argv[1] not in ("list", "check"):
        sys.exit(__doc__)
    pages = [Path(page).resolve() for page in sys.argv[3:]]
    if sys.argv[1] == "list":
        lines = [line for page in pages for who, tag, text in blocks_of(page)
                 if tag == "sh" and who == sys.argv[2] for line in commands_of(text)]
        print("\n".join(lines))
        return
    mistakes = check(Path(sys.argv[2]).resolve(), pages)
    if mistakes:
        sys.exit("\n".join(mistakes))


if __name__ == "__main__":
    main()
