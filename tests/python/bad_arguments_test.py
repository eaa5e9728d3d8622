"""What does not fit raises what was expected, and never ends the process."""

import io
import tempfile
import unittest
from pathlib import Path

import cadmorph
import models
import numpy as np

POINTS = np.vstack([np.zeros(3), np.eye(3)])
TETRA = np.array([[0, 1, 2, 3]])


class BadArrays(unittest.TestCase):
    def refuses(self, words, make):
        with self.assertRaisesRegex(cadmorph.InvalidInputError, words):
            make()

    def test_points(self):
        cases = {
            r"float64 array of shape \(N, 3\), not float32 of shape \(4, 3\)": POINTS.astype(np.float32),
            r"not float64 of shape \(4, 2\)": POINTS[:, :2],
            r"not float64 of shape \(12,\)": POINTS.ravel(),
            r"not complex128": POINTS.astype(complex),
            r"not object": POINTS.astype(object),
            r"not <U": np.array([["a", "b", "c"]]),
            r"float64 array": None,
            r"not finite|finite": np.where(POINTS == 1, np.nan, POINTS),
            r"finite": np.where(POINTS == 1, np.inf, POINTS),
            r"": np.zeros((0, 3)),
        }
        for words, points in cases.items():
            with self.subTest(words):
                self.refuses(words, lambda: cadmorph.Mesh(points, [("tetra", TETRA)]))

    def test_cells(self):
        cases = {
            r"cells\[0\].*shape \(cells, 4\) for 'tetra', not int64 of shape \(1, 3\)": [("tetra", TETRA[:, :3])],
            r"cells\[0\].*integers, not float64": [("tetra", TETRA.astype(float))],
            r"'tetra20' can't be used": [("tetra20", TETRA)],
            r"no type of cells": [(2.5, TETRA)],
            r"expected a pair": [TETRA],
            r"cells\[1\]: expected a pair": [("tetra", TETRA), 3],
            r"list of \(type, array\)": 7,
            r"list of \(type, array\) ": TETRA,
            r"2\^63": [("tetra", np.array([[0, 1, 2, 2**64 - 1]], dtype=np.uint64))],
            r"mesh in memory: .*4": [("tetra", TETRA + 1)],
            r"mesh in memory: ": [("tetra", TETRA - 1)],
            r"polyhedron": [(42, TETRA)],
            r"type 200": [(200, TETRA)],
            r"no type": [(2**40, TETRA)],
            r"": [],
        }
        for words, cells in cases.items():
            with self.subTest(words):
                self.refuses(words, lambda: cadmorph.Mesh(POINTS, cells))

    def test_flat_cells(self):
        cases = [
            (r"ends before cell 1", [4, 0, 1, 2, 3], [10, 10]),
            (r"says that it has 5 nodes", [5, 0, 1, 2, 3], [10]),
            (r"says that it has -1 nodes", [-1, 0, 1, 2, 3], [10]),
            (r"goes on after the last of 1", [4, 0, 1, 2, 3, 4], [10]),
            (r"type 300", [4, 0, 1, 2, 3], [300]),
            (r"in one dimension", [[4, 0, 1, 2, 3]], [10]),
            (r"integers", [4.5, 0, 1, 2, 3], [10]),
            (r"", [3, 0, 1, 2], [10]),
        ]
        for words, cells, celltypes in cases:
            with self.subTest(words):
                self.refuses(words, lambda: cadmorph.Mesh(POINTS, cells, celltypes))

    def test_regions_and_groups(self):
        def mesh(**more):
            return cadmorph.Mesh(POINTS, [("tetra", TETRA)], **more)

        self.refuses("", lambda: mesh(regions=[1, 2]))
        self.refuses("32 bits", lambda: mesh(regions=[2**40]))
        self.refuses("integers", lambda: mesh(regions=[1.5]))
        self.refuses("the node 4", lambda: mesh(groups={"wall": [4]}))
        self.refuses("a dict", lambda: mesh(groups=["wall"]))
        self.refuses(r"groups\['wall'\]", lambda: mesh(groups={"wall": [0.5]}))

    def test_positions(self):
        mesh = cadmorph.Mesh(POINTS, [("tetra", TETRA)])
        self.refuses(r"positions: expected a float64 array of shape \(4, 3\)", lambda: mesh.at(POINTS[:3]))
        self.refuses("finite", lambda: mesh.at(POINTS * np.nan))
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "mesh.vtu"
            self.refuses("positions", lambda: mesh.write(path, POINTS[:2]))
            self.refuses("finite", lambda: mesh.write(path, np.full_like(POINTS, np.inf)))
            self.refuses(".vtu or .vtk", lambda: mesh.write(Path(folder) / "mesh.msh"))
            self.assertEqual(list(Path(folder).iterdir()), [])

    def test_gmsh(self):
        def mesh(tags=(1, 2, 3, 4), points=POINTS, types=(4,), nodes=((1, 2, 3, 4),)):
            return cadmorph.Mesh.from_gmsh(list(tags), points, list(types), [list(n) for n in nodes])

        self.assertEqual(mesh().cell_count, 1)
        self.refuses("coordinates", lambda: mesh(tags=(1, 2, 3)))
        self.refuses("comes twice", lambda: mesh(tags=(1, 2, 3, 3)))
        self.refuses("the node tag 9", lambda: mesh(nodes=((1, 2, 3, 9),)))
        self.refuses("no whole number", lambda: mesh(nodes=((1, 2, 3),)))
        self.refuses("one for each element type", lambda: mesh(types=(4, 4)))
        self.refuses("gmsh's type 99", lambda: mesh(types=(99,)))


class BadSources(unittest.TestCase):
    def test_files(self):
        with self.assertRaisesRegex(cadmorph.IoError, "no such file"):
            cadmorph.CadModel.from_step("missing.step")
        with self.assertRaises(OSError):
            cadmorph.CadModel.from_step("missing.step")
        with self.assertRaises(cadmorph.IoError):
            cadmorph.Mesh.read("missing.vtu")
        for source in (None, 3, [1, 2], object()):
            with self.subTest(source), self.assertRaises(TypeError):
                cadmorph.CadModel.from_step(source)
        with self.assertRaisesRegex(cadmorph.InvalidInputError, "expected a path"):
            cadmorph.Mesh.read(b"bytes of a mesh")

    def test_text_files(self):
        with open(models.FOLDER / "shapes/box.step", encoding="utf-8") as file:
            with self.assertRaisesRegex(cadmorph.InvalidInputError, "binary mode"):
                cadmorph.CadModel.from_step(file)

    def test_closed_files(self):
        closed = io.BytesIO(b"")
        closed.close()
        with self.assertRaisesRegex(ValueError, "closed file"):
            cadmorph.CadModel.from_step(closed)
        with open(models.FOLDER / "shapes/box.step", "rb") as file:
            pass
        with self.assertRaisesRegex(ValueError, "closed file"):
            cadmorph.CadModel.from_step(file)

    def test_damaged_bytes(self):
        step = (models.FOLDER / "shapes/box.step").read_bytes()
        with self.assertRaisesRegex(cadmorph.CadError, "part: .*truncated"):
            cadmorph.CadModel.from_step(step[:-400], name="part")
        with self.assertRaisesRegex(cadmorph.CadError, "not a STEP file"):
            cadmorph.CadModel.from_step(b"")
        with self.assertRaisesRegex(cadmorph.CadError, "no BREP data"):
            cadmorph.CadModel.from_brep(b"")
        with self.assertRaises(cadmorph.CadError):
            cadmorph.CadModel.from_brep("CASCADE Topology V1, (c) Matra-Datavision\nLocations 0\n")
        with self.assertRaisesRegex(cadmorph.InvalidInputError, "not a path"):
            cadmorph.CadModel.from_brep(models.FOLDER / "shapes/box.step")
        with self.assertRaisesRegex(cadmorph.InvalidInputError, "FreeCAD, CadQuery or build123d"):
            cadmorph.CadModel.from_shape(3)


class BadMorphs(unittest.TestCase):
    def test_options(self):
        cases = {
            "unmatched: 'no' is no choice; give one of 'auto'": {"unmatched": "no"},
            "method": {"method": "magic"},
            "kernel: 'magic' is no choice": {"kernel": "magic"},
            "needs the option kernel_shape": {"kernel": "wendland-c2"},
            "kernel_shape has no meaning": {"kernel_shape": 0.1},
            "the option kernel_shape is -1": {"kernel": "gaussian", "kernel_shape": -1.0},
            "solver": {"solver": "magic"},
            "untangle": {"untangle": "magic"},
            "quality": {"quality": "magic"},
            "solver_family": {"solver_family": "magic"},
            "mesh_unit_mm": {"mesh_unit_mm": -1.0},
            "association_tolerance": {"association_tolerance": float("nan")},
            "steps": {"steps": -1},
            "improve_below": {"improve_below": 2.0},
            "nothing": {"hold": ["nothing"]},
            "'nowhere'": {"periodic": [("nowhere", "nothing")]},
            "progress: expected a function": {"progress": 3},
        }
        for words, options in cases.items():
            with self.subTest(words), self.assertRaisesRegex(cadmorph.InvalidInputError, words):
                models.box_morpher(**options)
        with self.assertRaises(TypeError):
            models.box_morpher(stepps=3)
        with self.assertRaises(TypeError):
            cadmorph.Morpher(models.cad("shapes/box"), None)
        with self.assertRaises(TypeError):
            models.box_morpher().morph(None)

    def test_options_of_no_such_name(self):
        base, mesh = models.cad("bore/base"), models.mesh("bore/hex")
        for name, meant in {"improve": "'improve_below'", "tolerance": "tolerance'", "shape": "'kernel_shape'"}.items():
            with self.subTest(name), self.assertRaisesRegex(TypeError, f"no option '{name}': did you mean '.*{meant[1:]}"):
                cadmorph.Morpher(base, mesh, **{name: 0.1})
        with self.assertRaisesRegex(TypeError, r"no option 'xyzzy': help\(cadmorph.Morpher\)"):
            cadmorph.Morpher(base, mesh, xyzzy=1)

    def test_what_does_not_belong_together(self):
        with self.assertRaises(cadmorph.TopologyError) as caught:
            models.box_morpher().morph(models.cad("shapes/cylinder"))
        self.assertEqual(caught.exception.exit_code, 3)
        with self.assertRaises(cadmorph.AssociationError) as caught:
            cadmorph.Morpher(models.cad("shapes/cylinder"), models.mesh("shapes/box"))
        self.assertEqual(caught.exception.exit_code, 4)
        self.assertNotIn("--", str(caught.exception))
        self.assertIsInstance(caught.exception, cadmorph.Error)

    def test_a_result_that_can_not_be_written(self):
        result = models.box_morpher().morph(models.cad("shapes/box_variant"))
        with self.assertRaises(cadmorph.OutputError):
            result.write("no/such/folder/mesh.vtu")
        with self.assertRaises(TypeError):
            result.write(None)


if __name__ == "__main__":
    unittest.main()
