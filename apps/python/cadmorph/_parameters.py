"""The program's table of CAD parameters."""

from __future__ import annotations

import csv
from os import PathLike
from pathlib import Path

from ._native import CadModel, InvalidInputError, IoError

COLUMNS = ("name", "plus", "minus", "step")


def read_parameters(path: str | PathLike[str]) -> dict[str, tuple[CadModel, CadModel, float]]:
    """Reads the table that `cadmorph gradient` takes, and its STEP files.

    Columns name,plus,minus,step; the paths count from the table's folder. Returns what
    Morpher.gradient takes; given the table itself, that reads the files while others are at work.
    Raises IoError, CadError, InvalidInputError.
    """
    return {
        name: (CadModel.from_step(plus), CadModel.from_step(minus), step)
        for name, (plus, minus, step) in read_table(path).items()
    }


def read_table(path: str | PathLike[str]) -> dict[str, tuple[Path, Path, float]]:
    """The names of a table's parameters, with the paths of their STEP files and the step."""
    path = Path(path)
    try:
        rows = list(csv.DictReader(path.read_text().splitlines(), skipinitialspace=True))
    except OSError as error:
        raise IoError(f"{path}: {error.strerror}") from None
    parameters = {}
    for number, row in enumerate(rows, 2):
        missing = [column for column in COLUMNS if not row.get(column)]
        if missing:
            raise InvalidInputError(f"{path}:{number}: no {' or '.join(missing)}; the columns are {','.join(COLUMNS)}")
        if row["name"] in parameters:
            raise InvalidInputError(f"{path}:{number}: {row['name']!r} stands there twice")
        try:
            step = float(row["step"])
        except ValueError:
            raise InvalidInputError(f"{path}:{number}: {row['step']!r} is no number") from None
        parameters[row["name"]] = (path.parent / row["plus"], path.parent / row["minus"], step)
    if not parameters:
        raise InvalidInputError(f"{path}: no parameter")
    return parameters
