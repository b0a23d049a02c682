"""What is wrong with the arguments of a call of the C++ side, on one line. pybind11's own text has several and no advice."""

import ast
import operator
import os
import re

_REFUSED = re.compile(r"(\w+)\(\): incompatible (constructor|function) arguments\..*\n    1\. ([\w.]*)(\(.*)\n")


def said(value):
    """What an error says of a value: as it is written and its type; of what is long, or has several lines, the type."""
    if value is None:
        return "None"
    try:
        text = repr(value)
    except Exception:  # of somebody else's class; or too many digits
        text = ""
    kind = type(value).__name__
    return f"{text} ({kind})" if 0 < len(text) <= 60 and text.isprintable() else f"a {kind}"


def explained(text, given, named):
    """The message for a call that pybind11 refused with `text`; None where that is something else.

    Args:
        given: arguments by position, with self.
        named: the others.
    """
    refused = _REFUSED.match(text)
    if refused is None:
        return None
    name, kind, owner, signature = refused.groups()
    try:
        takes = ast.parse(f"def _{signature}: pass").body[0].args
    except SyntaxError:
        return None
    if kind == "constructor":
        name, given = owner.rpartition(".")[2], given[1:]  # self is not in the text
    wrong = _misplaced(takes, given, named)
    return f"{name}() {wrong}" if wrong else _mistyped(takes, given, named) or f"{name}() takes {signature}"


def _names(arguments):
    return [argument.arg for argument in arguments]


def _listed(names):
    return ", ".join(name for name in names if name != "self")


def _misplaced(takes, given, named):
    """What is unknown, too much, given twice or missing."""
    places, words = _names(takes.args), _names(takes.kwonlyargs)
    unknown = [name for name in named if name not in places + words]
    if unknown and takes.kwarg is None:
        return f"has no argument {unknown[0]!r}: it has {_listed(places + words) or 'none'}"
    if len(given) > len(places) and takes.vararg is None:
        own = len(places[:1]) if places[:1] == ["self"] else 0
        more = f"; give {_listed(words)} by name" if words else ""
        few = f" ({_listed(places)})" if len(places) > own else ""
        return f"takes {len(places) - own} arguments by position{few}, not {len(given) - own}{more}"
    twice = [name for name in places[: len(given)] if name in named]
    if twice:
        return f"has the argument {twice[0]} twice: give it by position or by name"
    needed = places[len(given) : len(places) - len(takes.defaults)]
    needed += [word for word, default in zip(words, takes.kw_defaults) if default is None]
    missing = [name for name in needed if name not in named]
    return f"needs the argument {missing[0]}: it has {_listed(places + words)}" if missing else None


def _mistyped(takes, given, named):
    """Which argument is of another type, and what it has to be."""
    values = {**dict(zip(_names(takes.args), given)), **named}
    for argument in takes.args + takes.kwonlyargs:
        if argument.arg in values and argument.annotation is not None:
            value = values[argument.arg]
            wanted = _wanted(ast.unparse(argument.annotation), value)
            if wanted:
                return f"{argument.arg}: give {wanted}, not {said(value)}"
    return None


def _wanted(kind, value):
    """What has to stand in place of a value; None where pybind11 takes it for this type of its."""
    optional = re.fullmatch(r"Optional\[(.*)\]", kind)
    if optional:
        wanted = None if value is None else _wanted(optional[1], value)
        return f"{wanted} or None" if wanted else None
    if kind.startswith("palpate."):
        name = kind.rpartition(".")[2]
        return None if name in (one.__name__ for one in type(value).__mro__) else f"an object of palpate.{name}"
    wanted, convert = _TYPES.get(kind, (None, None))
    try:
        if wanted:
            convert(value)
    except (TypeError, ValueError, OverflowError):
        return wanted
    return None


def _word(value):
    if isinstance(value, str):
        value.encode()  # half a character is a ValueError
    elif not isinstance(value, (bytes, bytearray)):
        raise TypeError


def _number(value):
    if isinstance(value, (str, bytes, bytearray)):
        raise TypeError
    float(value)


def _whole(value):
    if not -(2**31) <= operator.index(value) < 2**31:
        raise OverflowError


def _truth(value):
    if value is not None and not hasattr(type(value), "__bool__"):
        raise TypeError
    bool(value)


def _file(value):
    if b"\0" in os.fsencode(value):
        raise ValueError


def _table(value):
    if not isinstance(value, dict):
        raise TypeError


def _function(value):
    if not callable(value):
        raise TypeError


# pybind11's name of a type: what an error calls it, and what fails where pybind11 refuses.
_TYPES = {
    "str": ("a word (str)", _word),
    "float": ("a number", _number),
    "int": ("a whole number below 2**31", _whole),
    "bool": ("True or False", _truth),
    "dict": ("a dict", _table),
    "os.PathLike": ("the name of a file", _file),
    "List[os.PathLike]": ("a list of names of files", lambda value: [_file(one) for one in value]),
    "Callable": ("a function", _function),
}
