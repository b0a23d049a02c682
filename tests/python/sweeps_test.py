"""A sweep in parts, whoever runs them, is the sweep."""

import csv
import functools
import pathlib
import shutil
import subprocess
import tempfile
import unittest

import palpate
from common import PROGRAM, SOURCE, InFolder, program

PLAN = """
name = "parts"
scene = "block"
outputs = ["force_n"]
repeats = 2

[[axis]]
key = "tissue.fat.youngs_kpa"
values = [2, 4, 8]

[[axis]]
key = "procedure.speed_mm_s"
values = [10, 20, 40]

[procedure]
kind = "press"
depth_mm = 2

[set]
volume.voxel_mm = 3
volume.parameters.width_mm = 60
volume.parameters.thickness_mm = 36
volume.parameters.tumour_centre_mm = 18
volume.parameters.tumour_diameter_mm = 14
target.aim_mm.y = 18
model.setting = "fast"
"""
CASES = 18
TIMING = {"machine", "tick_us", "case_s"}


def without_timing(file):
    """The table's bytes, but for the columns that differ from run to run."""
    with open(file, newline="", encoding="utf-8") as text:
        rows = list(csv.reader(text))
    keep = [i for i, name in enumerate(rows[0]) if name not in TIMING]
    return [[row[i] for i in keep] for row in rows]


@functools.lru_cache(maxsize=None)
def whole():
    """The table of the uninterrupted run, without timing."""
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / "parts.toml").write_text(PLAN)
        program("sweep", folder / "parts.toml", "-o", folder / "whole", "--jobs", 2)
        return without_timing(folder / "whole" / "table.csv")


def refused(*arguments):
    done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True)
    if done.returncode == 0:
        raise AssertionError(f"{arguments} was not refused")
    return done.stderr


class Shards(InFolder):
    def setUp(self):
        super().setUp()
        self.plan = self.folder / "parts.toml"
        self.plan.write_text(PLAN)

    def test_seven_shards_merged_are_the_uninterrupted_run(self):
        parts = self.folder / "parts"
        for k in (4, 1, 7, 2, 6, 3, 5):
            program("sweep", self.plan, "-o", parts, "--shard", f"{k}/7", "--jobs", 1)
        said = program("sweep", "-o", parts, "--merge")
        self.assertIn(f"{CASES} of {CASES} cases, 0 failed", said)
        self.assertEqual(without_timing(parts / "table.csv"), whole())
        self.assertEqual(len(whole()), 1 + CASES)
        self.assertGreater(len({row[whole()[0].index("force_n")] for row in whole()[1:]}), 3)

    def test_shards_from_elsewhere_and_lists_of_cases_merge_too(self):
        program("sweep", self.plan, "-o", self.folder / "a", "--shard", "1/2", "--jobs", 2)
        program("sweep", self.plan, "-o", self.folder / "b", "--cases", "9-12,14", "--jobs", 2)
        shutil.move(self.folder / "a" / "shards" / "1-of-2", self.folder / "copied")
        all_ = self.folder / "all"
        said = refused("sweep", "-o", all_, "--merge", self.folder / "copied", self.folder / "b" / "shards" / "cases-9-12,14")
        self.assertIn("4 of 18 cases are missing: run them with --cases 13,15-17", said)
        program("sweep", self.plan, "-o", all_, "--cases", "13,15-17", "--jobs", 2)
        program("sweep", "-o", all_, "--merge")
        self.assertEqual(without_timing(all_ / "table.csv"), whole())
        self.assertEqual(len(palpate.merge(all_)), CASES)

    def test_shards_of_another_plan_are_refused(self):
        program("sweep", self.plan, "-o", self.folder / "a", "--cases", "0", "--jobs", 1)
        self.plan.write_text(PLAN.replace("depth_mm = 2", "depth_mm = 3"))
        program("sweep", self.plan, "-o", self.folder / "b", "--cases", "1", "--jobs", 1)
        said = refused("sweep", "-o", self.folder / "a", "--merge", self.folder / "b" / "shards" / "cases-1")
        self.assertIn("another plan", said)

    def test_a_part_of_failed_cases_warns_and_the_merge_is_reached(self):
        parts, alone = self.folder / "parts", self.folder / "alone"
        key = "volume.parameters.tumour_centre_mm"
        text = PLAN.replace("[2, 4, 8]", "[2]").replace("procedure.speed_mm_s", key).replace(f"\n{key} = 18", "")
        self.plan.write_text(text.replace("[10, 20, 40]", "[18, 35]"))  # at 35 mm the lump is not inside the body
        for k in (1, 2):
            done = subprocess.run([PROGRAM, "sweep", self.plan, "-o", parts, "--shard", f"{k}/2", "--jobs", "1"],
                                  capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual("palpate: every case failed: " in done.stderr, k == 2, done.stderr)
        self.assertIn("4 of 4 cases, 2 failed", program("sweep", "-o", parts, "--merge"))
        self.plan.write_text(text.replace("[10, 20, 40]", "[35]"))
        self.assertIn("every case failed", refused("sweep", self.plan, "-o", alone, "--jobs", 1))
        for k in (1, 2):
            program("sweep", self.plan, "-o", parts / "failed", "--shard", f"{k}/2", "--jobs", 1)
        self.assertIn("every case failed", refused("sweep", "-o", parts / "failed", "--merge"))

    def test_wrong_parts_are_refused(self):
        for wrong, arguments in [
            ("part K of N", ["--shard", "0/7"]), ("part K of N", ["--shard", "8/7"]), ("part K of N", ["--shard", "x"]),
            ("0 to 17", ["--cases", "18"]), ("numbers and ranges", ["--cases", "5-"]), ("numbers and ranges", ["--cases", "9-3"]),
        ]:
            with self.subTest(arguments):
                self.assertIn(wrong, refused("sweep", self.plan, "-o", self.folder / "s", *arguments))
        self.assertIn("no shards", refused("sweep", "-o", self.folder / "none", "--merge"))

    def test_more_shards_than_cases_have_all_cases_once(self):
        parts = self.folder / "parts"
        self.plan.write_text(PLAN.replace("[2, 4, 8]", "[2]").replace("[10, 20, 40]", "[20]"))
        for k in range(1, 4):
            program("sweep", self.plan, "-o", parts, "--shard", f"{k}/3", "--jobs", 1)
        program("sweep", "-o", parts, "--merge")
        self.assertEqual([row["case"] for row in palpate.SweepResult(parts).rows], [0, 1])


class Managed(InFolder):
    """A folder with the plan, in which a command is to make the whole table."""

    def setUp(self):
        super().setUp()
        (self.folder / "lump.toml").write_text(PLAN)
        self.environment = {"PATH": f"{PROGRAM.parent}:/usr/bin:/bin", "HOME": str(self.folder), "LC_ALL": "C.UTF-8"}

    def run_here(self, *command):
        done = subprocess.run(command, cwd=self.folder, env=self.environment, capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr + done.stdout)
        self.assertEqual(without_timing(self.folder / "lump" / "table.csv"), whole())


class Managers(Managed):
    """The line of docs/sweeps.md; dask_test.py and snakemake_test.py have the others."""

    def test_gnu_parallel(self):
        text = (SOURCE / "docs" / "sweeps.md").read_text(encoding="utf-8")
        line = next(line.strip() for line in text.splitlines() if line.startswith("    parallel "))
        self.run_here("bash", "-c", line)


if __name__ == "__main__":
    unittest.main()
