"""Derivatives of the volume and the surface, and the programs' classes over them."""

import shutil
import tempfile
import unittest
from pathlib import Path

import cadmorph
import models
import numpy as np
from cadmorph.idwarp import USMesh
from openmdao_alone import om


class Derivatives(unittest.TestCase):
    def setUp(self):
        self.morpher = models.box_morpher()
        mesh = self.morpher.mesh.points
        self.n, self.m = len(mesh), len(self.morpher.surface_nodes)
        self.start = mesh[self.morpher.surface_nodes]
        self.random = np.random.default_rng(3)

    def test_forward_and_adjoint_are_transposes(self):
        target = self.start + 0.1 * np.sin(self.start[:, ::-1])
        for derivative in (self.morpher.derivative(), self.morpher.derivative(target)):
            u, v = self.random.normal(size=(self.m, 6)), self.random.normal(size=(self.n, 6))
            forward, adjoint = derivative.forward(u), derivative.adjoint(v)
            self.assertEqual((forward.shape, adjoint.shape), ((self.n, 6), (self.m, 6)))
            self.assertLess(abs(np.vdot(v, forward) - np.vdot(adjoint, u)),
                            1e-12 * np.linalg.norm(v) * np.linalg.norm(forward))
            self.assertTrue(np.array_equal(forward[self.morpher.surface_nodes], u))

    def test_it_is_the_slope_of_the_warp(self):
        u = self.random.normal(size=(self.m, 3))
        slope = self.morpher.derivative().forward(u)
        for h in (1e-1, 1e-3):
            plus, minus = (self.morpher.warp(self.start + sign * h * u) for sign in (1, -1))
            self.assertLess(abs((plus - minus) / (2 * h) - slope).max(), 1e-10 / h)

    def test_velocity_of_the_box(self):
        base, variant = models.cad("shapes/box"), models.cad("shapes/box_variant")
        velocity = self.morpher.velocity(variant, base, 0.5)
        # A step so large, for once, leads onto the variant: the morph of so few nodes is linear.
        moved = self.morpher.warp(self.start + velocity.surface) - self.morpher.mesh.points
        self.assertLess(abs(velocity.nodes - moved).max(), 1e-9)
        plain = models.box_morpher(untangle="never").morph(variant).positions
        self.assertLess(abs(plain - moved - self.morpher.mesh.points).max(), 1e-9)
        self.assertTrue(np.array_equal(velocity.surface, velocity.nodes[self.morpher.surface_nodes]))
        self.assertAlmostEqual(velocity.unevenness, 1)
        self.assertIn("not midway", velocity.warnings[0])

    def test_velocity_about_a_variant(self):
        base, variant = models.cad("shapes/box"), models.cad("shapes/box_variant")
        moved = self.morpher.velocity(variant, base, 0.5).surface
        velocity = self.morpher.velocity(variant, base, 0.5, at=variant)
        self.assertTrue(np.array_equal(velocity.surface, moved))
        self.assertAlmostEqual(velocity.unevenness, 1)
        self.assertIn("the present surface is not midway", velocity.warnings[0])
        # So few nodes have one map everywhere.
        self.assertLess(abs(velocity.nodes - self.morpher.derivative(self.start + moved).forward(moved)).max(), 1e-9)
        self.assertIsNone(velocity.errors)

    def test_richardsons_estimate(self):
        base, variant = models.cad("shapes/box"), models.cad("shapes/box_variant")
        wide = self.morpher.velocity(variant, base, 1.0)
        # The same models for half the step: a velocity twice as large, for once.
        both = self.morpher.velocity(variant, base, 1.0, half=(variant, base))
        self.assertLess(abs(both.nodes - 7 / 3 * wide.nodes).max(), 1e-9)
        self.assertLess(abs(both.errors - np.linalg.norm(wide.nodes, axis=1) / 3).max(), 1e-9)

    def test_gradient_of_a_table(self):
        base, variant = models.cad("shapes/box"), models.cad("shapes/box_variant")
        slopes = self.random.normal(size=(self.n, 3))
        told = []
        with tempfile.TemporaryDirectory() as folder:
            for name in ("box", "box_variant"):
                shutil.copy(models.FOLDER / f"shapes/{name}.step", folder)
            table = Path(folder) / "parameters.csv"
            table.write_text("name,plus,minus,step\nlength,box_variant.step,box.step,0.5\n\"a, b\",box.step,box_variant.step,1\n")
            parameters = cadmorph.read_parameters(table)
            by_files = self.morpher.gradient(slopes, table)
            for line, text in [("x,box.step,box.step,fast", "'fast' is no number"), ("x,box.step,,1", "no minus"),
                               ("length,box.step,box.step,1\nlength,box.step,box.step,1", "twice"), ("", "no parameter")]:
                table.write_text(f"name,plus,minus,step\n{line}\n")
                with self.assertRaisesRegex(cadmorph.InvalidInputError, text):
                    cadmorph.read_parameters(table)
        with self.assertRaises(cadmorph.IoError):
            cadmorph.read_parameters(table)
        entries = self.morpher.gradient(slopes, parameters, progress=lambda *now: told.append(now))
        self.assertEqual([entry.name for entry in entries], ["length", "a, b"])
        expected = np.vdot(slopes, self.morpher.velocity(variant, base, 0.5).nodes)
        self.assertAlmostEqual(entries[0].gradient, expected, delta=1e-9 * abs(expected))
        self.assertAlmostEqual(entries[1].gradient, -expected / 2, delta=1e-9 * abs(expected))
        self.assertIn(("parameters", 0.5), told)
        self.assertEqual([(entry.name, entry.gradient) for entry in by_files],
                         [(entry.name, entry.gradient) for entry in entries])
        with self.assertRaises(cadmorph.IoError):
            self.morpher.gradient(slopes, "none.csv")
        with self.assertRaisesRegex(cadmorph.InvalidInputError, "path of a table"):
            self.morpher.gradient(slopes, 7)
        at_variant = self.morpher.gradient(slopes, {"length": (variant, base, 0.5)}, at=variant)[0]
        expected = np.vdot(slopes, self.morpher.velocity(variant, base, 0.5, at=variant).nodes)
        self.assertAlmostEqual(at_variant.gradient, expected, delta=1e-9 * abs(expected))
        with self.assertRaises(cadmorph.CancelledError):
            self.morpher.gradient(slopes, parameters, progress=lambda *now: False)
        for bad in (slopes[:-1], np.zeros((self.n - 1, 3)), np.full_like(slopes, np.nan), "text"):
            with self.assertRaises(cadmorph.InvalidInputError):
                self.morpher.gradient(bad, parameters)
        with self.assertRaisesRegex(cadmorph.InvalidInputError, "expected .plus, minus, step."):
            self.morpher.gradient(slopes, {"length": (variant, base)})
        with self.assertRaisesRegex(cadmorph.InvalidInputError, "expected .plus, minus, step."):
            self.morpher.gradient(slopes, {"length": (variant, None, 1.0)})

    def test_what_does_not_fit_is_refused(self):
        derivative = self.morpher.derivative()
        u = np.zeros((self.m, 3))
        for bad in (u[:-1], u[:, 0], "text", u.astype(complex), np.full_like(u, np.nan), None):
            with self.assertRaises(cadmorph.InvalidInputError):
                derivative.forward(bad)
        with self.assertRaises(cadmorph.InvalidInputError):
            derivative.adjoint(u)
        with self.assertRaises(cadmorph.InvalidInputError):
            self.morpher.warp(u[:-1])
        with self.assertRaises(cadmorph.InvalidInputError):
            models.box_morpher(method="femwarp").derivative()
        base = models.cad("shapes/box")
        with self.assertRaises(cadmorph.InvalidInputError):
            self.morpher.velocity(base, base, 0.0)
        strided = np.zeros((self.m, 6))[:, ::2]
        strided.flags.writeable = False
        self.assertEqual(derivative.forward(strided).shape, (self.n, 3))


class FarField(unittest.TestCase):
    def setUp(self):
        self.base, self.grown = models.cad("shapes/box"), models.box_of(41, 31, 21)
        self.morpher = models.far_box_morpher()
        self.slopes = np.random.default_rng(6).normal(size=(self.morpher.mesh.node_count, 3))

    def gradient(self, **at):
        return self.morpher.gradient(self.slopes, {"radius": (self.grown, self.base, 0.5)}, **at)[0].gradient

    def test_about_the_base_itself(self):
        at_base = self.gradient()
        moved = self.morpher.velocity(self.grown, self.base, 0.5, at=self.base)
        self.assertLess(np.linalg.norm(moved.nodes, axis=1).max(), 1.21 * np.linalg.norm(moved.surface, axis=1).max())
        self.assertEqual(self.gradient(at=self.base), at_base)
        self.assertEqual(self.gradient(at=models.cad("shapes/box")), at_base)

    def test_linearised_all_agree(self):
        by_adjoint = np.vdot(self.morpher.derivative().adjoint(self.slopes),
                             self.morpher.velocity(self.grown, self.base, 0.5).surface)
        self.assertGreater(abs(by_adjoint - self.gradient()), 0.1 * abs(self.gradient()))  # without anchors
        self.morpher.linearise([self.grown])
        velocity = self.morpher.velocity(self.grown, self.base, 0.5)
        surface = self.morpher.mesh.points[self.morpher.surface_nodes]
        plus, minus = (self.morpher.warp(surface + sign * 0.1 * velocity.surface) for sign in (1, -1))
        by_differences = np.vdot(self.slopes, (plus - minus) / 0.2)
        by_adjoint = np.vdot(self.morpher.derivative().adjoint(self.slopes), velocity.surface)
        morphed = self.morpher.morph(self.grown).positions - self.morpher.mesh.points
        scale = np.linalg.norm(self.slopes) * np.linalg.norm(velocity.nodes)
        for value in (by_differences, by_adjoint, np.vdot(self.slopes, morphed), np.vdot(self.slopes, velocity.nodes),
                      self.gradient(at=self.grown)):
            self.assertLess(abs(value - self.gradient()), 1e-9 * scale)

    def test_what_can_not_be_linearised_for(self):
        for nothing in ([], [self.base]):
            with self.assertRaisesRegex(cadmorph.InvalidInputError, "no model"):
                self.morpher.linearise(nothing)
        with self.assertRaises(TypeError):
            self.morpher.linearise([None])


class Sliding(unittest.TestCase):
    def setUp(self):
        self.morpher = cadmorph.Morpher(models.cad("shapes/box"), models.around_box(), quality="fast")
        points = self.morpher.mesh.points[self.morpher.surface_nodes]
        inside = (abs(points - [20, 15, 0]) < [20.1, 15.1, 20.1]).all(axis=1)
        rim = (abs(points[:, :2] - [20, 15]) > [59.9, 44.9]).any(axis=1)
        self.follows = (points[:, 2] == 0) & ~inside & ~rim
        self.base = points

    def test_slide_is_what_the_morph_does(self):
        result = self.morpher.morph(models.box_of(44, 27, 24))
        wanted = result.positions[self.morpher.surface_nodes]
        given = np.where(self.follows[:, None], self.base + [1, 2, 3], wanted)
        self.assertGreater(abs(wanted - self.base)[self.follows].max(), 0.5)
        self.assertLess(abs(self.morpher.slide(given) - wanted).max(), 1e-11)
        self.assertLess(abs(self.morpher.warp(self.morpher.slide(given)) - result.positions).max(), 1e-11)
        with self.assertRaises(cadmorph.InvalidInputError):
            self.morpher.slide(given[:-1])

    def test_the_derivative_goes_through_planes_that_slide(self):
        random = np.random.default_rng(5)
        start = self.morpher.slide(self.base + 0.05 * self.base * ~self.follows[:, None] * (self.base[:, 2:] < 30))
        derivative = self.morpher.derivative(start, slide=True)
        u = random.normal(size=(len(self.base), 6))
        v = random.normal(size=(self.morpher.mesh.node_count, 6))
        forward, adjoint = derivative.forward(u), derivative.adjoint(v)
        self.assertLess(abs(np.vdot(v, forward) - np.vdot(adjoint, u)), 1e-12 * np.linalg.norm(v) * np.linalg.norm(forward))
        self.assertFalse(adjoint[self.follows].any())
        self.assertTrue(adjoint[~self.follows].any(axis=1).all())
        plain = self.morpher.derivative(start).forward(u)
        self.assertGreater(abs(plain - forward).max(), 0.1)
        h = 1e-3
        plus, minus = (self.morpher.warp(self.morpher.slide(start + sign * h * u[:, :3])) for sign in (1, -1))
        self.assertLess(abs((plus - minus) / (2 * h) - forward[:, :3]).max(), 1e-8)
        with self.assertRaisesRegex(cadmorph.InvalidInputError, "three columns each"):
            derivative.forward(u[:, :2])


class IDWarp(unittest.TestCase):
    def test_its_calls(self):
        mesh = USMesh({"gridFile": models.FOLDER / "shapes/box.vtu", "cadFile": models.FOLDER / "shapes/box.step"})
        surface = mesh.getSurfaceCoordinates()
        mesh.setSurfaceCoordinates(surface * [1.5, 1, 1])
        mesh.warpMesh()
        grid = mesh.getSolverGrid().reshape(-1, 3)
        self.assertLess(abs(grid - mesh.morpher.mesh.points * [1.5, 1, 1]).max(), 1e-9)
        random = np.random.default_rng(4)
        u, v = random.normal(size=surface.shape), random.normal(size=grid.size)
        mesh.warpDeriv(v)
        forward = mesh.warpDerivFwd(u)
        self.assertLess(abs(np.dot(v, forward) - np.vdot(mesh.getdXs(), u)),
                        1e-12 * np.linalg.norm(v) * np.linalg.norm(forward))
        with self.assertRaises(ValueError):
            mesh.setSurfaceCoordinates(surface[:-1])
        with self.assertRaises(ValueError):
            USMesh({"gridFile": "box.vtu"})


@unittest.skipUnless(om, "needs OpenMDAO")
class OpenMDAO(unittest.TestCase):
    def check(self, component, bound, *places):
        problem = om.Problem()
        problem.model.add_subsystem("mesh", component)
        problem.setup(force_alloc_complex=False)
        for place in places or [None]:
            if place:
                problem.set_val("mesh.parameters", place)
            problem.run_model()
            checked = problem.check_partials(out_stream=None, form="central", step=1e-3)
            for (output, given), errors in checked["mesh"].items():
                self.assertLess(max(abs(errors["J_fwd"] - errors["J_fd"]).max(),
                                    abs(errors["J_rev"] - errors["J_fd"]).max()), bound, (output, given, place))

    def test_partials_of_the_mesh(self):
        from cadmorph.openmdao import MeshComp

        self.check(MeshComp(morpher=models.box_morpher()), 1e-8)

    def test_partials_in_a_far_field(self):
        from cadmorph.openmdao import MeshComp, ParameterComp

        base, grown = models.cad("shapes/box"), models.box_of(41, 31, 21)
        # From the base to the variant alone: the derivative at the base by these two models.
        problem = om.Problem()
        problem.model.add_subsystem("mesh", ParameterComp(morpher=models.far_box_morpher(), start=[0.0], steps=1.0,
                                                          model=lambda p: grown if p[0] > 0 else base))
        problem.setup()
        moved = []
        for place in (0.0, 1.0):
            problem.set_val("mesh.parameters", place)
            problem.run_model()
            moved.append(problem.get_val("mesh.x_volume").copy())
            if place == 0:
                slope = next(iter(problem.compute_totals(of=["mesh.x_volume"], wrt=["mesh.parameters"]).values())).ravel()
        self.assertLess(abs(2 * slope - (moved[1] - moved[0])).max(), 1e-9 * abs(moved[0]).max())

        held = models.far_box_morpher()
        problem = om.Problem()
        problem.model.add_subsystem("mesh", MeshComp(morpher=held, linearise=[grown]))
        problem.setup()
        surface = held.mesh.points[held.surface_nodes]
        u = held.velocity(grown, base, 0.5).surface
        moved = []
        for sign in (1, -1):
            problem.set_val("mesh.x_surface", (surface + 0.1 * sign * u).ravel())
            problem.run_model()
            moved.append(problem.get_val("mesh.x_volume").reshape(-1, 3).copy())
        self.assertLess(abs((moved[0] - moved[1]) / 0.2 - held.derivative().forward(u)).max(), 1e-9 * abs(u).max())

    def test_partials_of_parameters_anywhere(self):
        from cadmorph.openmdao import ParameterComp

        # Sides that are not linear in the parameters: the derivative is another one at each point.
        component = ParameterComp(morpher=models.box_morpher(), start=[0.0, 0.0], steps=1e-3,
                                  model=lambda p: models.box_of(40 * np.exp(p[0]), 30 + 5 * p[0] * p[1], 20 / (1 + p[1])))
        self.check(component, 1e-4, [0.0, 0.0], [0.1, 0.2], [-0.2, 0.1])

    def test_partials_of_parameters(self):
        from cadmorph.openmdao import ParameterComp

        base, variant = models.cad("shapes/box"), models.cad("shapes/box_variant")
        # A parameter whose models are at hand: 0 and 1 alone.
        component = ParameterComp(morpher=models.box_morpher(), start=[0.0], steps=1e-3,
                                  model=lambda p: variant if p[0] > 0 else base)
        problem = om.Problem()
        problem.model.add_subsystem("mesh", component)
        problem.setup()
        problem.set_val("mesh.parameters", 1.0)
        problem.run_model()
        wanted = models.box_morpher().morph(variant).positions
        self.assertLess(abs(problem.get_val("mesh.x_volume").reshape(-1, 3) - wanted).max(), 1e-9)
        problem.set_val("mesh.parameters", 0.0)
        problem.run_model()
        jacobian = problem.compute_totals(of=["mesh.x_volume"], wrt=["mesh.parameters"])
        slope = next(iter(jacobian.values())).reshape(-1, 3)
        moved = models.box_morpher().velocity(variant, base, 0.5).nodes
        self.assertLess(abs(2e-3 * slope - moved).max(), 1e-9)


if __name__ == "__main__":
    unittest.main()
