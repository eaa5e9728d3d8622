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
    Morpher.gradient takes. Raises IoError, CadError, InvalidInputError.
    """
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
        plus, minus = (CadModel.from_step(path.parent / row[side]) for side in ("plus", "minus"))
        parameters[row["name"]] = (plus, minus, step)
    if not parameters:
        raise InvalidInputError(f"{path}: no parameter")
    return parameters
