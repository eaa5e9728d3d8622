"""Morphs, against the program."""

import filecmp
import gc
import json
import os
import signal
import subprocess
import tempfile
import threading
import unittest
from pathlib import Path

import cadmorph
import models
import numpy as np

PROGRAM = os.environ["CADMORPH_PROGRAM"]


class Morphs(unittest.TestCase):
    def test_files_are_the_programs_to_the_byte(self):
        local = ["--kernel", "wendland-c2", "--shape", "0.02", "--quality", "fast"]
        for base, variant, mesh, words, options in [
                ("bore/base", "bore/step20", "bore/hex", [], {}),
                ("shapes/blade", "shapes/blade_variant", "shapes/blade", [], {}),
                ("shapes/box", "shapes/box_variant", "shapes/box", local,
                 {"kernel": "wendland-c2", "kernel_shape": 0.02, "quality": "fast"})]:
            with self.subTest(base), tempfile.TemporaryDirectory() as folder:
                wanted = Path(folder) / "program.vtu"
                subprocess.run(
                    [PROGRAM, *(models.FOLDER / f"{name}.step" for name in (base, variant)),
                     models.FOLDER / f"{mesh}.vtu", "-o", wanted, "--quiet", *words], check=True)
                morpher = cadmorph.Morpher(models.cad(base), models.mesh(mesh), **options)
                result = morpher.morph(models.cad(variant))
                written = result.write(Path(folder) / "python.vtu")
                self.assertTrue(filecmp.cmp(written, wanted, shallow=False))
                self.assertTrue(np.array_equal(cadmorph.Mesh.read(wanted).points, result.positions))

    def test_periodic_sides_have_names(self):
        x, y, z = np.mgrid[0:5, 0:4, 0:3]
        number = np.arange(x.size).reshape(x.shape)
        corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
        cells = np.stack([number[i:4 + i, j:3 + j, k:2 + k] for i, j, k in corners], axis=-1)
        points = 10.0 * np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
        groups = {"low": number[0].ravel(), "high": number[-1].ravel(), "floor": number[:, :, 0].ravel()}
        mesh = cadmorph.Mesh(points, [("hexahedron", cells.reshape(-1, 8))], groups=groups)
        base, variant = models.cad("shapes/box"), models.box_of(46, 27, 24)
        result = cadmorph.Morpher(base, mesh, periodic=[("low", "high")]).morph(variant)
        self.assertEqual(result.report.notes,
                         ["periodic sides low, high: 12 nodes shifted by (40 0 0) mm, in the variant "
                          "shifted by (46 0 0) mm"])
        moved = result.positions - points
        self.assertLessEqual(np.abs(moved[groups["high"]] - moved[groups["low"]] - [6, 0, 0]).max(), 1e-12 * 60)
        with self.assertRaisesRegex(cadmorph.InvalidInputError, "'low' and 'floor' are no periodic sides"):
            cadmorph.Morpher(base, mesh, periodic=[("low", "floor")])

    def test_positions_are_a_view_that_keeps_the_result(self):
        result = models.box_morpher().morph(models.cad("shapes/box_variant"))
        positions = result.positions
        self.assertEqual(positions.dtype, np.float64)
        self.assertTrue(np.shares_memory(positions, result.positions))
        self.assertFalse(positions.flags.writeable)
        wanted = positions.copy()
        del result
        gc.collect()
        self.assertTrue(np.array_equal(positions, wanted))

    def test_the_report_has_units_in_its_names(self):
        morpher = models.box_morpher(quality="fast")
        result = morpher.morph(models.cad("shapes/box_variant"))
        report = result.report
        moved = np.linalg.norm(result.positions - morpher.mesh.points, axis=1).max()
        self.assertEqual(report.outcome, "done")
        self.assertAlmostEqual(report.max_displacement_mm, moved, delta=1e-12)
        self.assertEqual(report.nodes.vertex, 8)
        self.assertTrue(report.is_plain)
        self.assertIsNone(report.diagnosis)
        self.assertIn("after=QualityFigures(max_distance_mm=", repr(report))
        plain = json.loads(json.dumps(report.as_dict()))
        self.assertEqual(plain["base_cad"]["diagonal_mm"], report.base_cad.diagonal_mm)
        self.assertEqual(json.loads(result.json())["max_displacement_mm"], report.max_displacement_mm)
        self.assertIn("Largest move", result.summary())

    def test_quality_that_was_asked_for(self):
        morpher = cadmorph.Morpher(models.cad("bore/base"), models.mesh("bore/hex"), min_scaled_jacobian=0.9)
        variant = models.cad("bore/step20")
        with self.assertRaisesRegex(cadmorph.QualityError, "improve_below") as caught:
            morpher.morph(variant)
        self.assertNotIn("--", str(caught.exception))
        self.assertEqual(caught.exception.exit_code, 5)
        result = morpher.morph(variant, keep_refused=True)
        self.assertEqual(result.report.outcome, "quality below what was asked")
        self.assertGreater(result.report.diagnosis.bad_cells, 0)
        with tempfile.TemporaryDirectory() as folder:
            self.assertEqual(result.write(Path(folder) / "out.vtu").name, "out.failed.vtu")

    def test_a_morph_goes_on_from_another(self):
        first = models.box_morpher(quality="fast").morph(models.cad("shapes/box_variant"))
        there = models.mesh("shapes/box").at(first.positions)
        back = cadmorph.Morpher(models.cad("shapes/box_variant"), there, quality="fast").morph(
            models.cad("shapes/box"))
        base = models.mesh("shapes/box").points
        self.assertLess(abs(back.positions - base).max(), 1e-9 * models.cad("shapes/box").diagonal_mm)


class Progress(unittest.TestCase):
    def test_it_is_told(self):
        told = []
        morpher = models.box_morpher(progress=lambda phase, fraction: told.append((phase, fraction)))
        self.assertIn(("association", 0.0), told)
        told.clear()
        morpher.morph(models.cad("shapes/box_variant"), progress=lambda *figures: told.append(figures))
        self.assertIn(("matching", 0.0), told)
        self.assertTrue(all(0 <= fraction <= 1 for _, fraction in told))

    def test_false_cancels_and_the_morpher_lives_on(self):
        morpher = models.box_morpher()
        variant = models.cad("shapes/box_variant")
        wanted = morpher.morph(variant).positions
        with self.assertRaises(cadmorph.CancelledError):
            morpher.morph(variant, progress=lambda phase, fraction: False)
        with self.assertRaises(cadmorph.CancelledError):
            models.box_morpher(progress=lambda phase, fraction: False)
        self.assertTrue(np.array_equal(morpher.morph(variant).positions, wanted))

    def test_what_a_callback_raises_comes_out(self):
        class Mine(Exception):
            pass

        def fault(phase, fraction):
            raise Mine(phase)

        with self.assertRaisesRegex(Mine, "boundary"):
            models.box_morpher(progress=fault)
        with self.assertRaisesRegex(Mine, "matching"):
            models.box_morpher().morph(models.cad("shapes/box_variant"), progress=fault)
        with self.assertRaises(TypeError):
            models.box_morpher(progress=lambda: None)
        with self.assertRaises(ZeroDivisionError):
            models.box_morpher(progress=lambda phase, fraction: 1 / 0)

    def test_an_interrupt_ends_the_work(self):
        morpher = models.box_morpher()

        def interrupt(phase, fraction):
            os.kill(os.getpid(), signal.SIGINT)

        before = signal.signal(signal.SIGINT, signal.default_int_handler)
        try:
            with self.assertRaises(KeyboardInterrupt):
                morpher.morph(models.cad("shapes/box_variant"), progress=interrupt)
        finally:
            signal.signal(signal.SIGINT, before)


class Threads(unittest.TestCase):
    def test_others_run_during_work(self):
        # The callback waits for another thread, which needs the interpreter meanwhile.
        turn, done = threading.Event(), threading.Event()

        def other():
            turn.wait()
            done.set()

        thread = threading.Thread(target=other)
        thread.start()

        def wait(phase, fraction):
            turn.set()
            self.assertTrue(done.wait(60))

        models.box_morpher(progress=wait)
        thread.join()

    def test_two_threads_on_one_object(self):
        morpher = models.box_morpher()
        variant = models.cad("shapes/box_variant")
        refusals = []

        def again():
            try:
                morpher.morph(variant)
            except cadmorph.InvalidInputError as error:
                refusals.append(str(error))

        def from_another_thread(phase, fraction):
            thread = threading.Thread(target=again)
            thread.start()
            thread.join()
            again()

        result = morpher.morph(variant, progress=from_another_thread)
        self.assertGreater(len(refusals), 1)
        self.assertIn("at work for another call", refusals[0])
        self.assertTrue(np.array_equal(result.positions, morpher.morph(variant).positions))

    def test_a_morpher_for_each_thread(self):
        wanted = models.box_morpher().morph(models.cad("shapes/box_variant")).positions
        results = []

        def work():
            morpher = models.box_morpher()
            for _ in range(5):
                results.append(morpher.morph(models.cad("shapes/box_variant")).positions)

        threads = [threading.Thread(target=work) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(len(results), 20)
        self.assertTrue(all(np.array_equal(result, wanted) for result in results))

    def test_the_number_of_threads_changes_nothing(self):
        variant = models.cad("bore/step20")
        results = []
        for count in (1, 2):
            cadmorph.set_thread_count(count)
            self.assertEqual(cadmorph.thread_count(), count)
            morpher = cadmorph.Morpher(models.cad("bore/base"), models.mesh("bore/hex"))
            results.append(morpher.morph(variant).positions)
        cadmorph.set_thread_count(0)
        self.assertTrue(np.array_equal(*results))


if __name__ == "__main__":
    unittest.main()
