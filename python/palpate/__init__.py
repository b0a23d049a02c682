"""Palpate: feel inside a segmented volume, from Python.

Lengths in metres, forces in newtons, moduli in pascals, times in seconds; the patient frame is LPS (x to the patient's left,
y to the back, z to the head). docs/python.md is the tutorial.

    >>> import palpate
    >>> session = palpate.Session("block")
    >>> ticks = session.run(poses)          # n x 3 positions -> n rows
    >>> ticks["tissue_force"]               # n x 3 [N]
"""

import importlib
from typing import TYPE_CHECKING, Any

from . import _palpate
from ._arguments import ClassSignature
from ._errors import Error, SceneError
from ._palpate import (
    DEADMAN,
    EVENTS,
    FIRE,
    MARK,
    PHASES,
    TICK_SECONDS,
    UNMARK,
    WARNINGS,
    Model,
    Scene,
    Session,
    Tick,
    Volume,
    phantoms,
    plan,
    scenes,
)
from ._poses import press_path
from ._record import Record, score
from ._studies import accuracy
from ._sweep import SweepResult, merge, sweep, sweep_outputs

if TYPE_CHECKING:
    from . import envs as envs

__version__: str = _palpate.build.split()[1]
build: str = _palpate.build  #: version and commit of the C++ side

__all__ = [
    "DEADMAN", "EVENTS", "Error", "FIRE", "MARK", "Model", "PHASES", "Record", "Scene", "SceneError", "Session", "SweepResult",
    "TICK_SECONDS", "Tick", "UNMARK", "Volume", "WARNINGS", "accuracy", "build", "merge", "phantoms", "plan", "press_path",
    "scenes", "score", "sweep", "sweep_outputs",
]


for _kind in (Model, Scene, Session):
    setattr(_kind, "__signature__", ClassSignature())


def __getattr__(name: str) -> Any:
    if name == "envs":  # is imported when it is first asked for, and gymnasium with it
        return importlib.import_module(f"{__name__}.envs")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), "envs"})
