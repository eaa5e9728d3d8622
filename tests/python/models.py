"""The repository's models, for the tests."""

import os
import re
from pathlib import Path

import cadmorph

FOLDER = Path(os.environ["CADMORPH_MODELS"])


def cad(name):
    return cadmorph.CadModel.from_step(FOLDER / f"{name}.step")


def box_of(length, width, height):
    """The box, 40 x 30 x 20 mm, with other sides."""
    sides = {"40": length, "30": width, "20": height}

    def scaled(point):
        return re.sub(r"\b(40|30|20)\.", lambda number: repr(float(sides[number[1]])), point[0])

    text = (FOLDER / "shapes/box.step").read_text()
    return cadmorph.CadModel.from_step(re.sub(r"CARTESIAN_POINT.*", scaled, text).encode())


def mesh(name):
    return cadmorph.Mesh.read(FOLDER / f"{name}.vtu")


def box_morpher(**options):
    return cadmorph.Morpher(cad("shapes/box"), mesh("shapes/box"), **options)
