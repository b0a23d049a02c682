#!/usr/bin/env python3
"""Texts of cases and curricula as gettext's entries: case_texts.py FILE.toml.. ; the names of tissues and structures as people say them; names
of measures."""

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


def structure_names():
    """Targets and vital structures of the included scenes, as base/spoken.h says them."""
    root = pathlib.Path(__file__).parent.parent
    scenes = [tomllib.loads(file.read_text())
              for file in sorted([*root.glob("datasets/scenes/*.toml"), *root.glob("training/cases/*/scene.toml")])]
    names = [name for scene in scenes
             for name in (scene["target"]["structure"], *(vital["name"] for vital in scene.get("vital", [])))]
    return [name.replace("_", " ") for name in names]


def measures():
    """Labels and units of haptics::measures()."""
    root = pathlib.Path(__file__).parent.parent
    found = re.findall(r'^    \{"\w+", "[^"]*", "([^"]*)", "([^"]*)",', (root / "haptics/measures.cpp").read_text(), re.M)
    return [label for label, _ in found] + [unit for _, unit in found if " " in unit]


def main():
    texts = spoken_names() + structure_names() + measures()
    for file in sys.argv[1:]:
        made = tomllib.loads(pathlib.Path(file).read_text())
        texts += [made["title"], *made.get("trains", []), *made.get("briefing", [])]
        texts += [exercise["title"] for exercise in made.get("exercise", [])]
    for text in dict.fromkeys(texts):
        print(f"msgid {quoted(text)}\nmsgstr \"\"\n")


if __name__ == "__main__":
    main()
