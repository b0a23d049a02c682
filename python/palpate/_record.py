"""Records of sessions."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._arguments import said
from ._palpate import Model, RecordFile, Session

if TYPE_CHECKING:
    import pandas  # type: ignore[import]

# Columns of a table, by field of a tick: the names that a record's own table has, but for those that name a structure.
_VECTORS = {
    "position": "tip_{}_m", "axis": "axis_{}", "proxy": "proxy_{}_m", "tissue_force": "tissue_force_{}_n",
    "basic": "basic_{}_n", "additional": "additional_{}_n", "total": "total_{}_n", "deflection": "deflection_{}_m",
    "probe_face": "probe_face_{}_m", "probe_axis": "probe_axis_{}", "probe_lateral": "probe_lateral_{}",
    "probe_force": "probe_force_{}_n",
}
_NUMBERS = {
    "tick": "tick", "buttons": "buttons", "fresh": "fresh", "energy": "energy_j", "damped": "damped_j", "phase": "phase",
    "tissue": "tissue", "inserted": "inserted_m", "contacts": "contacts", "penetration": "penetration_m", "moved": "moved",
    "residual": "residual_m", "nearest_vital": "nearest_vital", "warning": "warning", "warned": "warned",
    "ahead": "ahead_m", "ahead_tissue": "ahead_tissue", "ahead_speed": "ahead_m_s", "fired": "fired", "faulted": "faulted",
    "events": "events", "needle_in_beam": "needle_in_beam_m", "tip_in_beam": "tip_in_beam",
}
_STRUCTURES = {"distance": "distance_{}_m", "ahead_distance": "ahead_{}_m"}
_MOVES = ("probe_press_m", "probe_slide_m", "probe_sweep_m", "probe_rock_rad", "probe_tilt_rad", "probe_turn_rad")


def columns_of(ticks: NDArray[np.void], structures: list[str] | None = None) -> dict[str, NDArray[Any]]:
    """Columns of a structured array of ticks, one number each: {"tip_x_m": array of n, ...}.

    Args:
        ticks: what Session.run() or Record.ticks gives.
        structures: names for the columns of distances; default: their numbers, as in a record's own table.
    """
    out = {}
    for field in ticks.dtype.names:
        if field in _VECTORS:
            for axis, letter in enumerate("xyz"):
                out[_VECTORS[field].format(letter)] = ticks[field][:, axis]
        elif field == "probe_move":
            for i, name in enumerate(_MOVES):
                out[name] = ticks[field][:, i]
        elif field in _STRUCTURES:
            for i in range(ticks[field].shape[1]):
                name = structures[i] if structures is not None else i
                out[_STRUCTURES[field].format(name)] = ticks[field][:, i]
        else:
            out[_NUMBERS[field]] = ticks[field]
    return out


class Record:
    """The record of a session, read whole.

    Args:
        file: that Session(record=...) or `palpate train --record` wrote.

    Attributes:
        ticks: structured array, a row per tick, as Session.run() gives it.
        events: structured array (tick, kind, structure, tissue, value), in their order; palpate.EVENTS names the kinds.
        info: what the record says of its session: scene, model, device, build, operator, host, started, rate, seed,
            structures, tissues.
        results: what the session said at its end, as text.
        complete: False when the session was cut off.

    Raises:
        palpate.Error: the file is no record, or is damaged.
    """

    ticks: NDArray[np.void]
    events: NDArray[np.void]
    info: dict[str, Any]
    results: dict[str, str]
    complete: bool

    def __init__(self, file: str | os.PathLike[str]) -> None:
        self._file = RecordFile(file)
        self.ticks, self.events = self._file.read_ticks()
        for array in (self.ticks, self.events):
            array.flags.writeable = False
        self.info = self._file.info
        self.results = self._file.results
        self.complete = self._file.complete

    def __repr__(self):
        return f"<palpate.Record '{self._file.file}': {len(self.ticks)} ticks of '{self.info['scene']}'>"

    def __len__(self) -> int:
        return len(self.ticks)

    @property
    def file(self) -> str:
        """Path of the file."""
        return self._file.file

    @property
    def scene_text(self) -> str:
        """The scene as TOML text, enough to run the session again."""
        return self._file.scene_text

    @property
    def poses(self) -> NDArray[np.float64]:
        """Positions [m] and axes, as Session.run() takes them: n x 6; n x 12 with the probe's moves, where one moved."""
        parts = [self.ticks["position"], self.ticks["axis"]]
        if self.ticks["probe_move"].any():
            parts.append(self.ticks["probe_move"])
        return np.concatenate(parts, axis=1)

    @property
    def samples(self) -> dict[str, NDArray[Any]]:
        """What Session.run(**record.samples) takes to give the same ticks, bit for bit: poses, buttons, fresh."""
        return {"poses": self.poses, "buttons": self.ticks["buttons"], "fresh": self.ticks["fresh"]}

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Arrays of n by the names of the columns of the file's table of ticks (docs/record.md), but that

        - distances have the structure's name: distance_tumour_m, ahead_tumour_m for distance_0_m, ahead_0_m,
        - phase and warning are numbers of PHASES and WARNINGS, where the file has the words,
        - -1 stands for no structure (nearest_vital, warned), where the file has NULL,
        - `events` is a column here, with bit k for kind k of EVENTS, and a table there,
        - the columns of the probe are there without a probe, too,
        - times of tasks (h2_us, ..) are left out.
        """
        return columns_of(self.ticks, self.info["structures"])

    def to_dataframe(self) -> pandas.DataFrame:
        """The same as a pandas.DataFrame, with a column seconds before them. Raises ImportError without pandas."""
        import pandas

        frame = pandas.DataFrame(self.to_dict())
        frame.insert(0, "seconds", frame["tick"] / self.info["rate"])
        return frame

    def score(self) -> dict[str, Any]:
        """Every measure of docs/score.md by its key, `points`, and `doubts`: what makes them doubtful (list of str)."""
        return self._file.score()

    def model(self) -> Model:
        """The palpate.Model of the session. Raises palpate.Error when its volume is another now."""
        return self._file.model()

    def replay(self) -> dict[str, Any]:
        """Computes the session again and compares all bits.

        Returns:
            dict: ticks, identical (bool), first_difference_tick (int or None), largest_difference_n, force_hash,
            differences (str, empty where there are none).

        Raises:
            palpate.Error: the volume is another now, ticks are missing.
        """
        return self._file.replay()


def score(what: Record | Session | str | bytes | os.PathLike[str]) -> dict[str, Any]:
    """The score of a Record, of a record's file, or of a Session so far: a dict by the keys of docs/score.md."""
    if isinstance(what, (Record, Session)):
        return what.score()
    if isinstance(what, (str, bytes, os.PathLike)):
        return RecordFile(what).score()
    raise TypeError(f"score: give a Record, its file or a Session, not {said(what)}")
