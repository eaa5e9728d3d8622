"""IDWarp's calls over cadmorph's volume morph: `from cadmorph.idwarp import USMesh`.

Surface coordinates are those of all nodes that the CAD prescribes (`surface_nodes`), in that order.
"""

import numpy as np

from . import CadModel, Mesh, Morpher


class USMesh:
    """A mesh that follows its surface.

    options: gridFile (mesh), cadFile (STEP file that it was made for); further keywords of Morpher.
    Warps are one plain morph from the base, nothing repaired; nodes on planes that slide (symmetry
    planes) follow the others, whatever coordinates are given for them.
    """

    def __init__(self, options, comm=None, debug=False):
        options = dict(options)
        missing = [name for name in ("gridFile", "cadFile") if name not in options]
        if missing:
            raise ValueError(f"options: {' and '.join(missing)} must be given")
        mesh = Mesh.read(options.pop("gridFile"))
        base = CadModel.from_step(options.pop("cadFile"))
        self.morpher = Morpher(base, mesh, **options)
        self.comm = comm
        self._base = mesh.points[self.surface_nodes]
        self._surface = self._base.copy()
        self._volume = np.array(mesh.points)
        self._derivative = None
        self._dXs = np.zeros_like(self._base)

    @property
    def surface_nodes(self):
        """int64 (m,): ids of the surface's nodes."""
        return self.morpher.surface_nodes

    def getSurfaceCoordinates(self):
        """float64 (m, 3): where the surface's nodes are."""
        return self._surface.copy()

    def setSurfaceCoordinates(self, coordinates):
        """Takes new positions, (m, 3); `warpMesh` moves the volume."""
        coordinates = np.array(coordinates, dtype=float)
        if coordinates.shape != self._surface.shape:
            raise ValueError(f"expected coordinates of shape {self._surface.shape}, not {coordinates.shape}")
        self._surface = coordinates
        self._derivative = None

    def warpMesh(self):
        """Moves all nodes with the surface."""
        self._volume = self.morpher.warp(self.morpher.slide(self._surface))

    def getSolverGrid(self):
        """float64 (3 N,): all nodes, as a solver's vector."""
        return self._volume.ravel().copy()

    getWarpGrid = getCommonGrid = getSolverGrid

    def _at_surface(self):
        if self._derivative is None:
            self._derivative = self.morpher.derivative(self.morpher.slide(self._surface), slide=True)
        return self._derivative

    def warpDeriv(self, dXv, solverVec=True, surfOnly=False):
        """The adjoint: dXv (3 N,) or (N, 3) by all nodes; `getdXs` returns the result."""
        self._dXs = self._at_surface().adjoint(np.reshape(np.asarray(dXv, dtype=float), (-1, 3)))

    def getdXs(self):
        """float64 (m, 3): what the last `warpDeriv` came to."""
        return self._dXs.copy()

    def warpDerivFwd(self, dXs, solverVec=True):
        """float64 (3 N,): the motion of all nodes for that of the surface, (m, 3)."""
        return self._at_surface().forward(np.reshape(np.asarray(dXs, dtype=float), (-1, 3))).ravel()
