"""`pip install .` makes the module, where pip and setuptools are; what is built already is taken."""

import importlib.util
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


class Pip(unittest.TestCase):
    def test_install(self):
        if not all(importlib.util.find_spec(name) for name in ("pip", "setuptools", "wheel")):
            self.skipTest("needs python3-pip, python3-setuptools and python3-wheel")
        build = Path(os.environ["CADMORPH_PROGRAM"]).parents[1]
        with tempfile.TemporaryDirectory() as folder:
            run = subprocess.run(
                [sys.executable, "-m", "pip", "install", "--no-build-isolation", "--no-deps", "--no-index",
                 "--quiet", "--target", folder, str(ROOT)],
                capture_output=True, text=True, env=os.environ | {"CADMORPH_BUILD_FOLDER": str(build)})
            self.assertEqual(run.returncode, 0, run.stderr)
            code = "import cadmorph; print(cadmorph.__file__)"
            place = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True,
                                   cwd=folder, env=os.environ | {"PYTHONPATH": folder}).stdout
            self.assertTrue(place.startswith(folder), place)


if __name__ == "__main__":
    unittest.main()
