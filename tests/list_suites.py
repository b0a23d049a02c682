#!/usr/bin/python3 -B
"""Writes what ctest shall know of a test program: an entry for each suite, whose tests then share what they prepare.

    list_suites.py FILE PREFIX SLOW ALONE NEVER PROGRAM...

SLOW: lists as tests/slow.txt, separated by semicolons, or "". ALONE: a regular expression of suites that need the machine for themselves, or "".
NEVER: one of suites that this build cannot run, or "". PROGRAM: with what it is started by.

A test that SLOW names has an entry of its own, so that ctest can leave it out.
"""
import pathlib
import re
import subprocess
import sys


def slow_ones(paths):
    """Regular expressions of the lists' lines, for names with the prefix."""
    lines = [line for path in paths.split(";") if path for line in pathlib.Path(path).read_text(encoding="utf-8").splitlines()]
    return [pattern for pattern in (line.partition("#")[0].strip() for line in lines) if pattern]


def suites_of(program):
    """Names of the tests of each suite, as --gtest_list_tests has them: `Suite.`, and its tests indented below."""
    done = subprocess.run([*program, "--gtest_list_tests"], capture_output=True, text=True, timeout=60, check=False)
    if done.returncode != 0:
        sys.exit(f"{' '.join(program)}: exit status {done.returncode}\n{done.stdout}{done.stderr}")
    found, suite = {}, None
    for line in done.stdout.splitlines():
        name = line.partition("#")[0].rstrip()
        if name.startswith("  ") and suite:
            found[suite].append(name.strip())
        elif re.fullmatch(r"[\w/]+\.", name):
            suite = name[:-1]
            found[suite] = []
    return found


def main():
    file, prefix, slow, alone, never, *program = sys.argv[1:]
    patterns = slow_ones(slow)
    entries, lonely = [], []
    for suite, tests in suites_of(program).items():
        if never and re.fullmatch(never, suite):
            continue
        before = len(entries)
        apart = [test for test in tests if any(re.match(pattern, f"{prefix}.{suite}.{test}") for pattern in patterns)]
        entries += [(f"{prefix}.{suite}.{test}", f"{suite}.{test}") for test in apart]
        if len(apart) < len(tests):
            without = ":".join(f"{suite}.{test}" for test in apart)
            entries.append((f"{prefix}.{suite}", f"{suite}.*" + (f"-{without}" if without else "")))
        if alone and re.search(alone, suite):
            lonely += [name for name, _ in entries[before:]]
    if not entries:
        sys.exit(f"{' '.join(program)}: no tests")
    command = " ".join(f'"{word}"' for word in program)
    lines = [f'add_test("{name}" {command} "--gtest_filter={which}" --gtest_also_run_disabled_tests)' for name, which in entries]
    lines.append(f"set(palpate_tests {' '.join(name for name, _ in entries)})")
    lines.append(f"set(palpate_alone {' '.join(lonely)})")
    pathlib.Path(file).write_text("\n".join(lines) + "\n", encoding="utf-8")


main()
