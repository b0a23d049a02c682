import functools
import importlib.util
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import types
import unittest
import unittest.mock

import numpy as np

import palpate
from common import InFolder
from palpate import envs


@functools.lru_cache(maxsize=None)
def layered():
    """A biopsy that is quick: contact laws alone."""
    return palpate.Model(palpate.Scene("layered").changed({"model.level": "spring", "volume.voxel_mm": 2}))


def make():
    return envs.Biopsy(layered(), max_seconds=0.4)


def straight(env, info, speed=1.0):
    """Straight in to where the gun is to be fired, and fires."""
    observation, total, steps = None, 0.0, 0
    inserted = 0.0
    while True:
        left = info["firing_depth"] - inserted
        fire = left < 5e-4
        go = np.clip(left / (0.02 * env.max_speed), 0, speed)
        observation, reward, terminated, truncated, last = env.step([go, 0, 0, 1 if fire else 0])
        inserted = observation[6] / 100
        total += reward
        steps += 1
        if terminated or truncated:
            return observation, total, steps, terminated, last


class Biopsy(unittest.TestCase):
    def test_the_needle_that_goes_to_the_aim_takes_a_core(self):
        env = envs.Biopsy(layered(), entry_error=0.0)
        _, info = env.reset(seed=1)
        _, total, _, terminated, last = straight(env, info)
        self.assertTrue(terminated)
        self.assertGreater(env.session.cores[0]["target_fraction"], 0.3)
        self.assertGreater(last["score"]["total"], 50)
        self.assertGreater(total, 1)

    def test_firing_outside_is_worth_less(self):
        env = envs.Biopsy(layered())
        _, info = env.reset(seed=1)
        _, good, *_ = straight(env, info)
        env.reset(seed=1)
        total, over = 0.0, False
        while not over:
            _, reward, terminated, truncated, _ = env.step([0, 0, 0, 1])
            total += reward
            over = terminated or truncated
        self.assertLess(total, good)

    def test_same_seed_same_episode(self):
        def episode(seed):
            env = make()
            random = np.random.default_rng(3)
            rows = [env.reset(seed=seed)[0]]
            for _ in range(20):
                observation, reward, terminated, truncated, _ = env.step(random.uniform(-1, 0.4, 4))
                rows.append(np.append(observation, reward))
                if terminated or truncated:
                    break
            return np.concatenate(rows)

        np.testing.assert_array_equal(episode(5), episode(5))
        self.assertFalse(np.array_equal(episode(5), episode(6)))

    def test_observation_and_actions_are_of_their_spaces(self):
        env = make()
        observation, _ = env.reset(seed=2)
        self.assertEqual(observation.dtype, np.float32)
        self.assertTrue(env.observation_space.contains(observation))
        self.assertEqual(observation[10:13].tolist(), [1, 0, 0])
        env.action_space.seed(1)
        for _ in range(50):
            self.assertTrue(env.action_space.contains(env.action_space.sample()))
        self.assertFalse(env.action_space.contains(np.full(4, 1.5)))

    def test_an_episode_ends_with_its_time_and_has_to_be_begun(self):
        env = make()
        with self.assertRaisesRegex(palpate.Error, "reset"):
            env.step(np.zeros(4))
        env.reset(seed=1)
        ends = [env.step(np.zeros(4))[2:4] for _ in range(20)]
        self.assertEqual(ends, [(False, False)] * 19 + [(False, True)])
        with self.assertRaisesRegex(palpate.Error, "reset"):
            env.step(np.zeros(4))

    def test_the_reward_is_what_the_documentation_says(self):
        env = make()
        env.reset(seed=1)
        before = env._distance
        observation, reward, *_ = env.step([1, 0, 0, 0])
        force = float(observation[13])
        self.assertAlmostEqual(reward, (before - env._distance) / 0.05 - 0.005 - 0.1 * max(force - 4, 0), places=6)
        self.assertAlmostEqual(before - env._distance, 0.02 * env.max_speed, places=4)

    def test_numbers_out_of_range_are_refused(self):
        for name, values in {"max_seconds": (0, -1, np.nan, np.inf), "max_speed": (0, -1, np.nan, 1e6),
                             "entry_error": (-1, np.nan, np.inf)}.items():
            for value in values:
                with self.subTest(name, value=value), self.assertRaisesRegex(ValueError, name):
                    envs.Biopsy(layered(), **{name: value})

    def test_what_is_no_number_or_seed_is_named(self):
        for name in ("max_seconds", "max_speed", "entry_error"):
            for value in ("1", None, [1]):
                with self.subTest(name, value=value), self.assertRaisesRegex(TypeError, f"^{name}: has to be a number, not "):
                    envs.Biopsy(layered(), **{name: value})
        env = make()
        with envs.Vector(1, make, processes=1, seed=1) as vector:
            for call in (env.reset, vector.reset, lambda seed: envs.Vector(1, make, seed=seed)):
                for seed, error in ("x", TypeError), (1.5, TypeError), (-1, ValueError):
                    with self.subTest(seed=seed), self.assertRaisesRegex(error, "^seed: has to be "):
                        call(seed=seed)
            np.testing.assert_array_equal(vector.reset(seed=3), vector.reset(seed=np.int64(3)))

    def test_a_scene_without_a_needle_is_refused(self):
        with self.assertRaisesRegex(palpate.Error, "no needle"):
            envs.Biopsy("block")

    def test_an_action_that_is_no_number_is_refused(self):
        env = make()
        env.reset(seed=1)
        for wrong in ([np.nan, 0, 0, 0], np.zeros(4, complex), [1j, 0, 0, 0], np.ma.masked_equal([1, 0, 0, 0], 1), "abcd"):
            with self.subTest(wrong), self.assertRaisesRegex(ValueError, "give 4 numbers"):
                env.step(wrong)
        env.step(np.zeros(4))

    # What gymnasium.utils.env_checker.check_env asks of the random numbers, with an Env that keeps them as gymnasium's does.
    def test_gymnasium_has_the_random_numbers(self):
        class Env:
            _np_random = None

            @property
            def np_random(self):
                self._np_random = self._np_random or np.random.default_rng()
                return self._np_random

            def reset(self, *, seed=None, options=None):
                self._np_random = self._np_random if seed is None else np.random.default_rng(seed)

        gymnasium = types.SimpleNamespace(Env=Env, spaces=types.SimpleNamespace(Box=envs._Box))
        with unittest.mock.patch.dict(sys.modules, gymnasium=gymnasium):
            spec = importlib.util.spec_from_file_location("palpate.envs_with_gymnasium", envs.__file__)
            spec.loader.exec_module(module := importlib.util.module_from_spec(spec))
        env = module.Biopsy(layered())
        self.assertIsInstance(env, Env)
        env.reset()
        first, _ = env.reset(seed=123)
        state = env._np_random.bit_generator.state
        np.testing.assert_array_equal(env.reset(seed=123)[0], first)
        self.assertEqual(env._np_random.bit_generator.state, state)
        env.reset(seed=456)
        self.assertNotEqual(env._np_random.bit_generator.state, state)
        np.testing.assert_array_equal(make().reset(seed=123)[0], first)

    def test_it_can_be_looked_at(self):
        env = envs.Biopsy(layered(), render_mode="ultrasound")
        env.reset(seed=1)
        picture = env.render()
        self.assertEqual(picture.shape, (640, 640, 3))
        self.assertGreater(picture.std(), 5)


def volume_with_lump(shift):
    labels = np.zeros((60, 40, 60), np.uint8)
    labels[5:-5, 5:-5, 5:-5] = 1
    labels[26 + shift:34 + shift, 16:24, 26:34] = 2
    affine = np.diag([1.5e-3, 1.5e-3, 1.5e-3, 1])
    return palpate.Volume.from_numpy(labels, affine, {1: "fat", 2: ("lump", "idc_high_grade")})


class SharedModels(InFolder):
    def check(self, body):
        """An environment of `body` has the body's aim, and those of before another one."""
        aim = palpate.Model(body).aim
        np.testing.assert_array_equal(envs.Biopsy(body).model.aim, aim)
        return tuple(aim)

    def test_volumes_in_memory_and_files_that_change_are_told_apart(self):
        file = self.folder / "v.vdb"
        scene = self.folder / "scene.toml"
        scene.write_text('[volume]\nfile = "v.vdb"\n[target]\nstructure = "lump"\n[model]\nlevel = "spring"\n')
        quick = {"model.level": "spring"}
        memory, files = set(), set()
        for shift in (-6, 6):
            volume = volume_with_lump(shift)
            memory.add(self.check(palpate.Scene.for_volume(volume).changed(quick)))
            volume.save(file)
            files |= {self.check(str(scene)), self.check(palpate.Scene(file).changed(quick))}
        self.assertEqual((len(memory), len(files)), (2, 2))

    def test_an_unchanged_file_is_read_once_and_few_models_are_kept(self):
        volume_with_lump(0).save(self.folder / "v.vdb")
        file = self.folder / "scene.toml"
        file.write_text('[volume]\nfile = "v.vdb"\n[target]\nstructure = "lump"\n[model]\nlevel = "spring"\n')
        self.assertIs(envs.Biopsy(file).model, envs.Biopsy(file).model)
        base = palpate.Scene("layered").changed({"model.level": "spring", "volume.voxel_mm": 2})
        scenes = [base.changed({"tissue.fat.youngs_kpa": 3 + k}) for k in range(6)]
        first = [envs.Biopsy(scene).model for scene in scenes]
        self.assertIs(envs.Biopsy(scenes[-1]).model, first[-1])
        self.assertLess(len(envs._models), len(scenes))


class Stopped(Exception):
    pass


def stop(*_):
    raise Stopped


class Slow(envs.Biopsy):
    """Stops the process that waits for it while it works."""

    def step(self, action):
        os.kill(os.getppid(), signal.SIGUSR1)
        time.sleep(0.1)
        return super().step(action)


def make_slow():
    return Slow(layered(), max_seconds=0.4)


class Failing(envs.Biopsy):
    def step(self, action):
        raise ArithmeticError("no step")


def make_failing():
    return Failing(layered())


class BrokenVectors(unittest.TestCase):
    def test_wrong_actions_are_refused_before_any_process_sees_them(self):
        with envs.Vector(2, make, processes=2, seed=1) as vector:
            vector.reset()
            for wrong in (np.zeros((2, 3)), np.zeros((3, 4)), np.zeros(4), 0.0, np.full((2, 4), "x"), [[None] * 4] * 2,
                          np.full((2, 4), np.nan)):
                with self.subTest(wrong), self.assertRaisesRegex(ValueError, "give 2 x 4 numbers"):
                    vector.step(wrong)
            self.assertEqual(vector.step(np.zeros((2, 4)))[0].shape, (2, 16))

    def test_after_an_exception_no_answer_is_taken_for_another(self):
        before = signal.signal(signal.SIGUSR1, stop)
        self.addCleanup(signal.signal, signal.SIGUSR1, before)
        vector = envs.Vector(2, make_slow, processes=2, seed=1)
        vector.reset()
        with self.assertRaises(Stopped):
            vector.step(np.zeros((2, 4)))
        for call in (vector.reset, lambda: vector.step(np.zeros((2, 4)))):
            with self.assertRaisesRegex(palpate.Error, "closed by an error .Stopped.: make new ones"):
                call()
        vector.close()

    def test_an_error_in_an_environment_closes_all(self):
        vector = envs.Vector(2, make_failing, processes=2, seed=1)
        vector.reset()
        with self.assertRaisesRegex(ArithmeticError, "no step"):
            vector.step(np.zeros((2, 4)))
        with self.assertRaisesRegex(palpate.Error, "make new ones"):
            vector.step(np.zeros((2, 4)))

    def test_closed_environments_say_so(self):
        vector = envs.Vector(1, make, processes=1, seed=1)
        vector.close()
        for call in (vector.reset, lambda: vector.step(np.zeros((1, 4)))):
            with self.assertRaisesRegex(palpate.Error, "are closed"):
                call()


def is_alive(pid):
    try:
        return pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] not in "ZX"
    except (FileNotFoundError, ProcessLookupError):
        return False


class Vectors(unittest.TestCase):
    def test_episodes_do_not_depend_on_the_number_of_processes(self):
        actions = np.random.default_rng(1).uniform(-1, 0.4, (30, 3, 4))
        seen, ended = [], False
        for processes in (1, 2):
            with envs.Vector(3, make, processes=processes, seed=11) as vector:
                rows = [vector.reset()]
                for action in actions:
                    observations, rewards, terminated, truncated, infos = vector.step(action)
                    ended |= truncated.any()
                rows += [observations, rewards, terminated, truncated]
                seen.append(rows)
        for a, b in zip(*seen):
            np.testing.assert_array_equal(a, b)
        self.assertTrue(ended)

    def test_an_ended_episode_begins_anew(self):
        with envs.Vector(2, make, processes=2, seed=1) as vector:
            first = vector.reset()
            for _ in range(20):
                observations, _, _, truncated, infos = vector.step(np.zeros((2, 4)))
            self.assertTrue(truncated.all())
            self.assertEqual(observations[:, 15].tolist(), [1, 1])
            self.assertEqual([i["final_observation"][15] for i in infos], [0, 0])
            self.assertFalse(np.array_equal(first, observations))

    def test_forked_processes_end_with_their_parent(self):
        code = """
import os, signal, time
from envs_test import envs, make
vector = envs.Vector(2, make, processes=2, seed=1, context="fork")
vector.reset()
print(*[process.pid for process in vector._processes], flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""
        done = subprocess.run([sys.executable, "-B", "-c", code], stdout=subprocess.PIPE, text=True)
        self.assertEqual(done.returncode, -signal.SIGKILL)
        left = [int(pid) for pid in done.stdout.split()]
        self.assertEqual(len(left), 2)
        for _ in range(1000):
            left = [pid for pid in left if is_alive(pid)]
            if not left:
                return
            time.sleep(0.02)
        for pid in left:
            os.kill(pid, signal.SIGKILL)
        self.fail("processes are left behind")

    def test_a_script_without_the_guard_is_told_so_and_no_process_prints(self):
        with tempfile.TemporaryDirectory() as folder:
            script = pathlib.Path(folder) / "script.py"
            script.write_text("import palpate\nenvs = palpate.envs.Vector(4, processes=2, seed=1)\n")
            done = subprocess.run([sys.executable, "-B", script], capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertEqual(done.stderr.count("Traceback"), 1, done.stderr)
        self.assertRegex(done.stderr.splitlines()[-1], 'Error: .*below `if __name__ == "__main__":`')

    def test_counts_that_are_none_are_refused(self):
        for name, arguments in {"count": lambda v: ((v, make), {}), "processes": lambda v: ((2, make), {"processes": v})}.items():
            for value, error in (2.5, TypeError), ("2", TypeError), (True, ValueError), (0, ValueError), (-1, ValueError):
                words, options = arguments(value)
                with self.subTest(name, value=value), self.assertRaisesRegex(error, name):
                    envs.Vector(*words, **options).close()

    def test_a_reset_goes_on_and_a_seed_repeats(self):
        with envs.Vector(2, make, processes=2, seed=11) as vector:
            first, second = vector.reset(), vector.reset()
            self.assertFalse(np.array_equal(first, second))
            self.assertFalse(np.array_equal(second, vector.reset()))
            np.testing.assert_array_equal(vector.reset(seed=11), first)
            np.testing.assert_array_equal(vector.reset(), second)

    def test_an_error_in_a_process_comes_here(self):
        with self.assertRaisesRegex(palpate.Error, "no needle"):
            envs.Vector(1, functools.partial(envs.Biopsy, "block"), processes=1)
        with envs.Vector(1, make, processes=1, seed=1) as vector:
            vector.reset()
            with self.assertRaisesRegex(ValueError, "give 1"):
                vector.step(np.zeros((2, 4)))


if __name__ == "__main__":
    unittest.main()
