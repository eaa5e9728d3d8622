"""Moves a simulation mesh from one CAD model onto a changed version of it (docs/python.md).

    morpher = cadmorph.Morpher(cadmorph.CadModel.from_step("base.step"), cadmorph.Mesh.read("mesh.vtu"))
    result = morpher.morph(cadmorph.CadModel.from_step("variant.step"))
    result.write("mesh.variant.vtu")

Points are float64 arrays of shape (N, 3) in the mesh's own unit; CAD models are in millimetres.
"""

from ._native import (
    AssociationError,
    CadError,
    CadFigures,
    CadModel,
    CancelledError,
    Derivative,
    Diagnosis,
    Error,
    GroupFigures,
    InvalidInputError,
    IoError,
    Mesh,
    Morpher,
    MorphResult,
    NodeFigures,
    OutputError,
    ParameterGradient,
    QualityError,
    QualityFigures,
    Report,
    SolverError,
    TopologyError,
    Velocity,
    __version__,
    set_thread_count,
    thread_count,
)
from ._parameters import read_parameters
from ._picture import Picture, plot

MorphResult.plot = plot
del plot

__all__ = [
    "AssociationError",
    "CadError",
    "CadFigures",
    "CadModel",
    "CancelledError",
    "Derivative",
    "Diagnosis",
    "Error",
    "GroupFigures",
    "InvalidInputError",
    "IoError",
    "Mesh",
    "Morpher",
    "MorphResult",
    "NodeFigures",
    "OutputError",
    "ParameterGradient",
    "Picture",
    "QualityError",
    "QualityFigures",
    "Report",
    "SolverError",
    "TopologyError",
    "Velocity",
    "read_parameters",
    "set_thread_count",
    "thread_count",
]
