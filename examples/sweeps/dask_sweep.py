#!/usr/bin/env python3
"""A sweep in parts, by Dask, on this machine or any cluster that has a Dask scheduler:

    python3 dask_sweep.py lump.toml lump --shards 40                             # on this machine's cores
    python3 dask_sweep.py lump.toml lump --shards 40 --scheduler tcp://head:8786

Each part is `palpate sweep --shard K/N` in a process of its own, so that a worker needs the program and the folder, and nothing of
Python but Dask. A part that was interrupted goes on where it was when this is run again.
"""
import argparse
import os
import subprocess

from dask.distributed import Client, as_completed


def shard(plan, folder, number, shards):
    """Runs one part where Dask puts it. Returns its number; raises with the program's own words where it failed."""
    done = subprocess.run(["palpate", "sweep", plan, "-o", folder, "--shard", f"{number}/{shards}", "--jobs", "1"],
                          capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(f"part {number} of {shards}: {done.stderr.strip()}")
    return number


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("plan")
    parser.add_argument("folder", help="on a disk that all workers share")
    parser.add_argument("--shards", type=int, default=20)
    parser.add_argument("--scheduler", help="address; without it, workers on this machine, one per core")
    options = parser.parse_args()
    # A worker has a working directory of its own; a plan that is no file is a ready one.
    folder = os.path.abspath(options.folder)
    plan = os.path.abspath(options.plan) if os.path.isfile(options.plan) else options.plan
    with Client(options.scheduler) if options.scheduler else Client(threads_per_worker=1, dashboard_address=None) as client:
        parts = [client.submit(shard, plan, folder, k, options.shards, pure=False)
                 for k in range(1, options.shards + 1)]
        for count, part in enumerate(as_completed(parts), 1):
            print(f"part {part.result()} is done, {count} of {options.shards}", flush=True)
    subprocess.run(["palpate", "sweep", "-o", folder, "--merge"], check=True)


if __name__ == "__main__":
    main()
