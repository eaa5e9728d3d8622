"""Morphs a mesh onto two variants of its CAD model, and shows what became of it."""

import cadmorph
import numpy as np

FOLDER = "models/bore"

mesh = cadmorph.Mesh.read(f"{FOLDER}/hex.vtu")
morpher = cadmorph.Morpher(cadmorph.CadModel.from_step(f"{FOLDER}/base.step"), mesh)
for variant in ("step10", "step20"):
    result = morpher.morph(cadmorph.CadModel.from_step(f"{FOLDER}/{variant}.step"))
    moved = np.linalg.norm(result.positions - mesh.points, axis=1)
    print(f"{variant}: nodes moved by {moved.mean():.2f} mm on average, {moved.max():.2f} mm at most;",
          f"least scaled Jacobian {result.report.after.min_scaled_jacobian:.3f}")
    print(result.write(f"out/{variant}.vtu"))
