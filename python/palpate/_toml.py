"""TOML text of dictionaries: what scenes and plans of sweeps are made of."""

import json
import numbers
import os


def _value(value):
    if hasattr(value, "tolist"):
        value = value.tolist()  # of numpy
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, numbers.Integral):
        return str(int(value))
    if isinstance(value, numbers.Real):
        return repr(float(value))
    if isinstance(value, (str, os.PathLike)):
        if "\0" in os.fspath(value):
            raise ValueError(f"{value!r} holds a NUL character, which no name has")
        return json.dumps(os.fspath(value), ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_value(v) for v in value) + "]"
    raise TypeError(f"a {type(value).__name__} cannot stand in a scene: give numbers, words, lists or dictionaries")


def _key(key):
    key = str(key)
    return key if key.replace("_", "").replace("-", "").isalnum() and key.isascii() else json.dumps(key, ensure_ascii=False)


def _is_tables(value):
    return isinstance(value, (list, tuple)) and len(value) > 0 and all(isinstance(v, dict) for v in value)


def _table(table, path, lines):
    for key, value in table.items():
        if not isinstance(value, dict) and not _is_tables(value):
            lines.append(f"{_key(key)} = {_value(value)}")
    for key, value in table.items():
        name = ".".join((*path, _key(key)))
        if isinstance(value, dict):
            lines += ["", f"[{name}]"]
            _table(value, (*path, _key(key)), lines)
        elif _is_tables(value):
            for one in value:
                lines += ["", f"[[{name}]]"]
                _table(one, (*path, _key(key)), lines)


def dumps(table):
    """TOML text of nested dictionaries; lists of dictionaries become arrays of tables."""
    lines = []
    _table(table, (), lines)
    text = "\n".join(lines) + "\n"
    text.encode()  # half a character is a ValueError
    return text
