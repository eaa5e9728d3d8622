"""A bracket in FreeCAD, meshed once by gmsh: its parameters drive the mesh, without a file.

Needs Debian's freecad-python3 and python3-gmsh. usage: freecad_bracket.py [NUMBER_OF_VARIANTS]
"""

import sys
import tempfile
import time
from pathlib import Path

sys.path += ["/usr/lib/freecad-python3/lib", "/usr/lib/freecad/Mod"]

import FreeCAD
import Part
import Sketcher
import cadmorph
import gmsh
import numpy as np


class Bracket:
    """A sketch of an L, padded, with a fillet in its corner, in FreeCAD's PartDesign."""

    def __init__(self):
        self.document = FreeCAD.newDocument("bracket")
        self.body = self.document.addObject("PartDesign::Body", "Body")
        self.sketch = self.body.newObject("Sketcher::SketchObject", "Sketch")
        corners = [(0, 0), (60, 0), (60, 10), (10, 10), (10, 40), (0, 40)]
        points = [FreeCAD.Vector(x, y, 0) for x, y in corners]
        for start, end in zip(points, points[1:] + points[:1]):
            self.sketch.addGeometry(Part.LineSegment(start, end))
        for line in range(6):
            self.sketch.addConstraint(Sketcher.Constraint("Coincident", line, 2, (line + 1) % 6, 1))
            self.sketch.addConstraint(Sketcher.Constraint("Vertical" if line % 2 else "Horizontal", line))
        self.sketch.addConstraint(Sketcher.Constraint("Coincident", 0, 1, -1, 1))
        for name, line, size in [("length", 0, 60), ("foot", 1, 10), ("wall", 4, 10), ("height", 5, 40)]:
            number = self.sketch.addConstraint(Sketcher.Constraint("Distance", line, size))
            self.sketch.renameConstraint(number, name)
        self.pad = self.body.newObject("PartDesign::Pad", "Pad")
        self.pad.Profile = self.sketch
        self.pad.Length = 20
        self.document.recompute()
        self.fillet = self.body.newObject("PartDesign::Fillet", "Fillet")
        self.fillet.Base = (self.pad, [self.inner_edge()])
        self.fillet.Radius = 6
        self.document.recompute()

    def inner_edge(self):
        for number, edge in enumerate(self.pad.Shape.Edges, 1):
            if all(abs(v.X - 10) < 1e-6 and abs(v.Y - 10) < 1e-6 for v in edge.Vertexes):
                return f"Edge{number}"
        raise RuntimeError("the inner edge is gone")

    def shape(self, length=60, height=40, wall=10, radius=6):
        """The part with other parameters, in millimetres."""
        for name, size in [("length", length), ("height", height), ("wall", wall)]:
            self.sketch.setDatum(name, FreeCAD.Units.Quantity(f"{size} mm"))
        self.fillet.Radius = radius
        self.document.recompute()
        return self.body.Shape


def mesh_by_gmsh(shape, size):
    """Tetrahedra of a shape: what gmsh's API gives goes into the mesh as it is."""
    gmsh.initialize(["gmsh", "-v", "0"])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "base.brep"
        shape.exportBrep(str(path))
        gmsh.model.occ.importShapes(str(path))
    gmsh.model.occ.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.model.mesh.generate(3)
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    types, _, nodes = gmsh.model.mesh.getElements(dim=3)
    mesh = cadmorph.Mesh.from_gmsh(tags, coordinates, types, nodes)
    gmsh.finalize()
    return mesh


def main():
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    bracket = Bracket()
    base = bracket.shape()
    mesh = mesh_by_gmsh(base, size=4)
    morpher = cadmorph.Morpher(cadmorph.CadModel.from_shape(base), mesh)
    print(f"{mesh.node_count} nodes, {mesh.cell_count} cells")
    start = time.perf_counter()
    worst = 1
    for share in np.linspace(0, 1, count):
        parameters = {"length": 60 + 10 * share, "height": 40 + 5 * share, "wall": 10 + 2 * share, "radius": 6 + 3 * share}
        shape = bracket.shape(**parameters)
        result = morpher.morph(cadmorph.CadModel.from_shape(shape))
        positions = result.positions
        worst = min(worst, result.report.after.min_scaled_jacobian)
        assert np.allclose(positions.max(axis=0), [parameters["length"], parameters["height"], 20])
    seconds = time.perf_counter() - start
    print(f"{count} variants, {count / seconds:.1f} a second; least scaled Jacobian {worst:.3f}")


if __name__ == "__main__":
    main()
