"""What is wrong with the arguments of a call is said on one line that names the argument."""

import ast
import inspect
import unittest

import numpy as np

import palpate
from common import SOURCE, InFolder, small_block
from palpate import _palpate

LABELS = np.zeros((12, 12, 12), np.uint8)
LABELS[4:-4, 4:-4, 4:-4] = 1
AFFINE = np.diag([1e-3, 1e-3, 1e-3, 1])


def bound():
    """(name, callable) of every function and method of the C++ side that the stub explains."""
    for node in ast.parse((SOURCE / "python" / "palpate" / "_palpate.pyi").read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef):
            yield node.name, getattr(_palpate, node.name)
        elif isinstance(node, ast.ClassDef):
            for one in node.body:
                if isinstance(one, ast.FunctionDef) and not any(getattr(d, "id", "") == "property" for d in one.decorator_list):
                    yield f"{node.name}.{one.name}", getattr(getattr(_palpate, node.name), one.name)


class Refusals(InFolder):
    def check(self, wrong, call):
        with self.subTest(wrong), self.assertRaises(TypeError) as caught:
            call()
        self.assertEqual(str(caught.exception), wrong)

    def test_unknown_missing_and_too_many_arguments_are_named(self):
        s, v = palpate.Session(small_block()), palpate.Volume.from_numpy(LABELS, AFFINE, {1: "fat"})
        for wrong, call in {
            "Session() needs the argument scene: it has scene, record, operator": lambda: palpate.Session(),
            "Session() has no argument 'rekord': it has scene, record, operator": lambda: palpate.Session("block", rekord="x"),
            "step() needs the argument pose: it has pose, buttons, fresh": lambda: s.step(),
            "step() has no argument 'foo': it has pose, buttons, fresh": lambda: s.step([0, 0, 0], foo=1),
            "step() takes 3 arguments (pose, buttons, fresh) by position, not 4": lambda: s.step([0, 0, 0], 1, True, 4),
            "step() has the argument pose twice: give it by position or by name": lambda: s.step([0, 0, 0], pose=1),
            "close() takes no arguments by position, not 1": lambda: s.close(1),
            "ultrasound() takes 2 arguments (width, height) by position, not 3: give face, direction, lateral, depth by name":
                lambda: s.ultrasound(64, 64, [0, 0, 0]),
            "save() takes 1 argument (file) by position, not 2": lambda: v.save("a.vdb", 3),
            "scenes() has no argument 'x': it has none": lambda: palpate.scenes(x=1),
        }.items():
            self.check(wrong, call)

    def test_arguments_of_another_type_are_named_with_what_they_have_to_be(self):
        s, v, scene = palpate.Session(small_block()), palpate.Volume.from_numpy(LABELS, AFFINE, {1: "fat"}), palpate.Scene("block")
        of = "give a built-in scene's name, a file, or an object of palpate"
        for wrong, call in {
            "trainee: give a word (str), not 3 (int)": lambda: s.perform(3),
            "seconds: give a number, not 'x' (str)": lambda: s.perform(seconds="x"),
            "keys: give a dict, not None": lambda: scene.changed(None),
            "keys: give a dict, not [] (list)": lambda: scene.changed([]),
            "keys: give a dict, not a value of type ndarray": lambda: scene.changed(LABELS),
            "text: give a word (str) without half a character (surrogate), not a value of type str":
                lambda: palpate.Scene.parse("\ud800" + 60 * "x"),
            "file: give the name of a file, not None": lambda: palpate.Volume.open(None),
            "file: give the name of a file, not 3 (int)": lambda: v.save(3),
            "file: give the name of a file without NUL or half a character, not 'a\\x00b' (str)":
                lambda: palpate.Volume.open("a\0b"),
            "self: give an object of palpate.Volume, not 3 (int)": lambda: palpate.Volume.save(3, "x.vdb"),
            "tissues: give a dict, not None": lambda: palpate.Volume.from_numpy(LABELS, AFFINE, None),
            "tissues: give a dict, not ['fat'] (list)": lambda: palpate.Volume.from_numpy(LABELS, AFFINE, ["fat"]),
            "set: give a dict, not 3 (int)": lambda: palpate.Volume.import_("x", set=3),
            "body_from_image: give True or False, not '3' (str)": lambda: palpate.Volume.import_("x", body_from_image="3"),
            "voxel: give a number below 1.8e308, not a value of type int": lambda: palpate.Volume.phantom(voxel=10**400),
            "width: give a whole number, not 'a' (str)": lambda: s.ultrasound("a"),
            "height: give a whole number, not 64.5 (float)": lambda: s.ultrasound(64, 64.5),
            "width: give a whole number below 2**31, not 2147483648 (int)": lambda: s.ultrasound(2**31),
            "error: give a number, not 'x' (str)": lambda: palpate.plan("block", error="x"),
            "costs: give the name of a file or None, not 3 (int)": lambda: palpate.plan("block", costs=3),
            f"scene: {of}, not None": lambda: palpate.Model(None),
            f"scene: {of}, not 3 (int)": lambda: palpate.envs.Biopsy(3),
            f"source: {of}, not 3 (int)": lambda: palpate.Scene(3),
            f"volume: {of}, not None": lambda: palpate.Scene.for_volume(None),
            "file: give a file, not 3 (int)": lambda: palpate.Record(3),
            "folder: give the name of a file or a folder, not 3 (int)": lambda: palpate.SweepResult(3),
        }.items():
            self.check(wrong, call)

    def test_every_function_of_the_cpp_side_is_explained(self):
        s, functions = palpate.Session(small_block()), dict(bound())
        self.assertGreater(len(functions), 25)
        for name, function in functions.items():
            kind, _, method = name.partition(".")
            call = getattr(_palpate, kind) if method == "__init__" else function
            with self.subTest(name), self.assertRaisesRegex(TypeError, r"^\w+\(\) (has no argument|takes)[^\n]*$"):
                call(*[s] * 30, **{"no such": 1})

    def test_errors_of_what_is_called_stay_what_they_are(self):
        class Broken:
            def __index__(self):
                raise TypeError("mine:\n    of two lines")

        class Path:
            def __fspath__(self):
                raise TypeError("mine")

        with self.assertRaisesRegex(TypeError, "^mine$"):
            palpate.Model(Path())
        with self.assertRaises(TypeError) as caught:
            palpate.Session(small_block()).ultrasound(Broken())
        self.assertNotIn("\n", str(caught.exception))

    def test_what_is_empty_or_nowhere_is_named(self):
        for error, wrong, call in (
            (ValueError, "^file: is empty: give a .vdb", lambda: palpate.Volume.open("")),
            (ValueError, "^path: is empty: give", lambda: palpate.Volume.import_("")),
            (ValueError, "^source: is empty: give", lambda: palpate.Scene("")),
            (ValueError, "^file: is empty: give", lambda: palpate.Record("")),
            (ValueError, "^labels: no voxel is set: every label is 0, give", lambda: palpate.Volume.from_numpy(0 * LABELS, AFFINE, {1: "fat"})),
            (palpate.Error, "there is no folder /nope: make it first$", lambda: palpate.Session(small_block(), record="/nope/x.db")),
            (palpate.Error, "^key 'tissue.fat.youngs_kpa': .{,90}$",
             lambda: palpate.Scene("block").changed({"tissue.fat.youngs_kpa": 10**400})),
        ):
            with self.subTest(wrong), self.assertRaisesRegex(error, wrong):
                call()
        whole = palpate.Volume.from_numpy(0 * LABELS, AFFINE, {0: "fat"})  # 0 has a tissue
        self.assertGreater(whole.stiffness.min(), 0)


class Signatures(unittest.TestCase):
    def test_inspect_knows_the_arguments_of_all(self):
        for name, function in bound():
            with self.subTest(name):
                inspect.signature(function)
        self.assertEqual(str(inspect.signature(palpate.Session)), "(scene, record=None, operator='')")
        self.assertEqual(str(inspect.signature(palpate.Scene)), "(source=None, **tables)")
        self.assertEqual(str(inspect.signature(palpate.Session.step)), "(self, pose, buttons=1, fresh=True)")
        self.assertEqual(str(inspect.signature(palpate.Session(small_block()).step)), "(pose, buttons=1, fresh=True)")
        self.assertEqual(str(inspect.signature(palpate.Volume.open)), "(file)")

    def test_a_derived_class_has_its_own_signature(self):
        class Named(palpate.Scene):
            def __init__(self, tag):
                super().__init__("block")

        class Plain(palpate.Scene):
            pass

        self.assertEqual(str(inspect.signature(Named)), "(tag)")
        self.assertEqual(str(inspect.signature(Plain)), "(source=None, **tables)")


if __name__ == "__main__":
    unittest.main()
