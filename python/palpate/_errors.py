"""Errors of palpate. Every message is one line: what, where, and what to do."""

import re

_PLACE = re.compile(r"^(?P<file>.+?):(?P<line>\d+): (?P<rest>.*)$", re.S)
_KEY = re.compile(r"^(?:\[+(?P<section>[^\]]+)\]+ )?(?:(?P<who>'[^']*':) )?(?P<key>[A-Za-z_][\w.]*)(?: =|:)")
_QUOTED = re.compile(r"key '(?P<key>[^']+)'")


class Error(RuntimeError):
    """Something that was asked for could not be done."""


class SceneError(Error, ValueError):
    """A scene that is not right.

    Attributes:
        file: the file, or the name that was given to the text; None where it has none.
        line: number of the line, from 1; None where there is none.
        key: the key, with its section ("dffb.range_mm"); None where no single key is at fault.
    """

    def __init__(self, message: str, file: str | None = None, line: int | None = None, key: str | None = None) -> None:
        super().__init__(message)
        self.file = file
        self.line = line
        self.key = key

    def __reduce__(self):
        return type(self), (str(self), self.file, self.line, self.key)


def scene_error(message: str) -> SceneError:
    """The SceneError of a message "FILE:LINE: [section] key = value: what is wrong"."""
    place = _PLACE.match(message)
    rest = place["rest"] if place else message
    quoted, key = _QUOTED.search(rest), _KEY.match(rest)
    name = None
    if quoted:
        name = quoted["key"]
    elif key:
        name = ".".join(filter(None, (key["section"], key["key"])))
    return SceneError(message, place["file"] if place else None, int(place["line"]) if place else None, name)
