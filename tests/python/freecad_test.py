"""The commands of docs/python.md that need FreeCAD, where Debian's is installed (opt-in)."""

import unittest
from pathlib import Path

from shown_commands import run_shown_commands


class FreeCad(unittest.TestCase):
    def test_variants_of_a_bracket(self):
        needed = [Path("/usr/lib/freecad-python3/lib/FreeCAD.so"), Path("/usr/lib/python3/dist-packages/gmsh.py")]
        if not all(path.exists() for path in needed):
            self.skipTest("needs freecad-python3 and python3-gmsh")
        for printed in run_shown_commands("tests/python/freecad_test.py", "docs/python.md"):
            self.assertRegex(printed, r"\d+ variants, [\d.]+ a second; least scaled Jacobian 0\.[1-9]")


if __name__ == "__main__":
    unittest.main()
