"""The site builds without a warning, needs no network, and a link that leads nowhere fails it.

    site_test.py FOLDER
"""

import importlib.machinery
import importlib.util
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
FOLDER = pathlib.Path(sys.argv.pop(1))


def site_module():
    loader = importlib.machinery.SourceFileLoader("site_script", str(ROOT / "scripts/site"))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("site_script", loader))
    loader.exec_module(module)
    return module


class Site(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        done = subprocess.run([sys.executable, ROOT / "scripts/site", FOLDER], capture_output=True, text=True)
        if done.returncode != 0:
            raise AssertionError(done.stdout + done.stderr)

    def test_every_page_of_the_documents_is_in_the_navigation(self):
        navigation = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
        for page in (ROOT / "docs").glob("*.md"):
            self.assertRegex(navigation, rf": {re.escape(page.name)}\n", page.name)
            self.assertTrue((FOLDER / page.with_suffix(".html").name).is_file(), page.name)

    def test_nothing_comes_from_elsewhere(self):
        for page in FOLDER.glob("*.html"):
            text = page.read_text(encoding="utf-8")
            self.assertEqual(re.findall(r"<(?:script|img|iframe)[^>]+src=\"https?:[^\"]+|<link[^>]+stylesheet[^>]+https?:[^>]+", text), [], page)

    def test_references_and_search_hold_our_names(self):
        self.assertIn("palpate.Session", (FOLDER / "python-reference.html").read_text(encoding="utf-8"))
        self.assertIn("SessionModel", "".join(p.name for p in (FOLDER / "cpp").glob("*SessionModel*.html")))
        self.assertIn("tutorial-researcher.html", (FOLDER / "search/search_index.json").read_text(encoding="utf-8"))

    def test_a_link_that_leads_nowhere_is_an_error(self):
        site = site_module()
        for link, said in [("nosuch.html", "is not there"), ("a.html#nosuch", "there is no place")]:
            with tempfile.TemporaryDirectory() as folder, self.assertRaises(SystemExit) as ended:
                (pathlib.Path(folder) / "a.html").write_text(f'<p id="here"><a href="a.html#here"></a><a href="{link}"></a>')
                site.check_links(pathlib.Path(folder))
            self.assertIn(said, str(ended.exception))


if __name__ == "__main__":
    unittest.main()
