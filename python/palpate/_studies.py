"""Figures of studies that commands make."""

import json
import os
import pathlib
import shutil
import subprocess
from typing import Any


def accuracy(file: str | os.PathLike[str] | None = None, *, command: str | os.PathLike[str] | None = None) -> dict[str, Any]:
    """The accuracy figures: how far forces and shapes are from closed forms and finite elements.

    Args:
        file: what `palpate accuracy --json FILE` wrote. Without it the command is run, which takes minutes.
        command: the program `palpate`; default: that in PATH.

    Returns:
        dict: "verification", a list of {problem, quantity, ours, reference, error_pct, source}, and "chart", a list of
        {method, setting, scene, us_per_update, rms_pct, force_pct}. pandas.DataFrame(result["verification"]) is a table.

    Raises:
        palpate.Error: the program is not there or failed, or the file holds no such figures.
    """
    from . import Error
    from ._arguments import path_of

    if file is not None:
        source = file
        try:
            text = pathlib.Path(path_of(file, "file")).read_bytes()
        except OSError as error:
            raise Error(f"{file}: {error.strerror}: give what `palpate accuracy --json` wrote") from None
    else:
        program = command or shutil.which("palpate")
        if program is None:
            raise Error("accuracy: there is no program palpate in PATH: install it, or say where with command=")
        try:
            done = subprocess.run([os.fspath(program), "accuracy", "--json", "-"], capture_output=True)
        except OSError as error:
            raise Error(f"{program}: {error.strerror}: say with command= where the program palpate is") from None
        if done.returncode != 0:
            raise Error(done.stderr.decode(errors="replace").strip() or f"palpate accuracy: exit status {done.returncode}")
        source, text = f"{program} accuracy", done.stdout
    try:
        figures = json.loads(text)
    except ValueError as error:
        raise Error(f"{source}: is no JSON ({error}): give what `palpate accuracy --json` wrote") from None
    if not isinstance(figures, dict) or not {"verification", "chart"} <= figures.keys():
        raise Error(f"{source}: has no figures of accuracy: give what `palpate accuracy --json` wrote")
    return figures
