import os
import pathlib
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import pandas  # type: ignore[import]

_Path = str | os.PathLike[str]

class SweepResult:
    folder: pathlib.Path
    rows: list[dict[str, Any]]
    def __init__(self, folder: _Path) -> None: ...
    def __len__(self) -> int: ...
    def __getitem__(self, column: str) -> list[Any]: ...
    @property
    def failed(self) -> list[dict[str, Any]]: ...
    def to_dataframe(self) -> pandas.DataFrame: ...

def sweep_outputs() -> dict[str, dict[str, str]]: ...
def sweep(
    plan: _Path,
    cases: pandas.DataFrame | Iterable[Mapping[str, Any]] | None = None,
    *,
    folder: _Path | None = None,
    jobs: int | None = None,
    retry: bool = False,
    any_build: bool = False,
    progress: Callable[[int, int], object] | None = None,
    procedure: str | Mapping[str, Any] = "press",
    outputs: Iterable[str] | None = None,
    repeats: int = 1,
    seed: int = 1,
    set: Mapping[str, Any] | None = None,
    reference: Mapping[str, Any] | None = None,
    records: bool = False,
) -> SweepResult: ...
def merge(folder: _Path, shards: Iterable[_Path] = (), *, any_build: bool = False) -> SweepResult: ...
