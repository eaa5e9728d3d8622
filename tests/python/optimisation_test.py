"""The optimisation of docs/optimisation.md, where gmsh, SciPy, matplotlib and CalculiX are installed."""

import re
import shutil
import tempfile
import unittest
from pathlib import Path

from shown_commands import ROOT, run_shown_commands

PACKAGES = Path("/usr/lib/python3/dist-packages")
NEEDED = [PACKAGES / name for name in ("gmsh.py", "scipy", "matplotlib")] + [Path("/usr/bin/ccx")]


class Optimisation(unittest.TestCase):
    def test_it_makes_the_bracket_lighter_and_keeps_the_limit(self):
        missing = [path.name for path in NEEDED if not path.exists()]
        if missing:
            self.skipTest(f"no {', '.join(missing)}: scripts/install-dependencies --optimisation brings them")
        with tempfile.TemporaryDirectory() as folder:
            shutil.copytree(ROOT / "docs", Path(folder) / "docs")
            # On cells of 8 mm it all takes a third of the time.
            printed = run_shown_commands("tests/python/optimisation_test.py", "docs/optimisation.md", folder,
                                         "out/bracket 8")[0]
            self.assertTrue((Path(folder) / "out/bracket/history.png").stat().st_size > 10_000)
        figures = re.search(r"mass ([\d.]+) g -> ([\d.]+) g, stress ([\d.]+) MPa -> ([\d.]+) MPa, limit (\d+) MPa", printed)
        self.assertTrue(figures, printed)
        mass, best_mass, _, best_stress, limit = map(float, figures.groups())
        self.assertLess(best_mass, 0.8 * mass, printed)
        self.assertLess(best_stress, 1.03 * limit, printed)


if __name__ == "__main__":
    unittest.main()
