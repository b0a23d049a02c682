#!/usr/bin/python3 -B
"""Every line of the lists of slow tests is of a test that ctest has: slow_test.py SOURCES BUILD CTEST

A line of tests/slow.txt also says what else sees what the test would find.
"""

import pathlib
import re
import subprocess
import sys

MOST_GROUPS = 6  # CMake's regular expressions have nine, of which .ci/run needs some; ctest ignores one with more, without a message

sources, build, ctest = sys.argv[1:]
listed = subprocess.run([ctest, "--test-dir", build, "-N"], capture_output=True, text=True, check=True).stdout
names = re.findall(r"^\s*Test\s+#\d+: (\S+)", listed, re.M)
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
        found = [test for test in names if re.match(pattern, test)]
        if not found:
            faults.append(f"{name}:{number}: there is no test {pattern}")
        if is_explained and not neighbour:
            faults.append(f"{name}:{number}: which shorter test finds what this would find?")
        if len(found) > 20:
            faults.append(f"{name}:{number}: {len(found)} tests begin so: name those that are slow")
    if groups > MOST_GROUPS:
        faults.append(f"{name}: {groups} groups in parentheses, at most {MOST_GROUPS}: write some of them as lines of their own")
print("\n".join(faults) or f"{patterns} lines, each of tests that are there")
sys.exit(1 if faults or not patterns else 0)
