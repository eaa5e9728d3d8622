"""format_speed_files.py N: files for format_speed that gmsh does not write.

block.k and block.cdb, the tetrahedra of block.inp for LS-DYNA and Ansys, and foam, an OpenFOAM case of
N^3 points and hexahedra.
"""
import pathlib
import sys

import numpy as np


def read_block():
    nodes, tetrahedra, rows = [], [], None
    for line in open("block.inp"):
        if line.startswith("*"):
            name = line.upper()
            rows = nodes if name.startswith("*NODE") else tetrahedra if "C3D4" in name else None
        elif rows is not None:
            rows.append(line.split(","))
    return ([(int(n[0]), *map(float, n[1:])) for n in nodes],
            [tuple(map(int, t)) for t in tetrahedra])


def write_ls_dyna(nodes, tetrahedra):
    with open("block.k", "w") as file:
        file.write("*KEYWORD\n*NODE\n")
        file.writelines("%8d%16.10f%16.10f%16.10f\n" % node for node in nodes)
        file.write("*ELEMENT_SOLID\n")
        line = "%8d" * 10 + "\n"
        file.writelines(line % (t[0], 1, *t[1:], *[t[4]] * 4) for t in tetrahedra)
        file.write("*END\n")


def fortran(value):
    mantissa, exponent = ("%.13E" % value).split("E")
    return "%21s" % ("%sE%s%03d" % (mantissa, exponent[0], int(exponent[1:])))


def write_ansys(nodes, tetrahedra):
    with open("block.cdb", "w") as file:
        file.write("/PREP7\nET,1,285\nNBLOCK,6,SOLID,%d,%d\n(3i9,6e21.13e3)\n" % ((len(nodes),) * 2))
        file.writelines("%9d%9d%9d" % (n, 0, 0) + "".join(map(fortran, xyz)) + "\n"
                        for n, *xyz in nodes)
        file.write("N,R5.3,LOC,       -1,\nEBLOCK,19,SOLID,%d,%d\n(19i9)\n" % ((len(tetrahedra),) * 2))
        line = "%9d" * 15 + "\n"
        file.writelines(line % (1, 1, 1, 1, 0, 0, 0, 0, 4, 0, *t) for t in tetrahedra)
        file.write("%9d\nFINISH\n" % -1)


class Grid:
    """N^3 points; the faces of its hexahedra as OpenFOAM orders them."""

    def __init__(self, n):
        self.n = n
        z, y, x = np.meshgrid(*[np.linspace(0, 1, n)] * 3, indexing="ij")
        self.points = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
        cells = [c.ravel() for c in np.meshgrid(*[np.arange(n - 1)] * 3, indexing="ij")][::-1]
        self.faces, self.owner, self.neighbour, self.patches = [], [], [], []
        for axis in range(3):
            inside = cells[axis] < n - 2
            self.add(axis, cells, inside, 1)
            beyond = [c + (a == axis) for a, c in enumerate(cells)]
            self.neighbour.append(self.cell(beyond)[inside])
        order = np.lexsort((np.hstack(self.neighbour), np.hstack(self.owner)))
        self.faces = [np.vstack(self.faces)[order]]
        self.owner = [np.hstack(self.owner)[order]]
        self.neighbour = [np.hstack(self.neighbour)[order]]
        for axis in range(3):
            for side in (0, 1):
                start = sum(map(len, self.faces))
                self.add(axis, cells, cells[axis] == side * (n - 2), side)
                self.patches.append(("%s%d" % ("xyz"[axis], side), len(self.faces[-1]), start))

    def cell(self, at):
        return at[0] + (self.n - 1) * (at[1] + (self.n - 1) * at[2])

    def add(self, axis, cells, which, side):
        corners = [(0, 0), (1, 0), (1, 1), (0, 1)][:: 1 if side else -1]
        nodes = []
        for u, v in corners:
            step = {axis: side, (axis + 1) % 3: u, (axis + 2) % 3: v}
            at = [c[which] + step[a] for a, c in enumerate(cells)]
            nodes.append(at[0] + self.n * (at[1] + self.n * at[2]))
        self.faces.append(np.column_stack(nodes))
        self.owner.append(self.cell(cells)[which])


def write_foam(n):
    folder = pathlib.Path("foam/constant/polyMesh")
    folder.mkdir(parents=True, exist_ok=True)
    grid = Grid(n)

    def write(name, kind, rows, style):
        with open(folder / name, "w") as file:
            file.write("FoamFile\n{\n    version 2.0;\n    format ascii;\n    class %s;\n"
                       "    object %s;\n}\n\n%d\n(\n" % (kind, name, len(rows)))
            np.savetxt(file, rows, fmt=style)
            file.write(")\n")

    write("points", "vectorField", grid.points, "(%.16g %.16g %.16g)")
    write("faces", "faceList", np.vstack(grid.faces), "4(%d %d %d %d)")
    write("owner", "labelList", np.hstack(grid.owner), "%d")
    write("neighbour", "labelList", np.hstack(grid.neighbour), "%d")
    write("boundary", "polyBoundaryMesh", np.array(grid.patches, dtype=object),
          "%s { type patch; nFaces %d; startFace %d; }")


block = read_block()
write_ls_dyna(*block)
write_ansys(*block)
write_foam(int(sys.argv[1]))
