#!/usr/bin/env python3
"""Checks the tables of the documents: every row has as many columns as its header, and docs/score.md says in words what each
measure of haptics/measures.cpp is.

    check_tables.py [ROOT]      exit status 1 and one line per fault
"""
import pathlib
import re
import sys

RULE = re.compile(r"^\s*\|[\s:|-]*-[\s:|-]*\|\s*$")  # the line under a header
MEASURE = re.compile(r'^\s*\{"(\w+)", "', re.M)      # of haptics/measures.cpp: key and title
MEANINGS = ["`--json` key", "meaning"]               # header of the tables that explain measures
OTHER_KEYS = {"points", "losses", "judged"}                    # of the score, and no measure


def cells(line):
    return [c.strip() for c in re.split(r"(?<!\\)\|", line.strip())[1:-1]]


def rows(text):
    """(line number, header, cells) of every line of a table but its header."""
    header, before, fenced = None, "", False
    for number, line in enumerate(text.splitlines(), 1):
        fenced ^= line.lstrip().startswith("```")
        if fenced or not line.lstrip().startswith("|"):
            header = None
        elif header is None and RULE.match(line) and before.lstrip().startswith("|"):
            header = cells(before)
            yield number, header, cells(line)
        elif header is not None:
            yield number, header, cells(line)
        before = "" if fenced else line


def in_words(meaning):
    return len(re.findall(r"[A-Za-z]{3,}", meaning)) >= 2


def measure_faults(root, page):
    code = root / "haptics/measures.cpp"
    keys = MEASURE.findall(code.read_text(encoding="utf-8")) if code.exists() else []
    if not keys:
        yield "haptics/measures.cpp: no measures found: has their table moved?"
    explained = set()
    for number, header, row in rows((root / page).read_text(encoding="utf-8")):
        if header != MEANINGS or RULE.match("|" + "|".join(row) + "|"):
            continue
        named = re.findall(r"`(\w+)`", row[0])
        explained.update(named)
        for key in named:
            if key not in keys and key not in OTHER_KEYS:
                yield f"{page}:{number}: there is no measure `{key}` in haptics/measures.cpp"
        if not in_words(" ".join(row[1:])):
            yield f"{page}:{number}: {row[0]}: say in words what it is"
    for key in keys:
        if key not in explained:
            yield f"haptics/measures.cpp: measure `{key}` is not explained in {page}"


def faults(root):
    for path in sorted([*root.glob("*.md"), *root.glob("docs/**/*.md")]):
        name = path.relative_to(root).as_posix()
        for number, header, row in rows(path.read_text(encoding="utf-8")):
            if len(row) != len(header):
                yield f"{name}:{number}: {len(row)} columns under a header of {len(header)}"
    if (root / "docs/score.md").exists():
        yield from measure_faults(root, "docs/score.md")


found = list(faults(pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ".")))
print("\n".join(found) if found else "the documents' tables hold")
sys.exit(1 if found else 0)
