#!/usr/bin/python3 -B
"""Every line of the lists of slow tests is of a test of ctest's programs: slow_test.py SOURCES BUILD CTEST [FOLDER...]

Tests of a FOLDER are not in this build.

A line of tests/slow.txt also says what else sees what the test would find.
"""

import json
import pathlib
import re
import subprocess
import sys

MOST_GROUPS = 6  # CMake's regular expressions have nine, of which .ci/run needs some; ctest ignores one with more, without a message

sources, build, ctest, *left_out = sys.argv[1:]
listed = subprocess.run([ctest, "--test-dir", build, "--show-only=json-v1"], capture_output=True, text=True, check=True).stdout
names, programs = [], {}
for entry in json.loads(listed)["tests"]:
    command = entry.get("command", ["none"])
    names.append(entry["name"])
    if any(word.startswith("--gtest_filter=") for word in command):
        programs.setdefault(tuple(command[:-2]), entry["name"].partition(".")[0])
# An entry is a suite, or a test that a list names in this build.
for program, prefix in programs.items():
    suite = ""
    for line in subprocess.run([*program, "--gtest_list_tests"], capture_output=True, text=True, check=True).stdout.splitlines():
        name = line.partition("#")[0].rstrip()
        if name.startswith("  "):
            names.append(f"{prefix}.{suite}{name.strip()}")
        elif name.endswith("."):
            suite = name
faults = []
patterns = 0
for name, is_explained in (("tests/slow.txt", True), ("tests/slow_asan.txt", False)):
    text = (pathlib.Path(sources) / name).read_text(encoding="utf-8")
    groups = 0
    for number, line in enumerate(text.splitlines(), 1):
        pattern, _, neighbour = (part.strip() for part in line.partition("#"))
        if not pattern:
            continue
        patterns += 1
        groups += len(re.findall(r"(?<!\\)\(", pattern))
        found = [test for test in set(names) if re.match(pattern, test)]
        if not found and pattern.partition("\\.")[0] not in left_out:
            faults.append(f"{name}:{number}: there is no test {pattern}")
        if is_explained and not neighbour:
            faults.append(f"{name}:{number}: which shorter test finds what this would find?")
        if len(found) > 20:
            faults.append(f"{name}:{number}: {len(found)} tests begin so: name those that are slow")
    if groups > MOST_GROUPS:
        faults.append(f"{name}: {groups} groups in parentheses, at most {MOST_GROUPS}: write some of them as lines of their own")
print("\n".join(faults) or f"{patterns} lines, each of tests that are there")
sys.exit(1 if faults or not patterns else 0)
