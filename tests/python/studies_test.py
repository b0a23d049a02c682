import json
import pathlib
import re
import signal
import subprocess
import sys
import time
import unittest
import unittest.mock

import numpy as np
import pandas

import palpate
from common import InFolder, figures, program

SMALL = {
    "volume.voxel_mm": 3, "volume.parameters.width_mm": 60, "volume.parameters.thickness_mm": 36,
    "volume.parameters.tumour_centre_mm": 18, "volume.parameters.tumour_diameter_mm": 14, "target.aim_mm.y": 18,
    "model.setting": "fast",
}


def sweep(folder, cases, **options):
    return palpate.sweep("block", cases, folder=folder, jobs=2, procedure={"kind": "press", "depth_mm": 3}, set=SMALL,
                         outputs=["force_n"], **options)


def as_another_build(file):
    """The file of a case, as if another build had written it."""
    text = re.sub('"build":"[^"]*"', '"build":"palpate 0.0"', file.read_text().strip())
    checked = 0xcbf29ce484222325  # FNV-1a of what is without its checksum
    for byte in re.sub('"checksum":"[^"]*",', "", text).encode():
        checked = (checked ^ byte) * 0x100000001b3 % 2**64
    file.write_text(re.sub('"checksum":"[^"]*"', f'"checksum":"{checked:016x}"', text))


class Sweeps(InFolder):
    cases = pandas.DataFrame({"tissue.fat.youngs_kpa": [2.0, 4.0, 8.0], "procedure.speed_mm_s": [20, 20, 10]})

    def test_a_table_of_cases_gives_a_table_of_results(self):
        told = []
        result = sweep(self.folder / "s", self.cases, progress=lambda done, of: told.append((done, of)))
        frame = result.to_dataframe()
        self.assertEqual(frame["tissue_fat_youngs_kpa"].tolist(), [2, 4, 8])
        self.assertEqual(frame["procedure_speed_mm_s"].tolist(), [20, 20, 10])
        self.assertTrue(np.all(np.diff(frame["force_n"]) > 0))
        self.assertEqual(result.failed, [])
        self.assertTrue(all(of == 3 for _, of in told))

    def test_rows_are_those_of_a_session_by_hand(self):
        result = sweep(self.folder / "s", [{"tissue.fat.youngs_kpa": 4.0}])
        model = palpate.Model(palpate.Scene("block").changed({**SMALL, "tissue.fat.youngs_kpa": 4.0}))
        radius = 1e-3 * model.scene.to_dict()["tool"]["radius_mm"]
        ticks = palpate.Session(model).run(palpate.press_path([0, -radius, 0], [0, 1, 0], 3e-3, speed=0.02, hold=0.1))
        deepest = np.argmax(ticks["position"][:, 1])
        # The procedure's own way begins elsewhere and holds the same depth.
        self.assertAlmostEqual(-ticks["tissue_force"][deepest + 90, 1] / result["force_n"][0], 1, delta=0.05)

    def test_the_program_gives_the_same_table_of_the_same_plan(self):
        ours = sweep(self.folder / "s", self.cases).to_dataframe()
        program("sweep", self.folder / "s" / "plan.toml", "-o", self.folder / "t", "--jobs", 1)
        theirs = palpate.SweepResult(self.folder / "t").to_dataframe()
        timing = ["machine", "tick_us", "case_s"]
        pandas.testing.assert_frame_equal(ours.drop(columns=timing), theirs.drop(columns=timing))

    def test_the_same_call_goes_on_and_other_cases_are_refused(self):
        first = sweep(self.folder / "s", self.cases)
        again = sweep(self.folder / "s", self.cases)
        self.assertEqual(first.rows, again.rows)
        with self.assertRaisesRegex(palpate.Error, "other cases"):
            sweep(self.folder / "s", self.cases[:2])

    def test_wrong_keys_are_known_before_a_case_runs(self):
        with self.assertRaisesRegex(palpate.Error, "cheese"):
            sweep(self.folder / "s", [{"tissue.cheese.youngs_kpa": 4.0}])
        with self.assertRaisesRegex(palpate.Error, "other keys"):
            sweep(self.folder / "t", [{"a": 1}, {"b": 1}])
        with self.assertRaisesRegex(TypeError, "a list with a dictionary for each case"):  # columns, as pandas takes them
            sweep(self.folder / "t", {"tissue.fat.youngs_kpa": [2.0, 4.0]})
        with self.assertRaisesRegex(palpate.Error, "no cases"):
            sweep(self.folder / "u", [])

    def test_arguments_that_are_none_are_said_by_name(self):
        for wrong, keys in (("sweep: procedure: give one of .*press", {"procedure": None}), ("has no argument 'output'", {"output": "force_n"}),
                            ("has no argument 'repeat'.* repeats", {"repeat": 2}), ("sweep: outputs: give .* list .*not 3", {"outputs": 3})):
            with self.subTest(wrong), self.assertRaisesRegex(TypeError, wrong):
                palpate.sweep("block", [{"tissue.fat.youngs_kpa": 4.0}], **keys)

    def test_a_wrong_plan_names_no_file_that_is_gone(self):
        for keys in ({"outputs": ["nothing"]}, {"procedure": {"kind": "press", "deep_mm": 3}}, {"procedure": "none"}, {"repeats": 0},
                     {"reference": {"tissue.nope.youngs_kpa": 1}}):
            with self.subTest(keys), self.assertRaises(palpate.Error) as caught:
                palpate.sweep("block", [{"tissue.fat.youngs_kpa": 4.0}], **keys)
            self.assertNotRegex(str(caught.exception), r"\.toml|\n|/")

    def test_one_output_is_a_word(self):
        from palpate._sweep import plan_of
        cases = [{"tissue.fat.youngs_kpa": 4.0}]
        self.assertEqual(plan_of("block", cases, outputs="force_n"), plan_of("block", cases, outputs=["force_n"]))

    def test_a_number_of_processes_that_is_none_is_refused_before_anything_begins(self):
        for wrong in (2.5, "2"):
            with self.subTest(wrong), self.assertRaisesRegex(TypeError, "jobs: give a whole number"):
                palpate.sweep("block", self.cases, folder=self.folder / "s", jobs=wrong)
        with self.assertRaisesRegex(ValueError, "jobs: give 1 or more"):
            palpate.sweep("block", self.cases, folder=self.folder / "s", jobs=0)
        self.assertFalse((self.folder / "s").exists())

    def test_cases_of_another_build_are_taken_where_that_is_asked_for(self):
        place = self.folder / "s"
        sweep(place, self.cases)
        (place / "cases" / "000" / "0.json").unlink()
        for number in (1, 2):
            file = place / "cases" / "000" / f"{number}.json"
            as_another_build(file)
        with self.assertRaisesRegex(palpate.Error, "give any_build=True"):
            sweep(place, self.cases)
        self.assertEqual(len(sweep(place, self.cases, any_build=True)), 3)
        with self.assertRaisesRegex(palpate.Error, "give any_build=True"):
            palpate.merge(self.folder / "all", [place])
        merged = palpate.merge(self.folder / "all", [place], any_build=True)
        self.assertEqual(merged["force_n"], palpate.SweepResult(place)["force_n"])
        with self.assertRaisesRegex(palpate.Error, "give their folders$"):
            palpate.merge(self.folder / "none")

    def test_an_interrupt_keeps_what_is_done(self):
        script = self.folder / "long.py"
        script.write_text(
            "import palpate\n"
            f"palpate.sweep('block', [{{'tissue.fat.youngs_kpa': 2 + i / 100}} for i in range(400)], folder={str(self.folder / 's')!r},\n"
            f"    jobs=1, procedure={{'kind': 'press', 'depth_mm': 3}}, set={SMALL!r}, outputs=['force_n'],\n"
            "    progress=lambda done, of: print(done, flush=True))\n")
        process = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for line in process.stdout:
            if int(line) >= 2:
                break
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=120)
        self.assertIn("KeyboardInterrupt", errors)
        done = len(palpate.SweepResult(self.folder / "s"))
        self.assertTrue(2 <= done < 400, done)

    def test_a_word_of_an_axis_stays_as_it_is(self):
        words = ["1_000", "007", "nan", "infinity", "inf", "-inf", " 1", "+1", "1.", ".5", "1e5", "٣", "true"]
        numbers = {"0": 0, "-12": -12, "0.5": 0.5, "-1.25e-07": -1.25e-07, "1e+20": 1e20, "9007199254740993": 9007199254740993}
        (self.folder / "table.csv").write_text(
            "word,error\n" + "".join(f"{word},\n" for word in [*words, *numbers, ""]), encoding="utf-8")
        read = palpate.SweepResult(self.folder)["word"]
        self.assertEqual(read, [*words, *numbers.values(), None])
        self.assertEqual([type(v) for v in read[len(words):-1]], [type(v) for v in numbers.values()])

    def test_a_sweep_runs_nothing_that_lies_in_the_folder(self):
        (self.folder / "json.py").write_text("print('not this')")
        code = f"""
import sys
sys.path.remove("")
import palpate
from studies_test import sweep
print(len(sweep({str(self.folder / "s")!r}, [{{"tissue.fat.youngs_kpa": 4.0}}])))
"""
        done = subprocess.run([sys.executable, "-B", "-c", code], cwd=self.folder, capture_output=True, text=True)
        self.assertEqual((done.stdout, done.returncode), ("1\n", 0), done.stderr)

    def test_what_is_no_report_of_the_cases_is_an_error(self):
        (self.folder / "json.py").write_text("print('not this')")
        with unittest.mock.patch.dict("os.environ", PYTHONPATH=str(self.folder)), self.assertRaisesRegex(palpate.Error, "'not this'"):
            sweep(self.folder / "s", [{"tissue.fat.youngs_kpa": 4.0}])

    def test_outputs_are_listed(self):
        self.assertIn("force_n", palpate.sweep_outputs()["press"])


class Plans(InFolder):
    def test_ctrl_c_ends_a_plan(self):
        code = """
import signal, sys, threading, palpate
threading.Timer(1, signal.raise_signal, [signal.SIGINT]).start()
try:
    palpate.plan("block", error=0.001)
except KeyboardInterrupt:
    sys.exit(7)
"""
        done = subprocess.run([sys.executable, "-B", "-c", code], capture_output=True, text=True, timeout=300)
        self.assertEqual((done.returncode, done.stderr), (7, ""))

    def test_a_plan_is_that_of_the_program(self):
        smaller = {"width_mm": 27, "thickness_mm": 18, "tumour_centre_mm": 9, "tumour_diameter_mm": 6}
        keys = SMALL | {f"volume.parameters.{key}": value for key, value in smaller.items()} | {
            "target.aim_mm.y": 9, "tool.radius_mm": 6}
        del keys["model.setting"]
        scene = palpate.Scene("block").changed(keys)
        ours = palpate.plan(scene, error=0.25, budget=1e-3)
        self.assertTrue(ours["found"])
        self.assertLessEqual(ours["predicted_error_pct"], 25)
        self.assertLessEqual(ours["predicted_us"], 1000)
        self.assertGreater(len(ours["candidates"]), 3)
        for wrong in ({"error": 0}, {"error": 3}, {"budget": -1}, {"speed": float("nan")}, {"speed": 1e-9}):
            with self.subTest(wrong), self.assertRaises(ValueError):
                palpate.plan(scene, **wrong)
        with self.assertRaisesRegex(palpate.Error, "^budget: 1 us: "):
            palpate.plan(scene, budget=1e-6)
        with self.assertRaisesRegex(palpate.Error, "none.json: .*palpate bench costs"):
            palpate.plan(scene, costs="none.json")
        slow = {"slot_ns": 20, "slot_cycle_ns": 90, "contact_ns": 600, "contact_cycle_ns": 1500}
        file = self.folder / "costs.json"
        file.write_text(json.dumps({"small": slow, "finite": slow}))
        dear = palpate.plan(scene, error=0.25, budget=1e-3, costs=file)
        self.assertEqual(dear["costs"], str(file))
        self.assertEqual(ours["costs"], "built in")
        times = [{(c["level"], c["spacing_mm"], *c["windows"], c["sweeps"], c["strain"]): c["predicted_us"] for c in plan["candidates"]
                  if c["level"] == "elastic"} for plan in (ours, dear)]
        self.assertEqual(times[0].keys(), times[1].keys())
        self.assertTrue(all(times[1][c] > times[0][c] for c in times[0]))


class Accuracy(InFolder):
    def test_figures_of_the_command_are_read(self):
        file = self.folder / "a.json"
        file.write_text(json.dumps({"verification": [{"problem": "p", "error_pct": 1.0}], "chart": []}))
        self.assertEqual(palpate.accuracy(file)["verification"][0]["error_pct"], 1.0)
        file.write_text("{}")
        with self.assertRaisesRegex(palpate.Error, "no figures"):
            palpate.accuracy(file)
        file.write_text("x")
        with self.assertRaisesRegex(palpate.Error, "no JSON"):
            palpate.accuracy(file)

    def test_a_program_that_is_another_is_named(self):
        other = self.folder / "other"
        for says, error in (("{}", "other accuracy: has no figures"), ("x", "other accuracy: is no JSON")):
            other.write_text(f"#!/bin/sh\necho '{says}'\n")
            other.chmod(0o755)
            with self.subTest(says), self.assertRaisesRegex(palpate.Error, error):
                palpate.accuracy(command=other)

    def test_what_is_not_there_is_an_error_of_palpate(self):
        with self.assertRaisesRegex(palpate.Error, "^/none: .*command="):
            palpate.accuracy(command="/none")
        with self.assertRaisesRegex(palpate.Error, "^/none.json: "):
            palpate.accuracy("/none.json")
        with self.assertRaisesRegex(palpate.Error, "^/none/table.csv: "):
            palpate.SweepResult("/none")


if __name__ == "__main__":
    unittest.main()
