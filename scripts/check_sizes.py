#!/usr/bin/env python3
"""Checks how long files and functions are, and how deep loops and branches nest.

    check_sizes.py [ROOT]      exit status 1 and one line per fault

Reads braces, not C++: enough for code that clang-format has laid out, and takes no time. clang-tidy's
readability-function-size (scripts/check-tidy) measures the same with a compiler.
"""
import pathlib
import re
import sys

FOLDERS = ("base", "volume", "datasets", "occupancy", "chainmail", "channel", "render", "haptics", "session", "report", "command", "studies", "planner", "sweep", "training", "python", "apps", "tests")
MOST_FILE_LINES = 520
MOST_FUNCTION_LINES = 80
DEEPEST = 3

# Comments, raw strings, strings and characters: blanked, but for their line breaks.
QUIET = re.compile(r'//[^\n]*|/\*.*?\*/|R"(\w*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|(?<![0-9a-fA-F])\'(?:\\.|[^\'\\\n])+\'', re.S)
CONTROL = re.compile(r"^(\w+:\s*)?(if|for|while|switch|else|do|try|catch)\b")
SCOPE = re.compile(r"\b(namespace|class|struct|union|enum|extern)\b[^()]*$")


def kind_of(head, inside):
    """What a brace opens, by the text before it: scope, function, control or other."""
    head = re.sub(r"^\s*#[^\n]*$", "", head, flags=re.M).strip()
    if inside:
        return "control" if CONTROL.match(head) else "other"
    if SCOPE.search(re.sub(r"^template\s*<[^{]*>\s*(?=(class|struct))", "", head)):
        return "scope"
    return "function" if ")" in head and not head.endswith("=") else "other"


def functions(text):
    """(first line, last line, deepest nesting) of each function."""
    text = QUIET.sub(lambda m: re.sub(r"[^\n]", " ", m.group()), text)
    stack, head, line, start, deepest, parentheses = [], "", 1, 1, 0, 0
    for c in text:
        line += c == "\n"
        parentheses += (c == "(") - (c == ")")
        if c == "{":
            kind = kind_of(head, any(k == "function" for k, _, _ in stack))
            stack.append((kind, start, parentheses))
            parentheses = 0
            depth = sum(k == "control" for k, _, _ in stack)
            deepest = 0 if kind == "function" else max(deepest, depth)
        elif c == "}" and stack:
            kind, first, parentheses = stack.pop()
            if kind == "function":
                yield first, line, deepest
        if c in "{}" or (c == ";" and parentheses == 0):
            head = ""
        else:
            if not head.strip():
                start = line
            head += c


def faults(root):
    for path in sorted(p for f in FOLDERS for p in (root / f).rglob("*") if p.suffix in (".h", ".cpp")):
        name, text = path.relative_to(root).as_posix(), path.read_text(encoding="utf-8")
        if text.count("\n") > MOST_FILE_LINES:
            yield f"{name}: {text.count(chr(10))} lines: a file has at most {MOST_FILE_LINES}"
        for first, last, deepest in functions(text):
            if last - first + 1 > MOST_FUNCTION_LINES:
                yield f"{name}:{first}: {last - first + 1} lines: a function has at most {MOST_FUNCTION_LINES}"
            if deepest > DEEPEST:
                yield f"{name}:{first}: loops and branches {deepest} deep: at most {DEEPEST}"


found = list(faults(pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ".")))
print("\n".join(found) if found else "files and functions are short enough")
sys.exit(1 if found else 0)
