"""Paths of a tool."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._palpate import TICK_SECONDS


_MOST_TICKS = 10_000_000  # nearly three hours; 240 MB


def _numbers(value: ArrayLike, name: str, shape: tuple[int, ...], wanted: str) -> NDArray[np.float64]:
    if np.ma.isMaskedArray(value):
        raise ValueError(f"{name}: is a masked array: give a plain one, such as its filled()")
    try:
        array = np.asarray(value)
    except ValueError:  # of rows that differ in length
        array = np.array("")
    if array.dtype.kind not in "biuf" or array.shape != shape:
        raise ValueError(f"{name}: give {wanted}")
    return array.astype(float)


def press_path(
    start: ArrayLike, direction: ArrayLike, depth: float, *, speed: float = 0.02, hold: float = 0.1, lead: float = 1e-3
) -> NDArray[np.float64]:
    """Positions of a tool that comes straight down, holds, and goes back: one row per tick.

    Args:
        start: where the tool touches the body (3) [m]. Of a sphere this is its centre at first touch.
        direction: into the body (3); any length but 0.
        depth: how far it goes beyond `start` [m].
        speed: of the tool [m/s].
        hold: at the depth [s].
        lead: where it begins before `start` [m]; forces are ramped up in the first 0.6 s, so it waits there so long.

    Returns:
        n x 3 positions [m], float64.

    Raises:
        ValueError: what is given is no point, direction or number, or out of range, or the path has over 10 million ticks.
    """
    start = _numbers(start, "start", (3,), "three numbers, in metres")
    direction = _numbers(direction, "direction", (3,), "three numbers")
    numbers = {"depth": depth, "speed": speed, "hold": hold, "lead": lead}
    depth, speed, hold, lead = (_numbers(value, name, (), "one number").item() for name, value in numbers.items())
    given = np.concatenate([start, direction, [depth, speed, hold, lead]])
    if not np.isfinite(given).all():
        raise ValueError("press_path: start, direction, depth, speed, hold and lead have to be finite")
    length = np.linalg.norm(direction)
    if not 1e-100 < length < 1e100:  # squares of its components vanish or overflow
        largest = np.abs(direction).max()
        direction = direction / largest if largest > 0 else np.zeros(3)
        length = np.linalg.norm(direction)
    if not length > 0:
        raise ValueError("direction: has no length")
    if not (speed > 0 and depth >= 0 and hold >= 0 and lead >= 0):
        raise ValueError("press_path: speed has to be above 0, and depth, hold and lead not below 0")
    step = speed * TICK_SECONDS
    ticks = 600 + hold / TICK_SECONDS + (2 * (depth + lead) / step if step > 0 else math.inf)
    if ticks > _MOST_TICKS:
        raise ValueError(
            f"press_path: the path would have {ticks:.3g} ticks, and {_MOST_TICKS:.3g} are the most: raise speed, or lower "
            "depth, hold or lead"
        )
    steps = math.ceil((depth + lead) / step - 1e-6)  # the last one may be shorter; 1e-6: rounding makes none of its own
    down = np.append(-lead + step * np.arange(steps), depth)
    way = np.concatenate([np.full(600, -lead), down, np.full(round(hold / TICK_SECONDS), depth), down[::-1]])
    return start + way[:, None] * (direction / length)
