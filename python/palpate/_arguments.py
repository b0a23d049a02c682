"""What is wrong with the arguments of a call of the C++ side, on one line. pybind11's own text has several and no advice."""

import ast
import inspect
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
    return f"{text} ({kind})" if 0 < len(text) <= 60 and text.isprintable() else f"a value of type {kind}"


def path_of(value, name):
    """The name of a file or folder as text. Raises TypeError that names it."""
    try:
        return os.fspath(value)
    except TypeError:
        raise TypeError(f"{name}: give the name of a file or a folder, not {said(value)}") from None


def whole(value, asked):
    """A whole number. Raises TypeError that begins with `asked`: the argument, and what it has to be."""
    try:
        return operator.index(value)
    except TypeError:
        raise TypeError(f"{asked}, not {said(value)}") from None


class ClassSignature:
    """The __signature__ of a class of the C++ side, which inspect.signature() does not find in its __init__."""

    def __get__(self, instance, owner):
        if inspect.isfunction(owner.__init__):
            return None  # a class that Python derives has its own
        whole = inspect.signature(owner.__init__)
        return whole.replace(parameters=list(whole.parameters.values())[1:])


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
        own = places[:1] == ["self"]
        most = len(places) - own
        few = f"{most} argument{'s' * (most > 1)} ({_listed(places)})" if most else "no arguments"
        more = f": give {_listed(words)} by name" if words else ""
        return f"takes {few} by position, not {len(given) - own}{more}"
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
    wanted, convert = _TYPES.get(kind, ("", str))
    try:
        convert(value)
    except _Unfit as unfit:
        return f"{wanted} {unfit}"
    except Exception:  # somebody else's class may raise what it likes
        return wanted
    return None


class _Unfit(Exception):
    """Of the right type, but not as it has to be."""


def _word(value):
    if isinstance(value, str):
        try:
            value.encode()
        except UnicodeEncodeError:
            raise _Unfit("without half a character (surrogate)") from None
    elif not isinstance(value, (bytes, bytearray)):
        raise TypeError


def _number(value):
    if isinstance(value, (str, bytes, bytearray)):
        raise TypeError
    try:
        float(value)
    except OverflowError:
        raise _Unfit("below 1.8e308") from None


def _whole(value):
    if not -(2**31) <= operator.index(value) < 2**31:
        raise _Unfit("below 2**31")


def _truth(value):
    if value is not None and not hasattr(type(value), "__bool__"):
        raise TypeError
    bool(value)


def _file(value):
    name = os.fspath(value)
    try:
        whole = b"\0" not in os.fsencode(name)
    except UnicodeEncodeError:
        whole = False
    if not whole:
        raise _Unfit("without NUL or half a character")


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
    "int": ("a whole number", _whole),
    "bool": ("True or False", _truth),
    "dict": ("a dict", _table),
    "os.PathLike": ("the name of a file", _file),
    "List[os.PathLike]": ("a list of names of files", lambda value: [_file(one) for one in value]),
    "Callable": ("a function", _function),
}
