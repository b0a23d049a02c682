"""Every command on every page names what there is and runs, or it is marked why not; every picture is in the gallery.

    PALPATE_BIN=build/dev/bin commands_test.py
"""

import importlib.machinery
import importlib.util
import os
import pathlib
import re
import subprocess
import tempfile
import tomllib
import unittest

from commands import ROOT, Checker, commands_of, documents

BIN = pathlib.Path(os.environ["PALPATE_BIN"])
PYTHON = os.environ.get("PYTHONPATH")


def module(path):
    loader = importlib.machinery.SourceFileLoader("check_pages", str(path))
    found = importlib.util.module_from_spec(importlib.util.spec_from_loader("check_pages", loader))
    loader.exec_module(found)
    return found


runner = module(ROOT / "scripts/check-pages")


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


class Pages(unittest.TestCase):
    """What scripts/check-pages runs, and that it fails where a command does. It runs each page in a test of ctest's."""

    def test_every_mark_names_a_command_of_its_page_and_says_why(self):
        marks = tomllib.loads(runner.MARKS.read_text(encoding="utf-8"))
        texts = {page.name: page.read_text(encoding="utf-8") for page in documents()}
        for page, own in marks.items():
            keys = {key for _, key, _ in runner.steps(texts[page])}
            self.assertEqual(set(own) - {"before"} - keys, set(), page)
            for command, mark in own.items():
                if command != "before":
                    self.assertRegex(mark, r"^(as|full|full as|build|window|device|root|network|data|cluster): \S", f"{page}: {command}")

    def test_most_commands_run(self):
        marks = tomllib.loads(runner.MARKS.read_text(encoding="utf-8"))
        kinds = []
        for page in documents():
            own = marks.get(page.name, {})
            kinds += [own.get(key, "as").partition(":")[0] for _, key, _ in runner.steps(page.read_text(encoding="utf-8"))]
        run, never = kinds.count("as"), [kind for kind in kinds if kind not in ("as", "full", "full as")]
        self.assertGreater(run, 2 * len(kinds) / 5)
        self.assertLess(len(never), len(kinds) / 3)

    def outcome(self, page):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "page.md"
            file.write_text(page, encoding="utf-8")
            return subprocess.run([ROOT / "scripts/check-pages", "--build", BIN.parent, file], capture_output=True, text=True)

    def test_a_command_that_fails_fails_its_page_by_file_and_line(self):
        done = self.outcome("One:\n\n    palpate version\n    palpate info nosuch.vdb\n    palpate version | grep palpate\n")
        self.assertEqual(done.returncode, 1)
        self.assertIn("page.md:4: status 1: palpate info nosuch.vdb", done.stderr)
        self.assertIn("3 commands of 1 pages ran, 1 failed", done.stdout)

    def test_commands_have_the_files_of_those_before_and_loops_are_one(self):
        done = self.outcome("This is `n.txt`:\n\n```csv\n1\n2\n```\n\n    for n in $(cat n.txt); do\n    palpate phantom block --voxel $((2 + n)) "
                            "-o $n.vdb   # each\n    done\n\nthen\n\n    palpate info \\\n        2.vdb\n\n    a table    1\n\n    palpate info 1.vdb | grep -q skin && false\n")
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn("3 commands of 1 pages ran, 1 failed", done.stdout)
        self.assertIn("page.md:19: status 1", done.stderr)

    @unittest.skipUnless(PYTHON, "built without Python")
    def test_the_developers_python_runs(self):
        page = (ROOT / "docs/tutorial-developer.md").read_text(encoding="utf-8")
        code = re.search(r"^```python\n(.*?)^```", page, re.S | re.M)[1]
        done = subprocess.run(["/usr/bin/python3", "-B", "-c", code], capture_output=True, text=True)
        self.assertRegex(done.stdout, r"^0\.\d+ N\n$", done.stderr)


class Gallery(unittest.TestCase):
    def test_every_picture_is_there_with_how_it_is_made(self):
        page = (ROOT / "docs/gallery.md").read_text(encoding="utf-8")
        rows = dict(re.findall(r"^\| !\[[^\]]+\]\(pictures/([\w.-]+)\) \| (.+) \|$", page, re.M))
        self.assertEqual(set(rows), {p.name for p in (ROOT / "docs/pictures").iterdir()})


if __name__ == "__main__":
    unittest.main()
