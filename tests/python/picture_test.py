"""Pictures of a morph, where the program that draws them is built."""

import os
import shutil
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import cadmorph
import models

PROGRAMS = Path(os.environ["CADMORPH_PROGRAM"]).parent


class Pictures(unittest.TestCase):
    def setUp(self):
        self.result = models.box_morpher().morph(models.cad("shapes/box_variant"))

    def test_a_picture_is_drawn(self):
        with mock.patch.dict(os.environ, PATH=f"{PROGRAMS}:{os.environ['PATH']}"):
            if not shutil.which("cadmorph-picture") or not shutil.which("Xvfb"):
                self.skipTest("needs cadmorph-picture and Xvfb")
            picture = self.result.plot(field="quality")
        self.assertTrue(picture._repr_png_().startswith(b"\x89PNG"))
        with tempfile.TemporaryDirectory() as folder:
            picture.save(Path(folder) / "box.png")
            self.assertEqual((Path(folder) / "box.png").read_bytes(), picture.png)

    def test_what_is_missing_is_said(self):
        with mock.patch.dict(os.environ, PATH=""), self.assertRaisesRegex(cadmorph.IoError, "cadmorph-picture"):
            self.result.plot()
        with self.assertRaisesRegex(cadmorph.InvalidInputError, "'displacement' or 'quality'"):
            self.result.plot(field="colour")


if __name__ == "__main__":
    unittest.main()
