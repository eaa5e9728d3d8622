"""The commands of docs/python.md that need FreeCAD, where Debian's is installed (opt-in)."""

import os
import subprocess
import sys
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COMMANDS = ROOT / "tests/docs/page_commands.py"


class FreeCad(unittest.TestCase):
    def test_run_shown_commands(self):
        needed = [Path("/usr/lib/freecad-python3/lib/FreeCAD.so"), Path("/usr/lib/python3/dist-packages/gmsh.py")]
        if not all(path.exists() for path in needed):
            self.skipTest("needs freecad-python3 and python3-gmsh")
        lines = subprocess.run(
            [sys.executable, COMMANDS, "list", "tests/python/freecad_test.py", ROOT / "docs/python.md"],
            capture_output=True, text=True, check=True).stdout.splitlines()
        self.assertTrue(lines)
        for line in lines:
            run = subprocess.run(["bash", "-c", line], cwd=ROOT, capture_output=True, text=True,
                                 env=os.environ | {"PATH": f"/usr/bin:{os.environ['PATH']}"})
            self.assertEqual(run.returncode, 0, run.stderr)
            self.assertRegex(run.stdout, r"\d+ variants, [\d.]+ a second; least scaled Jacobian 0\.[1-9]")


if __name__ == "__main__":
    unittest.main()
