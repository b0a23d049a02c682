#!/usr/bin/env python3
"""Texts that people see: each goes through tr(), and has a translation that takes the same values.

    check_translations.py [ROOT]

Without translations/ (a part of a tree) only the first is checked.
"""

import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent.parent)
RENDER = ("coach", "controls", "events", "follower", "header", "keys", "overlay", "result_file", "traces", "tryout")
LITERAL = r'"(?:[^"\\\n]|\\.)*"'
# A sentence anywhere, or one word where it is shown.
SENTENCE = re.compile(r"[A-Za-z]{2,} +[A-Za-z]{2,}")
WORD = re.compile(r"[A-Za-z]{3,}")
SHOWN = re.compile(
    r"(?:\bwords|\bheading|ImGui::(?:TextUnformatted|Button|RadioButton|Checkbox|BeginCombo|Selectable)|setNotice|setCaption|"
    r"pen\.(?:pair|heading))\(\s*$"
)
THROUGH = re.compile(r"\b(?:tr|marked)\(\s*$|\btrn\(\s*(?:" + LITERAL + r"\s*,\s*)?$")
# For programmers and files, not for the window.
APART = re.compile(r"(?:(?:runtime_error|base::error|base::failIf)\([^;]*|addBench\(|extern |PushID\(|BeginChild\(|"
                   r"BeginTable\(|return \{\"--|text \+= [^;]*|std::pair\{\w+, |, title\] : \{[^;]*)$")


def faults_in(file):
    text = re.sub(r"//[^\n]*", lambda m: " " * len(m.group()), file.read_text())
    for group in re.finditer(LITERAL + r"(?:\s*" + LITERAL + ")*", text):
        words = "".join(part[1:-1] for part in re.findall(LITERAL, group.group()))
        before = text[max(0, group.start() - 600) : group.start()]
        shown = SHOWN.search(before) and WORD.search(words) and not words.startswith("##")
        if not (shown or SENTENCE.search(words)) or THROUGH.search(before) or APART.search(before):
            continue
        if text.rfind("\n#", 0, group.start()) > text.rfind("\n", 0, group.start()) - 1:
            continue
        line = text.count("\n", 0, group.start()) + 1
        yield f"{file.relative_to(ROOT)}:{line}: {words!r} goes past tr(): put it into tr(), or marked() where it is shown later"


def entries(catalogue):
    """msgid, plural or None, translations, fuzzy: of a file in one line a text."""
    plain = subprocess.run(["msgcat", "--no-wrap", catalogue], capture_output=True, text=True, check=True).stdout
    for block in plain.split("\n\n"):
        strings = {key: value for key, value in re.findall(r'^(msg\S+) "(.*)"$', block, re.M)}
        if strings.get("msgid") and not block.startswith("#~"):
            told = [value for key, value in strings.items() if key.startswith("msgstr")]
            yield strings["msgid"], strings.get("msgid_plural"), told, "#, fuzzy" in block


def values(text):
    return re.findall(r"\{[^}]*\}", text)


def faults_of(catalogue, wanted):
    name = catalogue.relative_to(ROOT)
    known = {}
    for text, plural, told, fuzzy in entries(catalogue):
        known[text] = told
        if fuzzy or not all(told):
            yield f"{name}: {text!r} is not translated"
            continue
        for one in told:
            if one and values(one) not in (values(text), values(plural or text)):
                yield f"{name}: {text!r} takes {values(text)}, its translation {values(one)}"
    for text in wanted:
        if text not in known:
            yield f"{name}: {text!r} is not translated: scripts/update-translations puts it there"
    for text in known:
        if text not in wanted:
            yield f"{name}: {text!r} is in no source any more: scripts/update-translations takes it out"


def main():
    files = sorted(ROOT.glob("trainer/*.cpp")) + [ROOT / f"render/{name}.cpp" for name in RENDER]
    faults = [fault for file in files if file.exists() for fault in faults_in(file)]
    catalogues = sorted(ROOT.glob("translations/*.po"))
    if catalogues:
        with tempfile.TemporaryDirectory() as folder:
            pot = pathlib.Path(folder) / "all.pot"
            subprocess.run([ROOT / "scripts/update-translations", "--extract", pot], check=True)
            wanted = {text for text, *_ in entries(pot)}
        for catalogue in catalogues:
            subprocess.run(["msgfmt", "--check", "-o", "/dev/null", catalogue], check=True)
            faults += faults_of(catalogue, wanted)
    for fault in faults:
        print(fault)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
