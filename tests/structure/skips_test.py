"""A test that skips for a reason of tests/skips.cmake is skipped; any other skip, and a disabled test, fails the run.

    skips_test.py ROOT CTEST TESTS      TESTS: what ctest reads of the program of skip_test.cpp
"""
import os
import pathlib
import subprocess
import sys
import tempfile

ROOT, CTEST, TESTS = pathlib.Path(sys.argv[1]).resolve(), sys.argv[2], sys.argv[3]
REASON = "no test volumes in /data"
# As gtest writes it.
SKIP = "/tests/some_test.cpp:12: Skipped\n{}\n\n[  SKIPPED ] Some.Test (0 ms)\n[  PASSED  ] 0 tests.\n[  SKIPPED ] 1 test, listed below:\n"


def run(folder, reason=None, fail=False):
    """What ctest makes of the one entry in `folder`, and whether the run has failed."""
    environment = os.environ | ({"PALPATE_SKIP_REASON": reason} if reason else {}) | ({"PALPATE_FAIL": "1"} if fail else {})
    done = subprocess.run([CTEST], cwd=folder, env=environment, capture_output=True, text=True)
    words = [w for w in ("Passed", "Skipped", "Disabled", "Failed") if f"{w} " in done.stdout or f"({w})" in done.stdout]
    return words[0] if words else done.stdout + done.stderr, done.returncode != 0


def built(reason, fail=False):
    """The same of a suite as the build registers it: one of its tests skips for `reason`, another fails."""
    with tempfile.TemporaryDirectory() as folder:
        (pathlib.Path(folder) / "CTestTestfile.cmake").write_text(f'include("{TESTS}")\n', encoding="utf-8")
        return run(folder, reason, fail)


def fate(said, data_is_there, status=0, disabled=False):
    """The same of a test that writes `said`."""
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / "said").write_text(said, encoding="utf-8")
        (folder / "CTestTestfile.cmake").write_text(
            f'add_test(Some.Test "/bin/sh" "-c" "cat {folder}/said; exit {status}")\n'
            f"set_tests_properties(Some.Test PROPERTIES DISABLED {'TRUE' if disabled else 'FALSE'})\n"
            f"set(palpate_tests Some.Test)\nset(palpate_viewer ON)\n"
            f"set(palpate_data {folder if data_is_there else folder / 'none'})\n"
            f'include("{ROOT}/tests/skips.cmake")\n', encoding="utf-8")
        return run(folder)


CASES = [
    ("a listed skip", fate(SKIP.format(REASON), False), ("Skipped", False)),
    ("the same where its reason does not hold", fate(SKIP.format(REASON), True), ("Failed", True)),
    ("an unlisted skip", fate(SKIP.format("needs Xvfb (package xvfb)"), False), ("Failed", True)),
    ("a viewer that is built and not there", fate(SKIP.format("there is no palpate-view"), False), ("Failed", True)),
    ("a skip without words", fate("[  SKIPPED ] Some.Test (0 ms)\n", False), ("Failed", True)),
    ("an unlisted skip of a program of ours", built("needs Xvfb (package xvfb)"), ("Failed", True)),
    ("a listed skip of a program of ours", built("there is no kernel for the virtual machine and none could be downloaded"),
     ("Skipped", False)),
    ("the same beside a test that fails", built("there is no kernel for the virtual machine and none could be downloaded", True),
     ("Failed", True)),
    ("a program of ours that passes", built(None), ("Passed", False)),
    ("a program of ours that fails", built(None, True), ("Failed", True)),
    ("a test that passes", fate("[  PASSED  ] 1 test.\n", False), ("Passed", False)),
    ("a test that fails", fate("[  FAILED  ] 1 test.\n", False, status=1), ("Failed", True)),
    ("a disabled test that fails", fate("[  FAILED  ] 1 test.\n", False, status=1, disabled=True), ("Failed", True)),
]
wrong = [f"{what}: {found}, not {expected}" for what, found, expected in CASES if found != expected]
print("\n".join(wrong) if wrong else f"{len(CASES)} tests fared as they should")
sys.exit(1 if wrong else 0)
