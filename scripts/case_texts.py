#!/usr/bin/env python3
"""Texts of cases as gettext's entries: case_texts.py CASE.toml.. ; and the names of tissues as people say them."""

import pathlib
import re
import sys
import tomllib


def quoted(text):
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def spoken_names():
    """Names of the built-in tissue table, as base/spoken.h says them."""
    root = pathlib.Path(__file__).parent.parent
    known = dict(re.findall(r'{"(\w+)", "([^"]+)"}', (root / "base/spoken.h").read_text()))
    table = tomllib.loads((root / "datasets/tables/tissues.toml").read_text())
    names = [row["name"] for row in table["tissue"]]
    return [known.get(name, name.replace("_", " ")) for name in names]


def main():
    texts = spoken_names()
    for file in sys.argv[1:]:
        case = tomllib.loads(pathlib.Path(file).read_text())
        texts += [case["title"], *case["trains"], *case["briefing"]]
    for text in dict.fromkeys(texts):
        print(f"msgid {quoted(text)}\nmsgstr \"\"\n")


if __name__ == "__main__":
    main()
