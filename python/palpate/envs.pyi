import os
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._palpate import Model, Scene, Session, Volume

class Biopsy:
    model: Model
    session: Session | None
    action_space: Any
    observation_space: Any
    max_steps: int
    max_speed: float
    def __init__(
        self,
        scene: str | os.PathLike[str] | Volume | Scene | Model = "breast",
        *,
        max_seconds: float = 20.0,
        max_speed: float = 0.05,
        entry_error: float = 2e-3,
        render_mode: str | None = None,
    ) -> None: ...
    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[NDArray[np.float32], dict[str, Any]]: ...
    def step(self, action: ArrayLike) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]: ...
    def render(self) -> NDArray[np.uint8] | None: ...
    def close(self) -> None: ...

class Vector:
    count: int
    def __init__(
        self,
        count: int,
        make: Callable[[], Biopsy] = ...,
        *,
        processes: int | None = None,
        seed: int | None = None,
        context: str = "spawn",
    ) -> None: ...
    def reset(self, *, seed: int | None = None) -> NDArray[np.float32]: ...
    def step(
        self, actions: ArrayLike
    ) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], list[dict[str, Any]]]: ...
    def close(self) -> None: ...
    def __enter__(self) -> Vector: ...
    def __exit__(self, *_: object) -> None: ...
