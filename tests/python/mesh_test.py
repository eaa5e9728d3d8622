"""Meshes from and to arrays."""

import gc
import io
import tempfile
import types
import unittest
from pathlib import Path

import cadmorph
import models
import numpy as np

POINTS = np.vstack([np.zeros(3), np.eye(3), np.ones(3)])
TETRAS = np.array([[0, 1, 2, 3], [1, 2, 3, 4]])


def same(a, b):
    return (
        np.array_equal(a.points, b.points)
        and np.array_equal(a.celltypes, b.celltypes)
        and np.array_equal(a.offsets, b.offsets)
        and np.array_equal(a.connectivity, b.connectivity)
    )


class Arrays(unittest.TestCase):
    def test_forms_of_cells_make_the_same_mesh(self):
        wanted = cadmorph.Mesh(POINTS, [("tetra", TETRAS)])
        flat = np.array([4, 0, 1, 2, 3, 4, 1, 2, 3, 4])
        block = types.SimpleNamespace(type="tetra", data=TETRAS)
        forms = {
            "dict": cadmorph.Mesh(POINTS, {"tetra": TETRAS}),
            "number": cadmorph.Mesh(POINTS, [(10, TETRAS)]),
            "blocks": cadmorph.Mesh(POINTS, [block]),
            "two blocks": cadmorph.Mesh(POINTS, [("tetra", TETRAS[:1]), ("tetra", TETRAS[1:])]),
            "flat": cadmorph.Mesh(POINTS, flat, [10, 10]),
            "meshio": cadmorph.Mesh.from_meshio(types.SimpleNamespace(points=POINTS, cells=[block])),
            "pyvista": cadmorph.Mesh.from_pyvista(
                types.SimpleNamespace(points=POINTS, cells=flat, celltypes=np.uint8([10, 10]))),
            "gmsh": cadmorph.Mesh.from_gmsh(
                np.uint64([7, 8, 9, 11, 12]), POINTS.ravel(), [4], [np.uint64([7, 8, 9, 11, 8, 9, 11, 12])]),
            "lists": cadmorph.Mesh(POINTS.tolist(), [("tetra", TETRAS.tolist())]),
            "integers": cadmorph.Mesh(POINTS.astype(int), [("tetra", TETRAS.astype(np.int32))]),
            "unsigned": cadmorph.Mesh(POINTS, [("tetra", TETRAS.astype(np.uint64))]),
            "not contiguous": cadmorph.Mesh(
                np.asfortranarray(POINTS), [("tetra", np.repeat(TETRAS, 2, axis=1)[:, ::2])]),
            "other bytes": cadmorph.Mesh(POINTS.astype(">f8"), [("tetra", TETRAS.astype(">i8"))]),
        }
        for name, mesh in forms.items():
            with self.subTest(name):
                self.assertTrue(same(mesh, wanted))
        self.assertTrue(np.array_equal(wanted.cells, flat))

    def test_read_only_arrays_are_taken(self):
        points, cells = POINTS.copy(), TETRAS.copy()
        points.setflags(write=False)
        cells.setflags(write=False)
        self.assertEqual(cadmorph.Mesh(points, [("tetra", cells)]).cell_count, 2)

    def test_the_mesh_keeps_its_own_copy(self):
        points = POINTS.copy()
        mesh = cadmorph.Mesh(points, [("tetra", TETRAS)])
        points[:] = 7
        self.assertTrue(np.array_equal(mesh.points, POINTS))

    def test_arrays_are_views_that_keep_the_mesh(self):
        mesh = models.mesh("shapes/box")
        points = mesh.points
        self.assertEqual(points.dtype, np.float64)
        self.assertEqual(points.shape, (mesh.node_count, 3))
        self.assertFalse(points.flags.owndata)
        self.assertTrue(np.shares_memory(points, mesh.points))
        self.assertFalse(points.flags.writeable)
        with self.assertRaises(ValueError):
            points[0, 0] = 1
        wanted = points.copy()
        del mesh
        gc.collect()
        self.assertTrue(np.array_equal(points, wanted))

    def test_groups_and_regions(self):
        mesh = cadmorph.Mesh(POINTS, [("tetra", TETRAS)], regions=[1, 2], groups={"wall": [3, 1, 3]})
        self.assertEqual(mesh.regions.tolist(), [1, 2])
        self.assertEqual({name: nodes.tolist() for name, nodes in mesh.groups.items()}, {"wall": [1, 3]})

    def test_sets_of_meshio_are_groups(self):
        triangles = types.SimpleNamespace(type="triangle", data=np.array([[0, 1, 2], [1, 2, 3]]), dim=2)
        tetras = types.SimpleNamespace(type="tetra", data=TETRAS, dim=3)
        mesh = cadmorph.Mesh.from_meshio(types.SimpleNamespace(
            points=POINTS, cells=[triangles, tetras],
            point_sets={"tip": np.array([4])},
            cell_sets={"wall": [np.array([1]), None], "body": [None, np.array([0])], "gmsh:bounding_entities": []},
            cell_data={"gmsh:physical": [np.array([5, 6]), np.array([5, 5])]},
            field_data={"inlet": np.array([5, 2]), "gone": np.array([7, 2])}))
        self.assertEqual({name: nodes.tolist() for name, nodes in mesh.groups.items()},
                         {"tip": [4], "wall": [1, 2, 3], "body": [0, 1, 2, 3], "inlet": [0, 1, 2]})

    def test_every_type_of_meshio_that_cadmorph_takes(self):
        try:
            import meshio
        except ImportError:
            self.skipTest("meshio is not installed")
        numbers = meshio._vtk_common.meshio_to_vtk_type
        for path in sorted(models.FOLDER.glob("shapes/*.vtu")):
            with self.subTest(path.name):
                theirs = meshio.read(path)
                ours = cadmorph.Mesh.from_meshio(theirs)
                self.assertTrue(np.array_equal(ours.points, theirs.points))
                wanted = [numbers[block.type] for block in theirs.cells for _ in block.data]
                self.assertEqual(ours.celltypes.tolist(), wanted)
                nodes = np.concatenate([block.data.ravel() for block in theirs.cells])
                self.assertTrue(np.array_equal(ours.connectivity, nodes))


class Files(unittest.TestCase):
    def test_a_file_and_its_arrays_morph_alike(self):
        file = models.mesh("shapes/cylinder_quadratic")
        arrays = cadmorph.Mesh(file.points, file.cells, file.celltypes)
        self.assertTrue(same(file, arrays))
        base, variant = models.cad("shapes/cylinder_quadratic"), models.cad("shapes/cylinder_quadratic_variant")
        results = [cadmorph.Morpher(base, mesh).morph(variant).positions for mesh in (file, arrays)]
        self.assertTrue(np.array_equal(*results))

    def test_a_copy_is_written(self):
        mesh = cadmorph.Mesh(POINTS, [("tetra", TETRAS)])
        with tempfile.TemporaryDirectory() as folder:
            path = mesh.write(Path(folder) / "mesh.vtu", 2 * POINTS)
            self.assertEqual(path, Path(folder) / "mesh.vtu")
            self.assertTrue(np.array_equal(cadmorph.Mesh.read(path).points, 2 * POINTS))
            self.assertTrue(same(cadmorph.Mesh.read(mesh.write(str(path))), mesh))

    def test_a_model_comes_from_a_path_bytes_or_an_open_file(self):
        path = models.FOLDER / "shapes/box.step"
        wanted = cadmorph.CadModel.from_step(str(path))
        self.assertEqual(wanted.face_count, 6)
        with open(path, "rb") as file:
            forms = [path.read_bytes(), bytearray(path.read_bytes()), memoryview(path.read_bytes()),
                     io.BytesIO(path.read_bytes()), file]
            for form in forms:
                with self.subTest(type(form)):
                    model = cadmorph.CadModel.from_step(form)
                    self.assertTrue(np.array_equal(model.lower_mm, wanted.lower_mm))
                    self.assertTrue(np.array_equal(model.upper_mm, wanted.upper_mm))


if __name__ == "__main__":
    unittest.main()
