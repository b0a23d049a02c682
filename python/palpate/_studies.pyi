import os
from typing import Any

def accuracy(file: str | os.PathLike[str] | None = None, *, command: str | os.PathLike[str] | None = None) -> dict[str, Any]: ...
