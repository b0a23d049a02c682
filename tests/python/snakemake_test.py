"""A sweep in parts by Snakemake is the sweep. scripts/test full runs it: the package snakemake installs half a gigabyte."""

import shutil
import unittest

import sweeps_test
from common import SOURCE


class Snakemake(sweeps_test.Managed):
    def test_the_lines_of_the_page(self):
        shutil.copy(SOURCE / "examples" / "sweeps" / "Snakefile", self.folder)
        self.run_here("/usr/bin/snakemake", "--cores", "2", "--config", "plan=lump.toml", "folder=lump", "shards=3")


if __name__ == "__main__":
    unittest.main()
