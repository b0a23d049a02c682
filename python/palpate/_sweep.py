"""Sweeps: many cases, one table."""

import collections.abc
import csv
import inspect
import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile

from . import _palpate
from ._arguments import path_of, said, whole
from ._errors import Error
from ._toml import dumps


def _need_sweeps():
    if not hasattr(_palpate, "run_sweep"):
        raise Error("this build has no sweeps: build it with -DPALPATE_SWEEP=ON")


def sweep_outputs():
    """What there is to measure: {procedure: {output: meaning}}."""
    _need_sweeps()
    return _palpate.sweep_outputs()


def _rows(cases):
    """The cases as a list of dictionaries with the same keys."""
    if hasattr(cases, "to_dict") and hasattr(cases, "columns"):
        cases = cases.to_dict("records")
    cases = cases if isinstance(cases, (str, collections.abc.Mapping)) else list(cases)
    if not all(isinstance(case, collections.abc.Mapping) for case in cases):
        raise TypeError("sweep: cases: give a pandas.DataFrame, or a list with a dictionary for each case")
    rows = [dict(case) for case in cases]
    if not rows:
        raise Error("sweep: there are no cases")
    for number, row in enumerate(rows):
        if row.keys() != rows[0].keys():
            odd = ", ".join(sorted(map(str, row.keys() ^ rows[0].keys())))
            raise Error(f"sweep: case {number} has other keys than case 0: {odd}")
    return rows


def plan_of(scene, cases, *, procedure="press", outputs=None, repeats=1, seed=1, set=None, reference=None, records=False):
    """The text of a plan (docs/sweeps.md) whose cases are listed.

    Args: as of sweep().
    """
    rows = _rows(cases)
    if not isinstance(procedure, (str, collections.abc.Mapping)):
        raise TypeError(f"sweep: procedure: give one of {', '.join(sweep_outputs())}, or a dictionary with its keys, not {said(procedure)}")
    if outputs is not None and not isinstance(outputs, collections.abc.Iterable):
        raise TypeError(f"sweep: outputs: give the name of an output, or a list of them (sweep_outputs() has them), not {said(outputs)}")
    procedure = {"kind": procedure} if isinstance(procedure, str) else dict(procedure)
    plan = {"scene": os.fspath(scene), "seed": seed, "repeats": repeats, "records": records}
    if outputs is not None:
        plan["outputs"] = [outputs] if isinstance(outputs, str) else list(outputs)
    plan["design"] = {"kind": "list"}
    plan["procedure"] = procedure
    if set:
        plan["set"] = dict(set)
    if reference:
        plan["reference"] = dict(reference)
    plan["axis"] = [{"key": key, "values": [row[key] for row in rows]} for key in rows[0]]
    return dumps(plan)


_OPTIONS = [name for name, one in inspect.signature(plan_of).parameters.items() if one.kind is one.KEYWORD_ONLY]


def _without_file(message, written):
    """A message without the file of a plan that was written for it and is gone, and the line there."""
    if written is None:
        return message
    return re.sub(re.escape(written) + r":(\d+:)? ", "", message).replace(written, "plan")


class SweepResult:
    """The table of a sweep.

    Attributes:
        folder: of the sweep, with table.csv and table.db (pathlib.Path).
        rows: list of dictionaries, one per case in order; what there is none of is None.

    Raises:
        palpate.Error: the folder has no table.
    """

    def __init__(self, folder):
        self.folder = pathlib.Path(path_of(folder, "folder"))
        table = self.folder / "table.csv"
        try:
            with open(table, newline="", encoding="utf-8") as text:
                self.rows = [{k: _number(v) for k, v in row.items()} for row in csv.DictReader(text)]
        except OSError as error:
            raise Error(f"{table}: {error.strerror}: give the folder of a sweep that has run") from None

    def __len__(self):
        return len(self.rows)

    @property
    def failed(self):
        """Rows of the cases that failed; their `error` says why."""
        return [row for row in self.rows if row["error"]]

    def __getitem__(self, column):
        """A column as a list."""
        return [row[column] for row in self.rows]

    def to_dataframe(self):
        """A pandas.DataFrame with the columns of docs/sweeps.md. Raises ImportError without pandas."""
        import pandas

        return pandas.DataFrame(self.rows)


# Numbers as table.csv has them: what else int() and float() take ("1_000", "007", "nan") is a word of an axis.
_NUMBER = re.compile(r"-?(?:0|[1-9][0-9]*)(\.[0-9]+)?(e[+-][0-9]+)?")


def _number(text):
    if text == "":
        return None
    number = _NUMBER.fullmatch(text)
    if number is None:
        return text
    return float(text) if number[1] or number[2] else int(text)


def _jobs(jobs):
    if jobs is None:
        return os.cpu_count() or 1
    number = whole(jobs, "sweep: jobs: give a whole number")
    if number < 1:
        raise ValueError(f"sweep: jobs: give 1 or more, not {number}")
    return number


def _told(line):
    """What the process that runs the cases says: a JSON object."""
    try:
        said = json.loads(line)
    except ValueError:
        said = None
    if not isinstance(said, dict):
        raise Error(f"sweep: the process that runs the cases said {line.strip()!r}: a module of Python in it prints")
    return said


def _work(folder, plan, progress, **job):
    """Runs the sweep in a process of its own, which forks: this one may have threads."""
    package = pathlib.Path(__file__).resolve().parent
    # With a safe path, no file of the working folder is taken for a module (json.py).
    environment = dict(os.environ, OPENBLAS_NUM_THREADS="1", PYTHONSAFEPATH="1")
    environment["PYTHONPATH"] = os.pathsep.join(filter(None, (str(package.parent), os.environ.get("PYTHONPATH"))))
    text = json.dumps({"folder": os.fspath(folder), "plan": plan, **job})
    worker = subprocess.Popen([sys.executable, "-m", "palpate._sweep_worker", text], stdout=subprocess.PIPE, text=True,
                              env=environment, start_new_session=True)
    last = None
    try:
        for line in worker.stdout:
            last = _told(line)
            if progress is not None and "done" in last:
                progress(last["done"], last["of"])
    except BaseException:
        worker.send_signal(signal.SIGINT)  # the cases in flight are finished, all rows are kept
        worker.wait()
        raise
    finally:
        worker.stdout.close()
    status = worker.wait()
    if last is not None and "error" in last:
        raise Error(last["error"])
    if status != 0:
        raise Error(f"sweep: the process that runs the cases ended with status {status}")


def sweep(plan, cases=None, *, folder=None, jobs=None, retry=False, any_build=False, progress=None, **options):
    """Runs the cases of a plan on this machine and gives their table.

        palpate.sweep("palpation", folder="palpation")                            # a ready plan, or a plan file
        palpate.sweep("block", cases=frame, procedure={"kind": "press", "depth_mm": 4}, outputs=["force_n"])

    Args:
        plan: without `cases` a ready plan or a plan file (docs/sweeps.md); with `cases` the scene: a built-in one, a file
            (.toml) or a volume (.vdb).
        cases: a pandas.DataFrame or a list of dictionaries: a row per case, a column per key ("tissue.fat.youngs_kpa").
        folder: of the sweep; one that was interrupted goes on where it was. Default: a new one in the folder for temporary
            files, which stays.
        jobs: processes, one core each; default: all cores. The table does not depend on it.
        retry: run cases that failed again.
        any_build: go on with cases of another build; the table names that of each case.
        progress: called with (done, of) now and then.
        options: with `cases`: procedure ("press", "needle", "session", or a dict with its keys), outputs (one or several), repeats,
            seed, set (keys of every case), reference (keys that differ in the case that each is compared with), records.

    Returns:
        SweepResult

    Raises:
        palpate.Error: a key or value is wrong (before the first case runs), or another run holds the folder.
        TypeError, ValueError: jobs is no whole number, or below 1; an argument that there is not; procedure is none.
        KeyboardInterrupt: the rows of the finished cases are in the folder; the same call goes on.
    """
    _need_sweeps()
    jobs = _jobs(jobs)
    for name in options:
        if name not in _OPTIONS:
            raise TypeError(f"sweep() has no argument {name!r}; with cases it has {', '.join(_OPTIONS)} too")
    given = path_of(plan, "plan")
    folder = pathlib.Path(tempfile.mkdtemp(prefix="palpate-sweep-") if folder is None else path_of(folder, "folder"))
    written = None
    if cases is not None:
        text = plan_of(_scene_path(plan), cases, **options)
        kept = folder / "plan.toml"
        if not kept.exists():
            handle, written = tempfile.mkstemp(prefix="cases-", suffix=".toml")
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(text)
            given = written
        elif kept.read_text(encoding="utf-8") != text:
            raise Error(f"{folder}: holds other cases: choose another folder")
        else:
            given = ""
    elif options:
        raise TypeError(f"sweep() takes {', '.join(options)} only with cases")
    try:
        _work(folder, given, progress, jobs=jobs, retry=bool(retry), any_build=bool(any_build))
    except Error as error:
        raise Error(_without_file(str(error), written)) from None
    finally:
        if written is not None:
            os.unlink(written)
    return SweepResult(folder)


def _scene_path(scene):
    """A scene that a plan in any folder finds."""
    name = os.fspath(scene)
    return os.path.abspath(name) if os.path.exists(name) and name not in _palpate.scenes() else name


def merge(folder, shards=(), *, any_build=False):
    """Takes what shards of a sweep have done into one table: `palpate sweep -o FOLDER --merge SHARDS` does the same.

    Args:
        folder: of the sweep; made where it is not there. Shards below FOLDER/shards are found by themselves.
        shards: further folders.
        any_build: take shards of different builds; the table names that of each case.

    Returns:
        SweepResult of the cases that there are.

    Raises:
        palpate.Error: there are no shards, or they are of another plan or of different builds.
    """
    _need_sweeps()
    shards = [path_of(shard, "shards") for shard in shards]
    _palpate.merge_shards(path_of(folder, "folder"), shards, bool(any_build))
    return SweepResult(folder)
