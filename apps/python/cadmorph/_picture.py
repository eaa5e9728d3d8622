"""Pictures of a morph, drawn by the program cadmorph-picture."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from ._native import InvalidInputError, IoError

if TYPE_CHECKING:
    from ._native import MorphResult


class Picture:
    """A picture; notebooks show it."""

    def __init__(self, png: bytes) -> None:
        self.png = png

    def _repr_png_(self) -> bytes:
        return self.png

    def save(self, path: str | PathLike[str]) -> None:
        """Writes the PNG file."""
        Path(path).write_bytes(self.png)


def plot(result: MorphResult, *, field: str = "displacement") -> Picture:
    """Draws the mesh before and after, coloured by displacement or quality, and cut open.

    Takes the program cadmorph-picture, of the package cadmorph. Raises IoError where it is not there
    or can't draw.
    """
    if field not in ("displacement", "quality"):
        raise InvalidInputError(f"field: {field!r} is no choice; give 'displacement' or 'quality'")
    program = shutil.which("cadmorph-picture")
    if not program:
        raise IoError("the program cadmorph-picture, which draws, is not on the path")
    with tempfile.TemporaryDirectory(prefix="cadmorph-") as folder:
        paths = [Path(folder) / name for name in ("before.vtu", "after.vtu", "picture.png")]
        result.mesh.write(paths[0])
        result.mesh.write(paths[1], result.positions)
        drawn = subprocess.run([program, *paths, "--field", field], capture_output=True, text=True)
        if drawn.returncode != 0:
            raise IoError(f"cadmorph-picture can't draw: {drawn.stderr.strip()}")
        return Picture(paths[2].read_bytes())
