"""Many variants in one process."""

import unittest

import cadmorph
import models


def resident_bytes():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096


class Memory(unittest.TestCase):
    def test_variants_leave_nothing_behind(self):
        morpher = models.box_morpher()
        step = (models.FOLDER / "shapes/box_variant.step").read_bytes()
        mesh = models.mesh("shapes/box")

        def round_trip():
            result = morpher.morph(cadmorph.CadModel.from_step(step), progress=lambda phase, fraction: None)
            self.assertEqual(result.positions.shape, mesh.points.shape)
            cadmorph.Mesh(result.positions, mesh.cells, mesh.celltypes)
            return result.report.as_dict()

        for _ in range(40):  # until pools and caches have their size
            round_trip()
        before = resident_bytes()
        rounds = 200
        for _ in range(rounds):
            round_trip()
        # One mesh, model or result a round would take 200 of them.
        self.assertLess(resident_bytes() - before, rounds * mesh.points.nbytes / 2)


if __name__ == "__main__":
    unittest.main()
