"""The repository's models, for the tests."""

import os
from pathlib import Path

import cadmorph

FOLDER = Path(os.environ["CADMORPH_MODELS"])


def cad(name):
    return cadmorph.CadModel.from_step(FOLDER / f"{name}.step")


def mesh(name):
    return cadmorph.Mesh.read(FOLDER / f"{name}.vtu")


def box_morpher(**options):
    return cadmorph.Morpher(cad("shapes/box"), mesh("shapes/box"), **options)
