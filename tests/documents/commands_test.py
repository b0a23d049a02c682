"""Every command on every page names what there is; those of the tutorials run as they stand; every picture is in the gallery.

    PALPATE_BIN=build/dev/bin commands_test.py
"""

import os
import pathlib
import re
import subprocess
import tempfile
import unittest

from commands import ROOT, Checker, commands_of, documents

BIN = pathlib.Path(os.environ["PALPATE_BIN"])
PYTHON = os.environ.get("PYTHONPATH")
TUTORIALS = ("trainer", "researcher", "experimenter")
# What the tutorials' test does not run, and why. tutorial-developer.md: scripts/check-package builds the examples with CMake and
# with pkg-config, and the rest are the checks that this test is one of; its Python is run.
NOT_RUN = {
    "palpate-view --replay vessel.db": "opens a window: tests/apps/replay_view_test.cpp plays records",
    "palpate plan block --error 3% --budget 2ms --json plan.json": "measures for half a minute: tests/apps/model_command_test.cpp",
}


class Commands(unittest.TestCase):
    def test_every_command_and_option_exists(self):
        checker = Checker(BIN)
        seen, faults = 0, []
        for page in documents():
            for number, words in commands_of(page.read_text(encoding="utf-8")):
                seen += 1
                if fault := checker.fault(words):
                    faults.append(f"{page.relative_to(ROOT)}:{number}: {fault}")
        self.assertEqual(faults, [])
        self.assertGreater(seen, 250)

    def test_the_check_catches_faults(self):
        checker = Checker(BIN)
        for wrong, said in [("    palpate trian", "no command"), ("    palpate train --nosuch", "no option --nosuch"),
                            ("    palpate bench nosuch -o x", "no command"), ("    palpate train --task nosuch", "none of"),
                            ("    for s in 1 2; do palpate train -x; done", "no option -x"),
                            ("    scripts/nosuch", "no scripts/nosuch"), ("    scripts/site --nosuch", "no option"),
                            ("```sh\npalpate info --nosuch\n```", "no option"), ("say `palpate info --nosuch`", "no option"),
                            ("    palpate info \\\n        --nosuch", "no option"), ("    x | palpate info --nosuch > y", "no option")]:
            with self.subTest(wrong):
                self.assertIn(said, "; ".join(checker.fault(words) for _, words in commands_of(wrong + "\n")))
        for right in ["    palpate train --task=find-lump --json - > x  # --nosuch", "```toml\npalpate --nosuch\n```"]:
            self.assertEqual([checker.fault(words) for _, words in commands_of(right + "\n") if checker.fault(words)], [])


class Tutorials(unittest.TestCase):
    def test_every_step_runs_in_order(self):
        for name in TUTORIALS:
            with self.subTest(name), tempfile.TemporaryDirectory() as folder:
                page = (ROOT / "docs" / f"tutorial-{name}.md").read_text(encoding="utf-8")
                self.follow(page, pathlib.Path(folder))

    def follow(self, page, folder):
        for file, text in re.findall(r"this is `([\w.]+)`:\n\n```\w+\n(.*?)```", page, re.S):
            (folder / file).write_text(text, encoding="utf-8")
        environment = {"PATH": f"{BIN}:/usr/bin:/bin", "HOME": str(folder), "LC_ALL": "C.UTF-8", "PYTHONPATH": PYTHON or ""}
        ran = 0
        for line in steps(page):
            if line in NOT_RUN or (line.startswith("#python\n") and not PYTHON):
                continue
            command = ["/usr/bin/python3", "-B", "-c", line] if line.startswith("#python\n") else ["bash", "-c", line]
            done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, f"{line}\n{done.stdout[-1000:]}{done.stderr}")
            ran += 1
        self.assertGreater(ran, 4)

    @unittest.skipUnless(PYTHON, "built without Python")
    def test_the_developers_python_runs(self):
        page = (ROOT / "docs/tutorial-developer.md").read_text(encoding="utf-8")
        code = re.search(r"^```python\n(.*?)^```", page, re.S | re.M)[1]
        done = subprocess.run(["/usr/bin/python3", "-B", "-c", code], capture_output=True, text=True)
        self.assertRegex(done.stdout, r"^0\.\d+ N\n$", done.stderr)


def steps(page):
    """Commands of indented lines and Python blocks, in their order; the latter begin with a line of their own."""
    for line, python in re.findall(r"^    (\S.*)$|^```python\n((?:.*\n)*?)```", page, re.M):
        yield line or "#python\n" + python


class Gallery(unittest.TestCase):
    def test_every_picture_is_there_with_how_it_is_made(self):
        page = (ROOT / "docs/gallery.md").read_text(encoding="utf-8")
        rows = dict(re.findall(r"^\| !\[[^\]]+\]\(pictures/([\w.-]+)\) \| (.+) \|$", page, re.M))
        self.assertEqual(set(rows), {p.name for p in (ROOT / "docs/pictures").iterdir()})


if __name__ == "__main__":
    unittest.main()
