"""Makes a bracket lighter under a stress limit: OpenCASCADE (by gmsh), cadmorph, CalculiX, SciPy.

Needs Debian's python3-gmsh, python3-scipy, python3-matplotlib and calculix-ccx.
usage: optimise_bracket.py [FOLDER [SIZE]]    (default: out/bracket, cells of 4 mm)
"""

import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import cadmorph
import gmsh
import matplotlib
import numpy as np
from scipy.optimize import minimize

matplotlib.use("Agg")
import matplotlib.pyplot as plt

LENGTH, WIDTH, HEIGHT = 60, 50, 70                     # mm
FORCE, LIMIT, DENSITY = 1000, 150, 7.85e-6             # N, MPa, kg/mm^3
NAMES = ("wall", "fillet", "rib thickness", "rib leg")
START, LOWER, UPPER = (8, 4, 6, 25), (4, 3, 3, 15), (10, 10, 10, 35)
STEP = 0.02                                            # of every parameter, mm
SHARPNESS = 16                                         # of the norm that stands for the largest stress


class Bracket:
    """An L with a fillet in its corner, and a rib, in gmsh's OpenCASCADE."""

    def __init__(self, folder):
        gmsh.initialize(["gmsh", "-v", "2", "-nt", "1"])
        self.file = folder / "part.brep"

    def model(self, parameters):
        """The CAD model for parameters in millimetres."""
        wall, radius, thickness, leg = (float(p) for p in parameters)
        gmsh.clear()
        end, half, tip = wall + radius, wall / 2, wall + leg
        body = self.pad([(0, 0), (LENGTH, 0), (LENGTH, wall), (end, wall), (wall, end), (wall, HEIGHT), (0, HEIGHT)],
                        0, WIDTH, arc_centre=(end, end))
        rib = self.pad([(half, half), (tip, half), (tip, wall), (wall, tip), (half, tip)],
                       (WIDTH - thickness) / 2, thickness)
        gmsh.model.occ.fuse(body, rib)
        gmsh.model.occ.synchronize()
        gmsh.write(str(self.file))
        return cadmorph.CadModel.from_brep(self.file.read_bytes())

    @staticmethod
    def pad(corners, y, width, arc_centre=None):
        """A solid over corners (x, z); with a centre, the line after the fourth of them is an arc."""
        occ = gmsh.model.occ
        points = [occ.addPoint(x, y, z) for x, z in corners]
        lines = []
        for i, start in enumerate(points):
            end = points[(i + 1) % len(points)]
            if arc_centre and i == 3:
                lines.append(occ.addCircleArc(start, occ.addPoint(arc_centre[0], y, arc_centre[1]), end))
            else:
                lines.append(occ.addLine(start, end))
        face = occ.addPlaneSurface([occ.addCurveLoop(lines)])
        return [entity for entity in occ.extrude([(2, face)], 0, width, 0) if entity[0] == 3]

    @staticmethod
    def mesh(file, size):
        """Quadratic tetrahedra of the part drawn last, in CalculiX's format."""
        gmsh.model.addPhysicalGroup(3, [1], 1)
        gmsh.model.setPhysicalName(3, 1, "PART")
        for name, value in [("MeshSizeMax", size), ("MeshSizeFromCurvature", 10), ("ElementOrder", 2)]:
            gmsh.option.setNumber(f"Mesh.{name}", value)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(file))
        return cadmorph.Mesh.read(file)


class Mass:
    """Of the mesh, and its exact derivative by the nodes' positions."""

    def __init__(self, mesh):
        self.cells = mesh.connectivity.reshape(-1, 10)
        near, far = (5 - 5 ** 0.5) / 20, (5 + 3 * 5 ** 0.5) / 20    # four points, as CalculiX takes them
        self.slopes = [self.slopes_at(np.where(np.arange(4) == i, far, near)) for i in range(4)]

    @staticmethod
    def slopes_at(barycentric):
        """Of a cell's ten shape functions, (10, 3)."""
        corner = np.array([[-1, -1, -1], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
        edges = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
        return np.array([(4 * barycentric[i] - 1) * corner[i] for i in range(4)]
                        + [4 * (barycentric[i] * corner[j] + barycentric[j] * corner[i]) for i, j in edges])

    def __call__(self, positions):
        total, slope = 0.0, np.zeros(positions.shape)
        for shape in self.slopes:
            a, b, c = np.einsum("nd,cnx->dcx", shape, positions[self.cells])
            by_jacobian = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)])
            total += (a * by_jacobian[0]).sum() / 24
            np.add.at(slope, self.cells, np.einsum("nd,dcx->cnx", shape, by_jacobian) / 24)
        return DENSITY * total, DENSITY * slope


class Stress:
    """CalculiX: the foot is held, the wall's upper end pulled along x."""

    def __init__(self, mesh, folder):
        self.mesh, self.folder = mesh, folder
        z = mesh.points[:, 2]
        middles = mesh.points[mesh.connectivity.reshape(-1, 10)[:, :4]].mean(axis=1)
        # Elsewhere the stress is the model's, not the part's: where it is held and pulled, and in sharp corners.
        is_judged = (middles[:, 2] > 3) & (middles[:, 2] < HEIGHT - 10) & (self.from_toes(middles) > 3)
        self.is_judged = np.repeat(is_judged, 4)
        numbers = np.array([int(line.split(",")[0]) for line in
                            (folder / "base.inp").read_text().split("*NODE\n")[1].split("*")[0].splitlines()])
        held, pulled = numbers[z < 1e-6], numbers[z > HEIGHT - 1e-6]
        nset = lambda name, nodes: f"*NSET, NSET={name}\n" + "".join(f"{node},\n" for node in nodes)
        (folder / "job.inp").write_text(
            "*INCLUDE, INPUT=mesh.inp\n" + nset("HELD", held) + nset("PULLED", pulled) +
            "*MATERIAL, NAME=STEEL\n*ELASTIC\n210000, 0.3\n*SOLID SECTION, ELSET=PART, MATERIAL=STEEL\n"
            f"*BOUNDARY\nHELD, 1, 3\n*STEP\n*STATIC\n*CLOAD\nPULLED, 1, {FORCE / len(pulled)}\n"
            "*EL PRINT, ELSET=PART\nS\n*END STEP\n")

    @staticmethod
    def from_toes(points):
        """Distances from the lines where the rib of the base meets wall and foot."""
        wall, _, thickness, leg = START
        x, y, z = points.T
        above = np.minimum(x, z) - wall
        outside = np.array([np.abs(y - WIDTH / 2) - thickness / 2, np.maximum(x, z) - wall - leg])
        within = outside.max(axis=0)
        along = np.where(within < 0, within, np.linalg.norm(outside.clip(min=0), axis=0))
        return np.hypot(above, along)

    def __call__(self, positions):
        """The largest equivalent stress, MPa; not less, by a smooth norm over all integration points."""
        self.mesh.write(self.folder / "mesh.inp", positions)
        run = subprocess.run(["ccx", "-i", "job"], cwd=self.folder, capture_output=True, text=True)
        if run.returncode != 0 or "*ERROR" in run.stdout:
            raise RuntimeError(run.stdout[-2000:])
        rows = (self.folder / "job.dat").read_text().split("\n", 3)[3]
        s = np.fromstring(rows, sep=" ").reshape(-1, 8)[self.is_judged, 2:]
        normal, shear = s[:, :3], s[:, 3:]
        mises = np.sqrt(((normal - np.roll(normal, 1, axis=1)) ** 2).sum(axis=1) / 2 + 3 * (shear ** 2).sum(axis=1))
        return mises.max() * ((mises / mises.max()) ** SHARPNESS).sum() ** (1 / SHARPNESS)


class State(NamedTuple):
    model: cadmorph.CadModel
    positions: np.ndarray   # of the mesh's nodes
    mass: float             # kg
    mass_slope: np.ndarray  # by the positions
    stress: float           # MPa


class Design:
    """Mass and stress for parameters, and their gradients; each worked out once."""

    def __init__(self, folder, size):
        self.bracket = Bracket(folder)
        base = self.bracket.model(START)
        mesh = self.bracket.mesh(folder / "base.inp", size)
        self.morpher = cadmorph.Morpher(base, mesh, quality="fast")
        self.mass, self.stress = Mass(mesh), Stress(mesh, folder)
        self.states, self.slopes, self.history = {}, {}, []

    def at(self, parameters):
        key = tuple(parameters)
        if key not in self.states:
            model = self.bracket.model(parameters)
            positions = self.morpher.morph(model).positions
            state = State(model, positions, *self.mass(positions), self.stress(positions))
            self.states[key] = state
            self.history.append((*key, state.mass, state.stress))
            print("  ".join(f"{name} {p:.2f}" for name, p in zip(NAMES, key)),
                  f"mm: {1e3 * state.mass:.1f} g, {state.stress:.1f} MPa", flush=True)
        return self.states[key]

    def gradients(self, parameters):
        """Of mass and stress, by the velocities that the CAD gives all nodes."""
        key = tuple(parameters)
        if key not in self.slopes:
            state = self.at(parameters)
            of_mass, of_stress = [], []
            for unit in np.eye(len(NAMES)):
                plus, minus = (self.bracket.model(parameters + sign * STEP * unit) for sign in (1, -1))
                velocity = self.morpher.velocity(plus, minus, STEP, at=state.model).nodes
                of_mass.append(np.vdot(state.mass_slope, velocity))
                of_stress.append((self.stress(state.positions + STEP * velocity) - state.stress) / STEP)
            self.slopes[key] = np.array(of_mass), np.array(of_stress)
        return self.slopes[key]


def plot(history, file):
    """Mass, stress and parameters of each design that the optimiser looked at."""
    history = np.array(history)
    figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(7, 6))
    above.plot(1e3 * history[:, -2], "o-")
    above.set_ylabel("mass (g)", color="tab:blue")
    above.set_ylim(0, None)
    right = above.twinx()
    right.plot(history[:, -1], "s-", color="tab:red")
    right.axhline(LIMIT, color="tab:red", linestyle=":")
    right.set_ylabel("largest stress (MPa)", color="tab:red")
    right.set_ylim(0, None)
    for name, values in zip(NAMES, history.T):
        below.plot(values, "o-", label=name)
    below.set_xticks(range(len(history)))
    below.set_xlabel("design")
    below.set_ylabel("parameters (mm)")
    below.legend()
    figure.tight_layout()
    figure.savefig(file, dpi=80)


def main():
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/bracket")
    folder.mkdir(parents=True, exist_ok=True)
    design = Design(folder, float(sys.argv[2]) if len(sys.argv) > 2 else 4)
    lower, extent = np.array(LOWER, dtype=float), np.array(UPPER, dtype=float) - LOWER
    parameters = lambda x: lower + extent * x              # SciPy sees them between 0 and 1
    start = (START - lower) / extent
    first = design.at(parameters(start))
    found = minimize(lambda x: design.at(parameters(x)).mass / first.mass, start, method="SLSQP",
                     jac=lambda x: design.gradients(parameters(x))[0] * extent / first.mass,
                     bounds=[(0, 1)] * len(NAMES),
                     constraints={"type": "ineq", "fun": lambda x: 1 - design.at(parameters(x)).stress / LIMIT,
                                  "jac": lambda x: -design.gradients(parameters(x))[1] * extent / LIMIT},
                     options={"maxiter": 12, "ftol": 1e-3})
    best = design.at(parameters(found.x))
    plot(design.history, folder / "history.png")
    print(f"{found.message}: mass {1e3 * first.mass:.1f} g -> {1e3 * best.mass:.1f} g, "
          f"stress {first.stress:.1f} MPa -> {best.stress:.1f} MPa, limit {LIMIT} MPa")


if __name__ == "__main__":
    main()
