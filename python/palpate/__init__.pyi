from ._errors import Error as Error, SceneError as SceneError
from ._palpate import (
    DEADMAN as DEADMAN,
    EVENTS as EVENTS,
    FIRE as FIRE,
    MARK as MARK,
    PHASES as PHASES,
    TICK_SECONDS as TICK_SECONDS,
    UNMARK as UNMARK,
    WARNINGS as WARNINGS,
    Model as Model,
    Scene as Scene,
    Session as Session,
    Tick as Tick,
    Volume as Volume,
    build as build,
    phantoms as phantoms,
    plan as plan,
    scenes as scenes,
)
from ._poses import press_path as press_path
from ._record import Record as Record, score as score
from ._studies import accuracy as accuracy
from ._sweep import SweepResult as SweepResult, merge as merge, sweep as sweep, sweep_outputs as sweep_outputs
from . import envs as envs

__version__: str
