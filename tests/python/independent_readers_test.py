"""Files of others, moved by an affine map, as meshio and VTK read them: CADMORPH_FORMATS names their folder."""

import contextlib
import gzip
import io
import os
import tempfile
import unittest
from pathlib import Path

import cadmorph
import numpy as np

FOLDER = os.environ.get("CADMORPH_FORMATS")
MATRIX = np.array([[1.01, 0.02, 0.003], [-0.004, 0.99, 0.001], [0.002, -0.003, 1.02]])
SHIFT = np.array([0.1, -0.2, 0.3])


def of_meshio(path, file_format):
    import meshio

    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        points = meshio.read(path, file_format=file_format).points
    return np.pad(points, [(0, 0), (0, 3 - points.shape[1])])


def of_fluent(path):
    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / "plain.msh"
        plain.write_bytes(gzip.open(path).read() if path.suffix == ".gz" else path.read_bytes())
        return of_meshio(plain, "ansys")


def of_vtk(reader):
    from vtk.util.numpy_support import vtk_to_numpy

    reader.Update()
    blocks, points = reader.GetOutput().NewIterator(), []
    blocks.InitTraversal()
    while not blocks.IsDoneWithTraversal():
        part = blocks.GetCurrentDataObject()
        points.append(vtk_to_numpy(part.GetPoints().GetData()).copy())
        blocks.GoToNextItem()
    return np.vstack(points)


def of_cgns(path):
    import vtk

    reader = vtk.vtkCGNSReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    reader.EnableAllBases()
    return of_vtk(reader)


def of_openfoam(path):
    import vtk

    with tempfile.NamedTemporaryFile(suffix=".foam", dir=path) as start:
        reader = vtk.vtkOpenFOAMReader()
        reader.SetFileName(start.name)
        return of_vtk(reader)


def of_ugrid(path):
    # meshio reads single precision.
    words = path.read_text().split()
    return np.array(words[7:7 + 3 * int(words[0])], dtype=float).reshape(-1, 3)


# A reader, how much it rounds (of the largest coordinate), and the files that it reads.
READERS = [
    (lambda path: of_meshio(path, "su2"), 1e-12, ["su2/*.su2"]),
    (lambda path: of_meshio(path, "medit"), 1e-12, ["ugrid/*.meshb"]),
    (lambda path: of_meshio(path, "abaqus"), 1e-12, ["calculix/*.inp"]),
    (of_ugrid, 1e-12, ["ugrid/*.ugrid"]),
    (of_fluent, 1e-12, ["fluent/*.msh.gz"]),
    (of_cgns, 1e-12, ["cgns/*.cgns"]),
    (of_openfoam, 1e-6, ["openfoam/*"]),
]


@unittest.skipUnless(FOLDER, "CADMORPH_FORMATS is not set")
class IndependentReaders(unittest.TestCase):
    def test_they_read_the_moved_nodes(self):
        read = 0
        for reader, rounding, patterns in READERS:
            for path in (path for pattern in patterns for path in sorted(Path(FOLDER).glob(pattern))):
                with self.subTest(path.name), tempfile.TemporaryDirectory() as folder:
                    copy = Path(folder) / path.name
                    mesh = cadmorph.Mesh.read(path)
                    is_plane = np.ptp(mesh.points[:, 2]) == 0
                    matrix, shift = MATRIX.copy(), SHIFT.copy()
                    if is_plane:
                        matrix[2, :2] = matrix[:2, 2] = shift[2] = 0
                    mesh.write(copy, mesh.points @ matrix.T + shift)
                    before, after = reader(path), reader(copy)
                    self.assertGreater(len(before), 0)
                    error = np.abs(before @ matrix.T + shift - after)[:, :2 if is_plane else 3].max()
                    self.assertLessEqual(error, rounding * np.abs(after).max())
                    read += 1
        self.assertGreaterEqual(read, 10)


if __name__ == "__main__":
    unittest.main()
