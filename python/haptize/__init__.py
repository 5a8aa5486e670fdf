"""Contact solved beforehand for every joint configuration, felt at 1 kHz.

A scene is haptized into a dataset, a field looks torques up in it, a loop renders it to a haptic device:

    dataset = haptize.bake(haptize.Scene.load("sphere.toml"))
    field = haptize.Field(dataset)
    tau = field.torque([0.0, 1.2, -1.9])

All quantities are SI: m, rad, N, N m, kg, s, J.
"""

from . import _pickle  # noqa: F401
from ._haptize import (
    BakeError,
    Dataset,
    DatasetError,
    Equilibrium,
    Error,
    Field,
    GridizeError,
    Loop,
    Scene,
    SceneError,
    Solver,
    __version__,
    bake,
    gridize,
    solve,
)
from .commands import run
from .figures import plot

__all__ = [
    "BakeError",
    "Dataset",
    "DatasetError",
    "Equilibrium",
    "Error",
    "Field",
    "GridizeError",
    "Loop",
    "Scene",
    "SceneError",
    "Solver",
    "__version__",
    "bake",
    "gridize",
    "plot",
    "run",
    "solve",
]
