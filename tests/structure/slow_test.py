#!/usr/bin/python3 -B
"""Every line of tests/slow.txt is of a test that ctest has, and says what else sees what it would find: slow_test.py SOURCES BUILD CTEST"""

import pathlib
import re
import subprocess
import sys

sources, build, ctest = sys.argv[1:]
listed = subprocess.run([ctest, "--test-dir", build, "-N"], capture_output=True, text=True, check=True).stdout
names = re.findall(r"^\s*Test\s+#\d+: (\S+)", listed, re.M)
faults = []
patterns = 0
for number, line in enumerate((pathlib.Path(sources) / "tests/slow.txt").read_text(encoding="utf-8").splitlines(), 1):
    pattern, _, neighbour = (part.strip() for part in line.partition("#"))
    if not pattern:
        continue
    patterns += 1
    found = [name for name in names if re.match(pattern, name)]
    if not found:
        faults.append(f"tests/slow.txt:{number}: there is no test {pattern}")
    if not neighbour:
        faults.append(f"tests/slow.txt:{number}: which shorter test finds what this would find?")
    if len(found) > 20:
        faults.append(f"tests/slow.txt:{number}: {len(found)} tests begin so: name those that are slow")
print("\n".join(faults) or f"{patterns} lines, each of tests that are there")
sys.exit(1 if faults or not patterns else 0)
