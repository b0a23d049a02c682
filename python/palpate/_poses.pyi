import numpy as np
from numpy.typing import ArrayLike, NDArray

def press_path(
    start: ArrayLike, direction: ArrayLike, depth: float, *, speed: float = 0.02, hold: float = 0.1, lead: float = 1e-3
) -> NDArray[np.float64]: ...
