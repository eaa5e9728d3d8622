"""An OpenMDAO component over cadmorph: needs the package openmdao."""

import numpy as np
import openmdao.api as om

from ._native import QualityError, SolverError, TopologyError


class MeshComp(om.ExplicitComponent):
    """Surface coordinates in, volume coordinates out.

    Options: morpher, a cadmorph.Morpher; linearise, CadModels whose motions the volume morph is made
    one linear map for (Morpher.linearise): a mesh of a flow round a body is a smooth function of the
    surface then alone. None: it stays as it is. Input x_surface (3 m,), the nodes
    morpher.surface_nodes; output x_volume (3 N,). Both directions of the derivative are products
    without a matrix.
    """

    def initialize(self):
        self.options.declare("morpher", recordable=False)
        self.options.declare("linearise", default=None, allow_none=True, recordable=False)

    def setup(self):
        morpher = self.options["morpher"]
        if self.options["linearise"] is not None:
            morpher.linearise(list(self.options["linearise"]))
        points = morpher.mesh.points
        self.add_input("x_surface", val=points[morpher.surface_nodes].ravel())
        self.add_output("x_volume", val=points.ravel())
        self._at = None

    def setup_partials(self):
        self.declare_partials("x_volume", "x_surface")

    def compute(self, inputs, outputs):
        outputs["x_volume"] = self.options["morpher"].warp(inputs["x_surface"].reshape(-1, 3)).ravel()

    def compute_jacvec_product(self, inputs, d_inputs, d_outputs, mode):
        if "x_volume" not in d_outputs or "x_surface" not in d_inputs:
            return
        derivative = self._derivative(inputs["x_surface"])
        if mode == "fwd":
            d_outputs["x_volume"] += derivative.forward(d_inputs["x_surface"].reshape(-1, 3)).ravel()
        else:
            d_inputs["x_surface"] += derivative.adjoint(d_outputs["x_volume"].reshape(-1, 3)).ravel()

    def _derivative(self, surface):
        if self._at is None or not np.array_equal(self._at[0], surface):
            self._at = (surface.copy(), self.options["morpher"].derivative(surface.reshape(-1, 3)))
        return self._at[1]


class ParameterComp(om.ExplicitComponent):
    """CAD parameters in, volume coordinates out.

    Options: morpher; model, a function of the parameters (an array) that returns the CadModel;
    start, their values at first; steps, of the central differences; linearise, True unless given:
    the first compute makes the volume morph one linear map (Morpher.linearise), for the models a
    step above start. False for a morpher of another method than "rbf", and where kernels and the
    nodes that hold a far field are to be chosen for each motion: the mesh of a flow round a body
    then jumps a little where that choice changes, and drivers stall. Input parameters, output
    x_volume (3 N,). The derivative is that of one plain morph at the present parameters, by the
    models a step on either side: a warning says so where the morph was not plain, which a Morpher
    with quality="fast" avoids. Parameters that can't be morphed to raise AnalysisError, which
    drivers take as a failed design.
    """

    def initialize(self):
        self.options.declare("morpher", recordable=False)
        self.options.declare("model", recordable=False)
        self.options.declare("start")
        self.options.declare("steps")
        self.options.declare("linearise", default=True, types=bool)

    def setup(self):
        self.start = np.atleast_1d(np.asarray(self.options["start"], dtype=float))
        self.steps = np.broadcast_to(np.asarray(self.options["steps"], dtype=float), self.start.shape)
        self.add_input("parameters", val=self.start)
        self.add_output("x_volume", val=self.options["morpher"].mesh.points.ravel())
        self._at = None
        self._is_linearised = not self.options["linearise"]

    def setup_partials(self):
        self.declare_partials("x_volume", "parameters")

    def compute(self, inputs, outputs):
        variant = self.options["model"](np.array(inputs["parameters"]))
        try:
            self._linearise()
            result = self.options["morpher"].morph(variant)
        except (TopologyError, QualityError, SolverError) as error:
            raise om.AnalysisError(str(error)) from error
        if not result.report.is_plain:
            om.issue_warning(
                "the morph was stepped, repaired or raised: the derivative is that of a plain one; "
                'make the Morpher with quality="fast" where gradients are used',
                prefix=self.msginfo,
            )
        outputs["x_volume"] = result.positions.ravel()

    def compute_jacvec_product(self, inputs, d_inputs, d_outputs, mode):
        if "x_volume" not in d_outputs or "parameters" not in d_inputs:
            return
        for i, velocity in enumerate(self._velocities(np.array(inputs["parameters"]))):
            if mode == "fwd":
                d_outputs["x_volume"] += d_inputs["parameters"][i] * velocity
            else:
                d_inputs["parameters"][i] += np.dot(velocity, d_outputs["x_volume"])

    def _linearise(self):
        if not self._is_linearised:
            model = self.options["model"]
            self.options["morpher"].linearise([model(self.start + motion) for motion in np.diag(self.steps)])
            self._is_linearised = True

    def _velocities(self, parameters):
        if self._at is None or not np.array_equal(self._at[0], parameters):
            model, morpher = self.options["model"], self.options["morpher"]
            present = model(parameters)
            velocities = [
                morpher.velocity(model(parameters + motion), model(parameters - motion), step, at=present).nodes.ravel()
                for step, motion in zip(self.steps, np.diag(self.steps))
            ]
            self._at = (parameters, velocities)
        return self._at[1]
