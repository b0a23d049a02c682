"""Sessions opened and closed, threads, processes, and an interrupt in the middle of a run."""

import gc
import multiprocessing
import os
import pathlib
import signal
import subprocess
import sys
import threading
import time
import unittest

import numpy as np

import palpate
from common import InFolder, small_block, wander


def resident():
    """Memory of this process [MB]."""
    pages = int(pathlib.Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


class Leaks(InFolder):
    def test_sessions_leave_no_memory_files_or_threads(self):
        model, poses = small_block(), wander(30)

        def open_and_close(count):
            for _ in range(count):
                session = palpate.Session(model)
                kept = session.run(poses)["total"]
                field = session.displacement
                del session, field, kept
            gc.collect()

        open_and_close(40)  # what is made once is made
        before, files, threads = resident(), len(os.listdir("/proc/self/fd")), len(os.listdir("/proc/self/task"))
        rounds = [before]
        for _ in range(3):
            open_and_close(100)
            rounds.append(resident())
        # One session holds about 1.5 MB: 300 that leak would be 450.
        self.assertLess(rounds[-1] - before, 20, rounds)
        self.assertEqual(len(os.listdir("/proc/self/fd")), files)
        self.assertEqual(len(os.listdir("/proc/self/task")), threads)

    def test_a_closed_session_says_so_and_keeps_its_figures(self):
        session = palpate.Session(small_block(), record=self.folder / "r.db")
        session.run(wander(100))
        session.close()
        session.close()
        with self.assertRaisesRegex(palpate.Error, "closed"):
            session.step([0, 0, 0])
        self.assertEqual(session.ticks, 100)
        self.assertEqual(palpate.Record(self.folder / "r.db").results["force_hash"], session.force_hash)


class Objects(unittest.TestCase):
    def test_no_object_is_there_without_its_constructor(self):
        for kind in (palpate.Volume, palpate.Scene, palpate.Model, palpate.Session):
            with self.subTest(kind), self.assertRaisesRegex(TypeError, "__new__: gives no object"):
                kind.__new__(kind)

    def test_a_class_may_be_derived(self):
        class Named(palpate.Scene):
            def __init__(self, source, tag):
                super().__init__(source)
                self.tag = tag

        named = Named("block", tag=3)
        self.assertEqual((named.name, named.tag), ("block", 3))


class Threads(unittest.TestCase):
    def test_sessions_of_one_model_run_side_by_side(self):
        model = small_block()
        expected = [palpate.Session(model).run(wander(1500, seed))["total"] for seed in range(4)]
        found = [None] * 4

        def work(seed):
            found[seed] = palpate.Session(model).run(wander(1500, seed))["total"]

        threads = [threading.Thread(target=work, args=(seed,)) for seed in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        np.testing.assert_array_equal(found, expected)

    def test_python_goes_on_while_a_session_runs(self):
        session = palpate.Session(small_block())
        thread = threading.Thread(target=session.run, args=(wander(4000),))
        thread.start()
        beats = 0
        while thread.is_alive():
            beats += 1
            time.sleep(1e-3)
        self.assertGreater(beats, 20)

    def test_two_threads_cannot_work_with_one_session(self):
        session = palpate.Session(small_block())
        refused = []

        def attempt(work, *args):
            try:
                work(*args)
            except palpate.Error as error:
                refused.append(str(error))

        # Whichever comes second is refused: the run, where a step is on its way when it begins.
        thread = threading.Thread(target=attempt, args=(session.run, wander(6000)))
        thread.start()
        while thread.is_alive():
            attempt(session.step, [0, -0.02, 0])
        self.assertGreater(len(refused), 0)
        for message in refused:
            self.assertIn("another thread", message)


    def test_no_thread_looks_into_a_session_that_runs_or_closes_it(self):
        session = palpate.Session(small_block())
        looks = [lambda: session.events, lambda: session.cores, session.score, lambda: session.force_hash,
                 lambda: session.displacement, session.close]
        refused = [0] * len(looks)
        results = []
        thread = threading.Thread(target=lambda: results.append(session.run(wander(6000))))
        thread.start()
        while session.ticks < 10:
            time.sleep(1e-3)
        while thread.is_alive() and session.ticks < 5900:
            for i, look in enumerate(looks):
                try:
                    look()
                except palpate.Error as error:
                    self.assertIn("another thread", str(error))
                    refused[i] += 1
        thread.join()
        self.assertGreater(min(refused), 0)
        self.assertEqual(len(results[0]), 6000)
        self.assertFalse(session.closed)
        self.assertGreater(len(session.events), 0)
        session.close()
        self.assertGreaterEqual(session.score()["seconds"], 0)

    def test_a_with_block_that_is_left_while_a_thread_runs_says_so(self):
        with self.assertRaisesRegex(palpate.Error, "another thread"):
            with palpate.Session(small_block()) as session:
                thread = threading.Thread(target=session.run, args=(wander(6000),))
                thread.start()
                while session.ticks == 0:
                    time.sleep(1e-3)
        thread.join()
        self.assertEqual(session.ticks, 6000)


def _child(model, session, pipe):
    fresh = palpate.Session(model).run(wander(800))["total"]
    gone_on = session.run(wander(1600)[800:])["total"]
    built = palpate.Session(palpate.Model(model.scene)).run(wander(800))["total"]
    pipe.send((fresh, gone_on, built))


class Forks(InFolder):
    def test_a_forked_process_has_sessions_of_its_own(self):
        model = small_block()
        expected = palpate.Session(model).run(wander(1600))["total"]
        session = palpate.Session(model)
        session.run(wander(1600)[:800])
        here, there = multiprocessing.Pipe()
        process = multiprocessing.get_context("fork").Process(target=_child, args=(model, session, there))
        process.start()
        self.assertTrue(here.poll(120), "the child says nothing")
        fresh, gone_on, built = here.recv()
        process.join(20)
        self.assertEqual(process.exitcode, 0)
        np.testing.assert_array_equal(fresh, expected[:800])
        np.testing.assert_array_equal(built, expected[:800])
        np.testing.assert_array_equal(gone_on, expected[800:])
        self.assertEqual(session.ticks, 800)

    def test_a_forked_process_may_end_as_programs_do(self):
        # Threads of libraries that the child has not were waited for, for ever.
        text = '''
import os, sys
import palpate
if len(sys.argv) > 1:
    model = palpate.Model(palpate.Scene("block").changed({"volume.voxel_mm": 3, "model.setting": "fast"}))
if os.fork() == 0:
    print("child")
    sys.exit(3)
sys.exit(os.waitstatus_to_exitcode(os.wait()[1]))
'''
        for arguments in ([], ["model"]):
            with self.subTest(arguments):
                process = subprocess.Popen([sys.executable, "-B", "-c", text, *arguments], stdout=subprocess.PIPE, text=True,
                                           start_new_session=True)
                try:
                    said, _ = process.communicate(timeout=60)
                except subprocess.TimeoutExpired:
                    os.killpg(process.pid, signal.SIGKILL)  # the child too
                    process.communicate()
                    raise
                self.assertEqual((process.returncode, said), (3, "child\n"))

    def test_a_record_is_its_own_process_s_alone(self):
        file = self.folder / "r.db"
        session = palpate.Session(small_block(), record=file)
        session.run(wander(500))
        child = os.fork()
        if child == 0:
            try:
                session.run(wander(10))
            except palpate.Error as error:
                del session
                os._exit(0 if "another process" in str(error) else 1)
            os._exit(2)
        self.assertEqual(os.waitpid(child, 0)[1], 0)
        session.run(wander(600)[500:])
        session.close()
        self.assertEqual(len(palpate.Record(file)), 600)
        self.assertTrue(palpate.Record(file).replay()["identical"])


class Interrupts(unittest.TestCase):
    def test_an_interrupted_run_has_done_whole_ticks_and_goes_on(self):
        poses = wander(60000)
        session = palpate.Session(small_block())
        threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
        with self.assertRaises(KeyboardInterrupt):
            session.run(poses)
        done = session.ticks
        self.assertTrue(0 < done < len(poses))
        first = session.interrupted
        self.assertEqual(len(first), done)
        rest = session.run(poses[done:done + 500])
        whole = palpate.Session(small_block()).run(poses[:done + 500])
        np.testing.assert_array_equal(np.concatenate([first, rest]), whole)
        self.assertIsNone(session.interrupted)

    def test_an_interrupted_hand_has_done_whole_ticks(self):
        session = palpate.Session("layered")
        threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
        with self.assertRaises(KeyboardInterrupt):
            session.perform("novice")
        self.assertGreater(session.ticks, 0)
        self.assertEqual(len(session.interrupted), session.ticks)
        np.testing.assert_array_equal(session.interrupted["tick"], np.arange(session.ticks))

    def test_an_exception_of_a_signal_handler_ends_a_run_too(self):
        class Enough(Exception):
            pass

        def handler(*_):
            raise Enough

        before = signal.signal(signal.SIGALRM, handler)
        self.addCleanup(signal.signal, signal.SIGALRM, before)
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        with self.assertRaises(Enough):
            palpate.Session(small_block()).run(wander(60000))


ENDS = """
import atexit, sys, threading, time
import palpate
from common import small_block, wander
session = palpate.Session(small_block(), record={record!r})
poses = wander(200000)
begun = threading.Event()
def work():
    while True:
        begun.set()
        {work}
threading.Thread(target=work, daemon=True).start()
begun.wait()
time.sleep(0.3)
print(session.ticks)
"""


class Ends(InFolder):
    def test_a_program_may_end_while_threads_that_nobody_waits_for_are_at_work(self):
        record = str(self.folder / "r.db")
        for work, file in (("session.run(poses)", None), ("session.advance(poses)", None), ("session.run(poses)", record),
                           ("session.perform('script', seconds=0)", None), ("session.step(poses[0])", None),
                           ("palpate.Volume.phantom('block', voxel=2e-3)", None)):
            with self.subTest(work, record=file):
                done = subprocess.run([sys.executable, "-B", "-c", ENDS.format(work=work, record=file)], capture_output=True,
                                      text=True, timeout=300)
                self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertTrue(palpate.Record(record).complete)

    def test_a_forked_process_does_not_wait_for_threads_that_it_has_not(self):
        text = ENDS.format(work="session.run(poses)", record=None) + """
import os
child = os.fork()
if child == 0:
    atexit._run_exitfuncs()
    os._exit(0)
sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""
        done = subprocess.run([sys.executable, "-B", "-c", text], capture_output=True, text=True, timeout=300)
        self.assertEqual((done.returncode, done.stderr), (0, ""))


if __name__ == "__main__":
    unittest.main()
