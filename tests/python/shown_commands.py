"""The commands that a page shows for a test to run (tests/docs/page_commands.py)."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def run_shown_commands(test, page, folder=ROOT, arguments=""):
    """Runs the lines of `page` that `test` is named for, with more arguments, in a folder; returns what each printed."""
    lines = subprocess.run([sys.executable, ROOT / "tests/docs/page_commands.py", "list", test, ROOT / page],
                           capture_output=True, text=True, check=True).stdout.splitlines()
    assert lines, f"{page} shows no command for {test}"
    printed = []
    for line in lines:
        run = subprocess.run(["bash", "-c", f"{line} {arguments}"], cwd=folder, capture_output=True, text=True,
                             env=os.environ | {"PATH": f"/usr/bin:{os.environ['PATH']}"})
        assert run.returncode == 0, f"{line}\n{run.stdout}{run.stderr}"
        printed.append(run.stdout)
    return printed
