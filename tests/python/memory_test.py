"""Many variants in one process."""

import ctypes
import unittest

import cadmorph
import models


def resident_bytes():
    # What is free is given back first: the heap keeps some 15 MiB more or less from round to round.
    ctypes.CDLL(None).malloc_trim(0)
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096


class Memory(unittest.TestCase):
    def test_variants_leave_nothing_behind(self):
        cadmorph.set_thread_count(1)  # each thread has a heap of its own, which grows when it likes
        self.addCleanup(cadmorph.set_thread_count, 0)
        mesh = models.mesh("pipe/hex")
        morpher = cadmorph.Morpher(models.cad("pipe/base"), mesh)
        step = (models.FOLDER / "pipe/step05.step").read_bytes()

        def round_trip():
            result = morpher.morph(cadmorph.CadModel.from_step(step), progress=lambda phase, fraction: None)
            self.assertEqual(result.positions.shape, mesh.points.shape)
            cadmorph.Mesh(result.positions, mesh.cells, mesh.celltypes)
            return result.report.as_dict()

        for _ in range(20):  # until pools and caches have their size
            round_trip()
        rounds = 10
        growths = []
        for _ in range(3):
            before = resident_bytes()
            for _ in range(rounds):
                round_trip()
            growths.append(resident_bytes() - before)
        # One mesh or result a round would take twice as much, each time; a cache grows once.
        self.assertLess(min(growths), rounds * mesh.points.nbytes / 2)


if __name__ == "__main__":
    unittest.main()
