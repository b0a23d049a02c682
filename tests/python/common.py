"""What the tests share: a small body that is quick to press, and the program of the same build."""

import functools
import json
import os
import pathlib
import subprocess
import tempfile
import unittest

import numpy as np

import palpate

PROGRAM = pathlib.Path(os.environ["PALPATE_BIN"]) / "palpate"
SOURCE = pathlib.Path(os.environ["PALPATE_SOURCE"])


@functools.lru_cache(maxsize=None)
def small_block(level="elastic"):
    """The model of a block of fat, 60 x 60 x 36 mm, pressed by a ball."""
    keys = {
        "volume.voxel_mm": 3, "volume.parameters.width_mm": 60, "volume.parameters.thickness_mm": 36,
        "volume.parameters.tumour_centre_mm": 18, "volume.parameters.tumour_diameter_mm": 14, "target.aim_mm.y": 18,
        "model.level": level,
    }
    if level == "elastic":
        keys["model.setting"] = "fast"
    return palpate.Model(palpate.Scene("block").changed(keys))


def wander(count, seed=1):
    """Poses of a ball that presses the block here and there: count x 3."""
    random = np.random.default_rng(seed)
    t = np.arange(count) * 1e-3
    phase = random.uniform(0, 6.28, 3)
    x, z = (8e-3 * np.sin(2 * t * (1 + i) + phase[i]) for i in range(2))
    y = -0.0105 + 5e-3 * np.clip(t - 0.6, 0, 1) * (1 + np.sin(5 * t + phase[2])) / 2
    return np.stack([x, y, z], axis=1)


def program(*arguments):
    """Runs palpate and gives what it said on standard output; fails with what it said on the other."""
    done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True)
    if done.returncode != 0:
        raise AssertionError(f"palpate {' '.join(map(str, arguments))}: {done.returncode}: {done.stderr}")
    return done.stdout


def figures(*arguments):
    return json.loads(program(*arguments, "--json", "-"))


class InFolder(unittest.TestCase):
    """A folder of its own for each test."""

    def setUp(self):
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        self.folder = pathlib.Path(place.name)
