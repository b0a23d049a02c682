"""A sweep by Dask, in parts, is the sweep."""

import shutil
import subprocess
import unittest

from common import SOURCE
from sweeps_test import Managed


class Dask(Managed):
    def test_dask(self):
        shutil.copy(SOURCE / "examples" / "sweeps" / "dask_sweep.py", self.folder)
        self.run_here("/usr/bin/python3", "dask_sweep.py", "lump.toml", "lump", "--shards", "3")

    def test_dask_s_workers_may_be_in_another_folder(self):
        elsewhere = self.folder / "elsewhere"
        elsewhere.mkdir()
        cluster = subprocess.Popen(["/usr/bin/python3", "-c", """if __name__ == "__main__":
    from dask.distributed import LocalCluster
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1") as cluster:
        print(cluster.scheduler_address, flush=True)
        input()
"""], cwd=elsewhere, env=self.environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        with cluster:
            address = cluster.stdout.readline().strip()
            self.assertRegex(address, "^tcp://")
            self.run_here("/usr/bin/python3", SOURCE / "examples" / "sweeps" / "dask_sweep.py", "lump.toml", "lump",
                          "--shards", "2", "--scheduler", address)
            cluster.communicate("\n")

    def test_dask_says_which_part_failed_and_why(self):
        script = SOURCE / "examples" / "sweeps" / "dask_sweep.py"
        done = subprocess.run(["/usr/bin/python3", script, "none.toml", "lump", "--shards", "2"], cwd=self.folder,
                              env=self.environment, capture_output=True, text=True)
        self.assertNotEqual(done.returncode, 0)
        self.assertRegex(done.stderr, r"part \d of 2: palpate: none.toml: ")


if __name__ == "__main__":
    unittest.main()
