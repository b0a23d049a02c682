#!/usr/bin/env python3
"""Man pages and bash completion of the programs, from their own --help: a new command or option appears by itself.

    shell_files.py FOLDER PROGRAM...     writes FOLDER/man/man1/*.1 and FOLDER/bash-completion/completions/*
"""
import os
import pathlib
import re
import subprocess
import sys
from dataclasses import dataclass, field

COLUMN = 30  # where CLI11 begins what it says of an option
LIMITS = re.compile(r"\s+(?:(REQUIRED)|(Excludes|Needs):((?: -\S+)+))")


@dataclass
class Entry:
    """An option, a positional argument or a subcommand."""
    names: list
    value: str = ""                             # how its value is written; empty: it takes none
    choices: list = field(default_factory=list)  # all values that it takes; empty: any
    notes: list = field(default_factory=list)    # what it needs, excludes, its default and range
    text: str = ""


@dataclass
class Command:
    words: list      # palpate bench tick
    about: str
    usage: str
    sections: dict   # heading: [Entry]
    commands: list   # of Command

    @property
    def name(self):
        return "-".join(self.words)

    def options(self):
        return [e for entries in self.sections.values() for e in entries if e.names[0].startswith("-")]

    def positionals(self):
        return self.sections.get("Positionals", [])


def entry_of(left, text):
    """`--law TEXT:{a,b}=a Excludes: --x` and what follows it."""
    notes = []
    for required, relation, others in LIMITS.findall(left):
        notes.append("required" if required else f"{relation.lower()} {', '.join(others.split())}")
    left = LIMITS.sub("", left)
    names, _, value = left.partition(" ")
    names = [re.sub(r"\{.*\}$", "", name) for name in names.split(",")]
    value, _, default = value.strip().partition("=") if not value.startswith("[") else (value, "", "")
    many = (value + default).endswith("...")
    default = default.removesuffix("...").strip()
    value, _, rule = value.removesuffix("...").strip().partition(":")
    choices = rule[1:-1].split(",") if rule.startswith("{") else []
    if rule and not choices:
        notes.insert(0, re.sub(r"^\w+ in \[(.*) - (.*)\]$", r"\1 to \2", rule))
    if default:
        notes.append(f"default: {default}")
    shown = "|".join(choices) if choices else value
    return Entry(names, shown + (" ..." if many else ""), choices, notes, text.strip())


def entries_of(lines):
    """The rows of one section of a help text. What is said of a row that is too long for its column is on the next line."""
    rows = []
    for line, after in zip(lines, [*lines[1:], ""]):
        if line.startswith(" " * COLUMN):
            rows[-1][1] += " " + line.strip()
        elif after.startswith(" " * COLUMN):
            rows.append([line.strip(), ""])
        else:
            rows.append([line[:COLUMN].strip(), line[COLUMN:]])
    return [entry_of(left, text) for left, text in rows]


def parse(words, help_text):
    """A program's own description of itself: CLI11's, whose sections are headings at the margin with indented rows."""
    head, *rest = re.split(r"\n\n(?=\S[^\n]*:\n)", help_text.rstrip("\n"))
    about, _, usage = head.partition("\nUsage: ")
    sections = {}
    for part in rest:
        heading, *lines = [line for line in part.split("\n") if line.strip()]
        sections[heading.rstrip(":")] = entries_of(lines)
    return Command(words, about.strip(), usage.strip(), sections, [])


def described(program, words):
    """A command and those below it, asked one by one."""
    # Defaults are the same whoever builds: ~ stands for the home folder.
    environment = {"PATH": os.defpath, "HOME": "~", "LC_ALL": "C.UTF-8"}
    asked = [program, *words[1:], "--help"]
    done = subprocess.run(asked, env=environment, capture_output=True, text=True, check=True)
    command = parse(words, done.stdout)
    for below in command.sections.pop("Subcommands", []):
        command.commands.append(described(program, [*words, below.names[0]]))
    return command


def flat(command):
    yield command
    for below in command.commands:
        yield from flat(below)


# Man pages.

def roff(text):
    text = text.replace("\\", "\\e").replace("-", "\\-").replace("~", "\\(ti").replace("'", "\\(aq").replace("^", "\\(ha")
    return re.sub(r"^\.", r"\\&.", text)


def tagged(entry, bold=True):
    names = ", ".join(f"\\fB{roff(n)}\\fR" if bold else f"\\fI{roff(n)}\\fR" for n in entry.names)
    named = not entry.names[0].startswith("-") and entry.value in ("TEXT", "TEXT ...", "")
    value = "" if not entry.value or named else f" \\fI{roff(entry.value)}\\fR"
    notes = f" ({'; '.join(entry.notes)})" if entry.notes else ""
    return f".TP\n{names}{value}\n{roff(entry.text + notes)}\n"


def man_page(command, version, top):
    lines = [f'.\\" Made from `{" ".join(command.words)} --help` by packaging/shell_files.py.\n',
             f'.TH "{roff(command.name.upper())}" 1 "" "Palpate {version}" "Palpate"\n',
             f".SH NAME\n{roff(command.name)} \\- {roff(brief(command.about))}\n",
             ".SH SYNOPSIS\n", f"\\fB{roff(' '.join(command.words))}\\fR {roff(command.usage[len(' '.join(command.words)):].strip())}\n",
             f".SH DESCRIPTION\n{roff(command.about.rstrip('.'))}.\n"]
    for heading, entries in command.sections.items():
        title = {"Positionals": "ARGUMENTS", "Options": "OPTIONS"}.get(heading)
        lines.append(f".SH {title}\n" if title else f".SS {roff(heading)}\n")
        lines += [tagged(entry, entry.names[0].startswith("-")) for entry in entries]
    if command.commands:
        lines.append(".SH COMMANDS\nEach command has its own manual page.\n")
        lines += [f".TP\n\\fB{roff(' '.join(c.words))}\\fR\n{roff(c.about)}\n" for c in command.commands]
    lines.append(".SH EXIT STATUS\n0 if everything was done, 1 if not, 2 if the command line is wrong;\n"
                 "128 plus the signal's number after a signal.\n")
    also = [f"{'-'.join(command.words[:-1])}"] if len(command.words) > 1 else []
    also += [c.name for c in command.commands] or ([] if also else [n for n in top if n != command.name])
    if also:
        lines.append(".SH SEE ALSO\n" + ",\n".join(f".BR {roff(name)} (1)" for name in also).replace(",\n", " ,\n") + "\n")
    return "".join(lines)


def brief(about):
    """What `whatis` shows: the first words, without an end."""
    first = re.split(r"[:;] |\. (?=[A-Z-])", about.removeprefix("Palpate: ").rstrip("."))[0]
    return first[:1].lower() + first[1:]


# Completion.

SCRIPT = r"""# Completion of {program}, made from its --help by packaging/shell_files.py.
{name}()
{{
    local cur prev words cword split
    _init_completion -s || return
    local command={program} word i
    for ((i = 1; i < cword; ++i)); do
        word=${{words[i]}}
        case "$command $word" in
            {paths}) command+=" $word" ;;
        esac
    done
    case "$command:$prev" in
{values}
    esac
    $split && return
    if [[ $cur == -* ]]; then
        case $command in
{options}
        esac
        [[ ${{COMPREPLY-}} == *= ]] && compopt -o nospace
        return
    fi
    case $command in
{commands}
        *) _filedir ;;
    esac
}} && complete -F {name} {program}
"""


def positional_words(command):
    """Names that the first positional argument takes beside files, where its text begins with them or with "ready:"."""
    for entry in command.positionals()[:1]:
        listed = re.match(r"(?:[^;]*; ready: )?([a-z-]+(?:, [a-z-]+){2,})(?:;|$)", entry.text)
        return listed[1].replace(",", "") if listed else ""
    return ""


def completion(program):
    values, options, commands, paths = [], [], [], []
    for command in flat(program):
        where = " ".join(command.words)
        if len(command.words) > 1:
            paths.append(f'"{where}"')
        for option in command.options():
            if option.value:
                names = " | ".join(f'"{where}:{name}"' for name in option.names)
                does = f'COMPREPLY=($(compgen -W "{" ".join(option.choices)}" -- "$cur"))' if option.choices else "_filedir"
                values.append(f"        {names}) {does}; return ;;")
        names = " ".join(name for option in command.options() for name in option.names)
        options.append(f'            "{where}") COMPREPLY=($(compgen -W "{names}" -- "$cur")) ;;')
        if (words := positional_words(command)) and not command.commands:
            commands.append(f'        "{where}") COMPREPLY=($(compgen -W "{words}" -- "$cur")); _filedir ;;')
        if command.commands:
            below = " ".join(c.words[-1] for c in command.commands)
            # Top commands that main() knows besides.
            below += " help version" if where == "palpate" else ""
            commands.append(f'        "{where}") COMPREPLY=($(compgen -W "{below}" -- "$cur")) ;;')
    name = "_" + program.name.replace("-", "_")
    return SCRIPT.format(program=program.name, name=name, paths=" | ".join(paths) or '""', values="\n".join(values),
                         options="\n".join(options), commands="\n".join(commands))


def main():
    folder, programs = pathlib.Path(sys.argv[1]), [pathlib.Path(p) for p in sys.argv[2:]]
    pages, completions = folder / "man/man1", folder / "bash-completion/completions"
    for place in (pages, completions):
        place.mkdir(parents=True, exist_ok=True)
        for old in place.iterdir():
            old.unlink()
    for program in programs:
        said = subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout
        command = described(program, [program.name])
        for one in flat(command):
            page = man_page(one, said.split()[1], [p.name for p in programs])
            (pages / f"{one.name}.1").write_text(page, encoding="utf-8")
        (completions / program.name).write_text(completion(command), encoding="utf-8")


if __name__ == "__main__":
    main()
