"""The page on Python has every field, and stubs and module say the same."""

import ast
import re
import subprocess
import sys
import unittest

import palpate
from common import SOURCE
from palpate import _palpate


class Fields(unittest.TestCase):
    def test_the_table_of_fields_is_whole(self):
        text = (SOURCE / "docs" / "python.md").read_text(encoding="utf-8")
        table = text[text.index("| field |"):text.index("`session.events` has")]
        named = set(re.findall(r"`(\w+)`", "".join(line.split("|")[1] for line in table.splitlines() if "|" in line)))
        fields = set(palpate.Session("block").run([[0, -0.1, 0]]).dtype.names)
        self.assertEqual(named & fields, fields)


class Stubs(unittest.TestCase):
    def test_stub_and_module_have_the_same_names(self):
        stub = ast.parse((SOURCE / "python" / "palpate" / "_palpate.pyi").read_text(encoding="utf-8"))
        for node in stub.body:
            if isinstance(node, ast.ClassDef):
                theirs = {n.name for n in node.body if isinstance(n, ast.FunctionDef)}
                ours = {n for n in vars(getattr(_palpate, node.name)) if not n.startswith("_")}
                self.assertEqual(ours, {n for n in theirs if not n.startswith("_")}, node.name)
        functions = {n.name for n in stub.body if isinstance(n, ast.FunctionDef)}
        self.assertEqual(functions, {n for n, f in vars(_palpate).items() if callable(f) and not isinstance(f, type)})

    def test_help_is_the_stub_s(self):
        self.assertIn("n x 3, n x 6 [m], or n x 12", palpate.Session.run.__doc__)
        self.assertTrue(palpate.Session.run.__doc__.startswith("run(poses: ArrayLike"))
        self.assertIn("Young's modulus [Pa]", palpate.Volume.stiffness.__doc__)
        self.assertIn("The array is copied", palpate.Volume.from_numpy.__doc__)
        self.assertIn("Immutable", palpate.Volume.__doc__)

    def test_everything_public_is_explained(self):
        for name in palpate.__all__:
            thing = getattr(palpate, name)
            if callable(thing) and name not in ("phantoms", "scenes"):
                self.assertGreater(len((thing.__doc__ or "").split()), 4, name)


class Package(unittest.TestCase):
    def test_environments_are_there_when_they_are_asked_for(self):
        code = """
import sys, palpate
assert "palpate.envs" not in sys.modules
assert "envs" in dir(palpate)
print(palpate.envs.Biopsy.__name__, hasattr(palpate, "nothing"))
"""
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        self.assertEqual((done.stdout, done.stderr), ("Biopsy False\n", ""))


if __name__ == "__main__":
    unittest.main()
