"""Errors of palpate. Every message is one line: what, where, and what to do."""

import re

_PLACE = re.compile(r"^(?P<file>.+?):(?P<line>\d+): (?P<rest>.*)$", re.S)
_KEY = re.compile(r"^(?:\[+(?P<section>[^\]]+)\]+ )?(?:(?P<who>'[^']*':) )?(?P<key>[A-Za-z_][\w.]*)(?: =|:)")
_SECTION = re.compile(r"^\[+(?P<section>[^\]]+)\]+:")
_QUOTED = re.compile(r"key '(?P<key>[^']+)'")


# What messages advise to users of the programs, and what it is in Python; advice that Python has not is left out.
_IN_PYTHON = [(re.compile(pattern), ours) for pattern, ours in [
    (r"--trainee (\S+) takes a biopsy(.*), or add --palpate", r'the trainee "\1" takes a biopsy\2, or give "script"'),
    (r"--trainee (\S+) holds a needle(.*): leave --trainee away", r'the trainee "\1" holds a needle\2: give "script"'),
    (r"give --map NAME \(one that --list-maps lists, or a TOML file\), --names FILE \([^)]*\), --set NAME=TISSUE, or "
     r"--default-tissue NAME; --write-map FILE begins a label map",
     'give map=NAME (of a built-in map, or a TOML file), set={NAME: TISSUE} or default_tissue=NAME'),
    (r"; 'palpate import --list-maps' lists them", ": `palpate import --list-maps` lists them"),
    (r"--map (\w+) \(", r'map="\1" ('),
    (r"add --any-build", "give any_build=True"),
    (r"give their folders after --merge", "give their folders"),
    (r", or go on with --anyway", ""),
    (r", or --crop\b", ""),
    (r"--target NAME", "target=NAME (Scene.for_volume)"),
    (r"(?:add|give) --image FILE", "give image=FILE"),
    (r"(?:add|give) --image-unit HU", 'give image_unit="HU"'),
    (r"(?:add|give) --voxel MM", "give voxel=, in metres"),
    (r"with --body-from-hull MM", "with body_from_hull=, in metres"),
]]
_ARGUMENTS = {"set", "map", "default-tissue", "image", "image-unit", "image-series", "ignore-frame-of-reference", "stiffness-from", "voxel", "body-from-image", "body-from-hull",
              "tissues", "trainee"}
_OPTION = re.compile(r"(?<![\w/-])(?<!palpate import )--([a-z]+(?:-[a-z]+)*)")
_OF_IMPORT = re.compile(r"(?<!palpate import )--(volume|image-volume|series|axes|image-axes|dicom-labels|round|renumber|overlap|"
                        r"threshold|slice-spacing|names|crop)\b")


# The file that scenes of a volume in memory name, which is not there.
_IN_MEMORY = re.compile(r"^(?:.*/)?volume-in-memory\.vdb:(?:\d+:)? ")


def in_python(message: str) -> str:
    """What a program says, with the arguments of Python for its options, and without a file that is none."""
    message = _IN_MEMORY.sub("", message)
    if "--" not in message:
        return message
    for pattern, ours in _IN_PYTHON:
        message = pattern.sub(ours, message)
    message = _OPTION.sub(lambda m: m[1].replace("-", "_") if m[1] in _ARGUMENTS else m[0], message)
    if _OF_IMPORT.search(message):
        message += " (an option of `palpate import`, whose .vdb Volume.open reads)"
    return message


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


def model_error(message: str) -> Error:
    """What is said while a scene's volume or model is made: a SceneError where it says a place or a section of the scene."""
    if _PLACE.match(message) or message.startswith("["):
        return scene_error(message)
    return Error(in_python(message))


def scene_error(message: str) -> SceneError:
    """The SceneError of a message "FILE:LINE: [section] key = value: what is wrong"."""
    message = in_python(message)
    place = _PLACE.match(message)
    rest = place["rest"] if place else message
    quoted, key = _QUOTED.search(rest), _KEY.match(rest)
    name = None
    if quoted:
        name = quoted["key"]
    elif key:
        name = ".".join(filter(None, (key["section"], key["key"])))
    elif section := _SECTION.match(rest):
        name = section["section"]
    return SceneError(message, place["file"] if place else None, int(place["line"]) if place else None, name)
