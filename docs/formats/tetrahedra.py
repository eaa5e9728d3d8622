"""Writes the tetrahedra of a mesh in other formats: tetrahedra.py MESH OUTPUT..."""

import sys

import meshio

mesh = meshio.read(sys.argv[1])
for output in sys.argv[2:]:
    meshio.Mesh(mesh.points, {"tetra": mesh.cells_dict["tetra"]}).write(output)
