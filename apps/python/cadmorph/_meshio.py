"""Sets of a meshio.Mesh as groups of nodes."""

from __future__ import annotations

from typing import Any

import numpy as np


def groups_of(mesh: Any) -> dict[str, np.ndarray]:
    """Nodes by name: point sets, cell sets, and the named physical groups of gmsh."""
    found: dict[str, list[np.ndarray]] = {}

    def add(name: str, nodes: Any) -> None:
        found.setdefault(str(name), []).append(np.ravel(np.asarray(nodes, dtype=np.int64)))

    blocks = list(mesh.cells)
    for name, nodes in (getattr(mesh, "point_sets", None) or {}).items():
        add(name, nodes)
    for name, cells in (getattr(mesh, "cell_sets", None) or {}).items():
        if name.startswith("gmsh:"):  # meshio's own: bounding entities
            continue
        for block, chosen in zip(blocks, cells):
            if chosen is not None and len(chosen) > 0:
                add(name, np.asarray(block.data)[np.asarray(chosen)])
    tags = (getattr(mesh, "cell_data", None) or {}).get("gmsh:physical")
    if tags is not None:
        for name, (tag, dimension) in (getattr(mesh, "field_data", None) or {}).items():
            for block, of_block in zip(blocks, tags):
                if block.dim == dimension:
                    add(name, np.asarray(block.data)[np.asarray(of_block) == tag])
    groups = {name: np.unique(np.concatenate(nodes)) for name, nodes in found.items()}
    return {name: nodes for name, nodes in groups.items() if nodes.size > 0}
