"""Man pages and completion of the build tree say all that --help says: every command, every option, every value.

    PALPATE_BIN=build/dev/bin PALPATE_SHELL=build/dev/share/shell shell_test.py
"""

import os
import pathlib
import re
import subprocess
import unittest

BIN = pathlib.Path(os.environ["PALPATE_BIN"])
SHELL = pathlib.Path(os.environ["PALPATE_SHELL"])
PROGRAMS = [name for name in ("palpate", "palpate-view", "palpate-trainer", "palpate-reference", "palpate-mesh") if (BIN / name).exists()]
ENVIRONMENT = {"PATH": "/usr/bin:/bin", "HOME": "/nonexistent", "LC_ALL": "C.UTF-8"}


def help_of(words):
    return subprocess.run([BIN / words[0], *words[1:], "--help"], capture_output=True, text=True, check=True).stdout


def found():
    """{command: (options, subcommands, {option: values})}, read from --help by plain patterns: not by what made the files."""
    everything, waiting = {}, [[name] for name in PROGRAMS]
    while waiting:
        words = waiting.pop()
        text = help_of(words)
        options = [o for line in re.findall(r"^  (-[^ {]+)", text, re.M) for o in line.split(",")]
        values = {o: v.split(",") for o, v in re.findall(r"^  (?:-\w,)?(--[\w-]+) TEXT:\{([^}]+)\}", text, re.M)}
        _, _, below = text.partition("\nSubcommands:\n")
        commands = re.findall(r"^  (\S+)", below, re.M)
        everything[tuple(words)] = (options, commands, values)
        waiting += [[*words, command] for command in commands]
    return everything


FOUND = found()


class ManPages(unittest.TestCase):
    def test_every_command_has_a_page_with_its_options_and_no_page_is_of_another(self):
        self.assertGreater(len(FOUND), 40)
        pages = {p.name for p in (SHELL / "man/man1").iterdir()}
        self.assertEqual(pages, {"-".join(words) + ".1" for words in FOUND})
        for words, (options, commands, _) in FOUND.items():
            text = (SHELL / "man/man1" / ("-".join(words) + ".1")).read_text(encoding="utf-8").replace("\\-", "-")
            for option in options:
                self.assertIn(f"\\fB{option}\\fR", text, words)
            for command in commands:
                self.assertIn(f"\\fB{' '.join(words)} {command}\\fR", text, words)

    def test_groff_has_nothing_to_say_of_them(self):
        pages = sorted((SHELL / "man/man1").iterdir())
        done = subprocess.run(["groff", "-man", "-ww", "-Tutf8", "-K", "utf8", "-z", *pages], capture_output=True, text=True, env=ENVIRONMENT)
        self.assertEqual(done.stderr, "")
        for page in pages[:3]:
            shown = subprocess.run(["man", "-l", page], capture_output=True, text=True, env=ENVIRONMENT)
            self.assertIn("SYNOPSIS", shown.stdout)


class Completion(unittest.TestCase):
    def completed(self, lines):
        """What a bash offers at the end of each line, by Debian's bash-completion."""
        script = "source /usr/share/bash-completion/bash_completion\n"
        script += "".join(f"source {SHELL}/bash-completion/completions/{name}\n" for name in PROGRAMS)
        script += ('offer() { COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMP_LINE="$*"; COMP_POINT=${#COMP_LINE}; COMP_TYPE=9\n'
                   '  COMPREPLY=(); compopt() { :; }; "_${1//-/_}" "$1"; echo "${COMPREPLY[*]}"; }\n')
        script += "".join("offer " + " ".join(f"'{word}'" for word in line) + "\n" for line in lines)
        done = subprocess.run(["bash", "--norc"], input=script, capture_output=True, text=True, env=ENVIRONMENT, cwd=SHELL)
        self.assertEqual(done.stderr, "")
        return [set(line.split()) for line in done.stdout.splitlines()]

    def test_every_option_and_command_is_offered(self):
        lines, expected = [], []
        for words, (options, commands, values) in FOUND.items():
            lines.append([*words, "-"])
            expected.append(set(options))
            if commands:
                lines.append([*words, ""])
                expected.append(set(commands) | ({"help", "version"} if words == ("palpate",) else set()))
            for option, takes in values.items():
                lines.append([*words, option, ""])
                expected.append(set(takes))
        for line, offered, wanted in zip(lines, self.completed(lines), expected, strict=True):
            self.assertEqual(offered, wanted, line)

    def test_beginnings_files_and_names(self):
        offered = self.completed([["palpate", "tr"], ["palpate", "train", "--task=find"], ["palpate", "info", "man/man1/palpate-inf"],
                                  ["palpate", "train", "near"], ["palpate", "sweep", "pal"], ["palpate", "train", "--record", "bash-c"]])
        self.assertEqual(offered, [{"train"}, {"find-lump"}, {"man/man1/palpate-info.1"}, {"near-vessel"}, {"palpation"}, {"bash-completion"}])


if __name__ == "__main__":
    unittest.main()
