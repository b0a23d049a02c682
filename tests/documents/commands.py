"""Commands of ours that the documents show: read from their blocks, and checked against what the programs say of themselves."""

import pathlib
import re
import shlex
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "packaging"))
import shell_files  # noqa: E402

PROGRAMS = ("palpate", "palpate-view", "palpate-trainer", "palpate-reference", "palpate-mesh")
SHELL = {"sh", "bash", "shell", "console"}  # without a word: diagrams and lists
# `inline` that begins with a program is a command too; `palpate sweep` alone names it.
INLINE = re.compile(r"`((?:palpate|palpate-view|palpate-trainer|palpate-reference|palpate-mesh|scripts/[a-z-]+) [^`]+)`")


def documents():
    return [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]


def blocks(text):
    """(line number, line) of each line of code: indented by four, or fenced as shell. Lines that end in \\ are joined."""
    fenced, shell, held, before = False, False, "", ""
    for number, line in enumerate(text.splitlines(), 1):
        if line.lstrip().startswith("```"):
            fenced, shell = not fenced, line.strip("` ") in SHELL
            continue
        indented = not fenced and re.match(r"^(    |\t)", line) and not before.startswith(("- ", "* "))
        if (fenced and shell) or indented or held:
            held += line.strip()
            if held.endswith("\\"):
                held = held[:-1]
                continue
            yield number, held
            held = ""
        elif line.strip():
            before = line.lstrip()


def pieces(line):
    """Simple commands of a line of shell: what is between ; && | and the words of loops, without redirections."""
    lexer = shlex.shlex(line, posix=True, punctuation_chars=";&|<>()")
    lexer.whitespace_split = True
    lexer.commenters = "#"
    words, skip = [], False
    for word in lexer:
        if re.fullmatch(r"[;&|]+|[()]+[;&|]*", word) and not (word[0] == "(" and words):
            yield words
            words = []
        elif re.fullmatch(r"[<>]+&?", word):
            skip = True
        elif skip:
            skip = False
        elif word in ("do", "then") or (not words and (word in ("sudo", "exec", "time") or re.match(r"^[A-Z_]+=", word))):
            words = []
        else:
            words.append(word)
    yield words


def commands_of(text):
    """(line number, words) of each command that begins with a program of ours."""
    found = [(number, line) for number, line in blocks(text)]
    found += [(text.count("\n", 0, m.start()) + 1, m[1].replace("\n", " ")) for m in INLINE.finditer(text)]
    for number, line in found:
        try:
            parts = list(pieces(line))
        except ValueError:  # prose in an indented block, with an apostrophe
            parts = []
        for words in parts:
            if words[:1] == ["parallel"]:
                words = words[2:]
            if words and (words[0] in PROGRAMS or words[0].startswith("scripts/")):
                yield number, words
            elif words and re.match(r"^[~\w./-]*/bin/(palpate[a-z-]*)$", words[0]):
                yield number, [pathlib.Path(words[0]).name, *words[1:]]


class Checker:
    """What is wrong with a command, by the programs' --help."""

    def __init__(self, folder):
        self.roots = {name: shell_files.described(pathlib.Path(folder) / name, [name])
                      for name in PROGRAMS if (pathlib.Path(folder) / name).exists()}

    def fault(self, words):
        if words[0].startswith("scripts/"):
            return self.script_fault(words)
        command = self.roots.get(words[0])
        if command is None:  # was not built
            return ""
        rest = words[1:]
        if rest[:1] == ["help"]:
            rest = [*rest[1:], "--help"]
        if rest == ["version"]:
            return ""
        while rest and command.commands and not rest[0].startswith("-") and not rest[0].isupper():
            below = [c for c in command.commands if c.words[-1] == rest[0]]
            if not below:
                if command.positionals():
                    break
                return f"there is no command {' '.join(command.words)} {rest[0]}"
            command, rest = below[0], rest[1:]
        return self.options_fault(command, rest)

    def options_fault(self, command, rest):
        options = {name: option for option in command.options() for name in option.names}
        plain, taking = 0, None
        for word in rest:
            name, _, value = word.partition("=")
            if re.match(r"^--?[a-zA-Z]", word):
                if name not in options:
                    return f"{' '.join(command.words)} has no option {name}"
                taking = options[name] if options[name].value else None
                word = value
                if not value:
                    continue
            elif taking is None:
                plain += 1
                continue
            if taking and taking.choices and not re.search(r"[$|.{]|^[A-Z]+$", word):
                for one in word.split(","):
                    if one not in taking.choices:
                        return f"{' '.join(command.words)}: {one} is none of {', '.join(taking.choices)}"
            taking = taking if taking and "..." in taking.value else None
        if plain and not command.positionals() and not all(word.isupper() for word in rest):
            return f"{' '.join(command.words)} takes no argument of its own"
        return ""

    def script_fault(self, words):
        script = ROOT / words[0]
        if not script.is_file():
            return f"there is no {words[0]}"
        text = script.read_text(encoding="utf-8")
        if words[0] == "scripts/palpate":
            return self.fault(["palpate", *words[1:]]) if len(words) > 1 else ""
        for word in words[1:]:
            if word.startswith("--") and word.partition("=")[0] not in text:
                return f"{words[0]} has no option {word}"
        return ""
