"""The repository's models, for the tests."""

import os
import re
from pathlib import Path

import cadmorph
import numpy as np

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


def around_box():
    """Hexahedra round the box, on a plane that its foot stands on: the nodes of that slide."""
    x, y, z = np.mgrid[0:13, 0:10, 0:7]
    number = np.arange(x.size).reshape(x.shape)
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    cells = np.stack([number[i:12 + i, j:9 + j, k:6 + k] for i, j, k in corners], axis=-1)
    is_outside = np.ones(cells.shape[:3], bool)
    is_outside[4:8, 3:6, 0:2] = False
    used, cells = np.unique(cells[is_outside], return_inverse=True)
    points = 10.0 * np.stack([x.ravel() - 4, y.ravel() - 3, z.ravel()], axis=1)[used]
    return cadmorph.Mesh(points, [("hexahedron", cells.reshape(-1, 8))])


def far_box():
    """Hexahedra round the box up to 37 times as far away as it is large."""
    def lines(count):
        out = 10 * (1.8 ** np.arange(1, 8) - 1) / 0.8
        return np.concatenate([-out[::-1], 10.0 * np.arange(count + 1), 10 * count + out])

    x, y, z = np.meshgrid(lines(4), lines(3), lines(2), indexing="ij")
    number = np.arange(x.size).reshape(x.shape)
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    ends = np.array(x.shape) - 1
    cells = np.stack([number[i:ends[0] + i, j:ends[1] + j, k:ends[2] + k] for i, j, k in corners], axis=-1)
    is_outside = np.ones(cells.shape[:3], bool)
    is_outside[7:11, 7:10, 7:9] = False
    used, cells = np.unique(cells[is_outside], return_inverse=True)
    return cadmorph.Mesh(np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)[used], [("hexahedron", cells.reshape(-1, 8))])


def far_box_morpher():
    """Its far border stays, so that anchors hold what the box does."""
    return cadmorph.Morpher(cad("shapes/box"), far_box(), quality="fast", unmatched="fix")


def box_morpher(**options):
    return cadmorph.Morpher(cad("shapes/box"), mesh("shapes/box"), **options)
