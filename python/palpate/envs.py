"""Environments for learning, in the manner of Gymnasium, which need not be installed.

    env = palpate.envs.Biopsy()
    observation, info = env.reset(seed=7)
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())

Where gymnasium is installed, the classes are gymnasium.Env and the spaces are gymnasium.spaces.Box.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _palpate
from ._arguments import said, whole
from ._errors import Error
from ._palpate import Model, Scene, Session, Volume

try:
    import gymnasium as _gymnasium

    _Env, _Box = _gymnasium.Env, _gymnasium.spaces.Box
except ImportError:
    class _Env:
        """Of gymnasium.Env the random numbers of its episodes, which are the same."""

        np_random = None

        def reset(self, *, seed=None, options=None):
            if seed is not None or self.np_random is None:
                self.np_random = np.random.default_rng(seed)

    class _Box:
        """A box of numbers from low to high, as gymnasium.spaces.Box."""

        def __init__(self, low, high, shape=None, dtype=np.float32, seed=None):
            self.dtype = np.dtype(dtype)
            shape = np.shape(low) if shape is None else shape
            self.low = np.broadcast_to(np.asarray(low, dtype), shape)
            self.high = np.broadcast_to(np.asarray(high, dtype), shape)
            self.shape = tuple(shape)
            self.seed(seed)

        def seed(self, seed=None):
            self._random = np.random.default_rng(seed)

        def sample(self):
            """A point of the box, evenly; along directions without an end, of a normal distribution."""
            ends = np.isfinite(self.low) & np.isfinite(self.high)
            even = self._random.uniform(np.where(ends, self.low, 0), np.where(ends, self.high, 1))
            return np.where(ends, even, self._random.normal(size=self.shape)).astype(self.dtype)

        def contains(self, x):
            x = np.asarray(x)
            return x.shape == self.shape and bool(np.all(x >= self.low) and np.all(x <= self.high))

        def __repr__(self):
            return f"Box({self.shape}, {self.dtype})"


_VITAL_TOUCH = 1 << _palpate.EVENTS.index("vital touch")
_models = {}  # models are constant, and the environments of a process share them; the one that was used last is last
_MODELS_KEPT = 4


def _key_of(source, scene):
    """What says which model a scene has; None where nothing does: its volume may be in memory alone, or of a file's former
    content."""
    volume = scene.to_dict()
    files = [name for name in (volume.get("tissues"), volume["volume"].get("file")) if name]
    if files and not isinstance(source, (str, os.PathLike)):
        return None
    try:
        states = [os.stat(name) for name in files]
    except OSError:
        return None
    return scene.text, *((s.st_dev, s.st_ino, s.st_size, s.st_mtime_ns) for s in states)


def _model_of(source):
    if isinstance(source, _palpate.Model):
        return source
    if not isinstance(source, (str, os.PathLike, Scene, Volume)):
        raise TypeError(f"scene: give a built-in scene's name, a file, or an object of palpate, not {said(source)}")
    scene = _palpate.Scene(source)
    key = _key_of(source, scene)
    model = _models.pop(key, None) or _palpate.Model(scene)
    if key is not None:
        _models[key] = model
    while len(_models) > _MODELS_KEPT:
        del _models[next(iter(_models))]
    return model


class Biopsy(_Env):
    """A core biopsy: bring the needle's tip to the target, past what must not be touched, and fire.

    Every step is 20 ms: 20 ticks of the simulator, in which the tip goes on a straight line at the speed of the action. The
    needle keeps the direction that it has at the start, towards the aim.

    Action, 4 numbers from -1 to 1 (float32): the tip's velocity along the needle and to two sides of it, as a share of
    `max_speed`, and the trigger: the gun is fired where it is above 0.5. The gun takes a core that lies before the tip, so it
    is fired short of the aim: when observation 6, the length inside, has come to `firing_depth` [m] of the info of reset().

    Observation, 16 numbers (float32), in the needle's frame (along, side, side) where they are vectors:

        0-2    from the tip to the aim [cm]
        3-5    force of the tissue on the needle [N]
        6      length of the shaft inside the body [cm]
        7      from the tip to the target's surface, below 0 inside [cm]
        8      from the tip to the nearest vital structure [cm], 10 at most
        9      along the needle to the next tissue [cm], 10 at most
        10-12  phase: free, contact, inserted (one of them is 1)
        13     size of the force that the hand feels [N]
        14     how many warnings of a vital structure are on: 0 to 3
        15     share of the time that is left

    Reward: the sum of
        (d0 - d1) / 50 mm    with d the distance from the tip to the target's surface, before and after the step;
        -0.005               for every step;
        -0.1 (F - 4 N)       for the largest force F that the hand felt in the step [N], where it was above 4 N;
        -1                   for every time that a vital structure was touched;
        total / 20           when the gun was fired: the score, 0 to 100 points (docs/score.md).

    An episode ends when the gun was fired (terminated), or after `max_seconds` (truncated). info: "ticks"; at the end also
    "score", a dict by the keys of docs/score.md.

    Args:
        scene: a built-in scene, a file, a palpate.Volume, a palpate.Scene or a palpate.Model; of a biopsy, with a needle.
            Environments share the model of a built-in scene, a phantom or an unchanged file. Of a Scene or Volume of a file or
            in memory each makes its own: give them one Model.
        max_seconds: of an episode [s], a step at least.
        max_speed: of the tip [m/s], above 0 and 10 at most.
        entry_error: standard deviation of where the needle is set on the skin, each way across it [m], 0 to 1.

    Same seed and actions, same episode, bit for bit. Raises palpate.Error for a scene whose tool is no needle, and
    ValueError for a number out of its range.
    """

    model: Model
    session: Session | None
    action_space: Any
    observation_space: Any
    max_steps: int
    max_speed: float
    metadata = {"render_modes": ["ultrasound"], "render_fps": 50}
    ticks_per_step = 20
    lead = 5e-3  # the tip begins so far outside the body [m]

    def __init__(
        self,
        scene: str | os.PathLike[str] | Volume | Scene | Model = "breast",
        *,
        max_seconds: float = 20.0,
        max_speed: float = 0.05,
        entry_error: float = 2e-3,
        render_mode: str | None = None,
    ) -> None:
        step_seconds = self.ticks_per_step * _palpate.TICK_SECONDS
        max_seconds, max_speed = _number(max_seconds, "max_seconds"), _number(max_speed, "max_speed")
        entry_error = _number(entry_error, "entry_error")
        if not step_seconds / 2 < max_seconds < 1e6:
            raise ValueError(f"max_seconds: has to be a step, {step_seconds:g} s, at least, and below 1e6, not {max_seconds}")
        if not 0 < max_speed <= 10:
            raise ValueError(f"max_speed: has to be above 0 and 10 m/s at most, not {max_speed}")
        if not 0 <= entry_error <= 1:
            raise ValueError(f"entry_error: has to be 0 to 1 m, not {entry_error}")
        self.model = _model_of(scene)
        tool = self.model.scene.to_dict().get("tool", {})
        if tool.get("kind", "needle") != "needle":
            raise Error(f"{self.model.scene.name}: the tool is no needle: choose a scene of a biopsy")
        if render_mode not in (None, "ultrasound"):
            raise ValueError(f"render_mode: is None or 'ultrasound', not {said(render_mode)}")
        self.render_mode = render_mode
        self.max_steps = int(round(max_seconds / step_seconds))
        self.max_speed, self.entry_error = max_speed, entry_error
        self.action_space = _Box(-1.0, 1.0, (4,), np.float32)
        self.observation_space = _Box(-np.inf, np.inf, (16,), np.float32)
        self.session = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begins an episode. Without a seed the episodes follow from the one before.

        Returns:
            (observation, info)
        """
        super().reset(seed=_seed(seed))
        random = self.np_random
        entry, aim = self.model.entry, self.model.aim
        line = (aim - entry) / np.linalg.norm(aim - entry)
        side, other = _across(line)
        start = entry + random.normal(0, self.entry_error, 2) @ np.stack([side, other]) - self.lead * line
        axis = (aim - start) / np.linalg.norm(aim - start)
        self._frame = np.stack([axis, *_across(axis)])
        self._aim, self._tip, self._steps, self._done = aim, start, 0, False
        self.session = _palpate.Session(self.model)
        # Forces are ramped up in the first 0.6 s of a session: the needle waits outside.
        settled = self.session.run(np.tile(np.concatenate([start, axis]), (600, 1)))
        return self._observe(settled[-1], 0.0), {
            "ticks": 600, "firing_depth": self.model.firing_depth}

    def step(self, action: ArrayLike) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """One step of 20 ms. Returns (observation, reward, terminated, truncated, info)."""
        if self.session is None or self._done:
            raise Error("step: the episode is over: call reset()")
        action = _numbers(action, (4,), "action: give 4 numbers: velocity along, to two sides, trigger")
        action = np.clip(action.astype(float), -1, 1)
        n = self.ticks_per_step
        way = action[:3] @ self._frame * (self.max_speed * _palpate.TICK_SECONDS)
        poses = np.empty((n, 6))
        poses[:, :3] = self._tip + np.arange(1, n + 1)[:, None] * way
        poses[:, 3:] = self._frame[0]
        self._tip = poses[-1, :3]
        buttons = np.full(n, _palpate.DEADMAN, np.uint32)
        if action[3] > 0.5:
            buttons[-1] |= _palpate.FIRE
        before = self._distance
        ticks = self.session.run(poses, buttons)
        self._steps += 1
        force = float(np.linalg.norm(ticks["total"], axis=1).max())
        fired = bool(ticks["fired"].any())
        observation = self._observe(ticks[-1], force)
        touches = int(np.count_nonzero(ticks["events"] & _VITAL_TOUCH))
        reward = (before - self._distance) / 0.05 - 0.005 - 0.1 * max(force - 4.0, 0.0) - 1.0 * touches
        info = {"ticks": self.session.ticks}
        truncated = not fired and self._steps >= self.max_steps
        if fired or truncated:
            self._done = True
            info["score"] = self.session.score()
            reward += info["score"]["total"] / 20.0 if fired else 0.0
        return observation, float(reward), fired, truncated, info

    def render(self) -> NDArray[np.uint8] | None:
        """The ultrasound picture, 640 x 640 x 3 (uint8), or None without render_mode="ultrasound"."""
        if self.render_mode is None or self.session is None:
            return None
        return np.repeat(self.session.ultrasound()["pixels"][:, :, None], 3, axis=2)

    def close(self) -> None:
        """Lets go of the session."""
        self.session = None

    def _observe(self, tick, force):
        self._distance = float(tick["distance"][0])
        vital = tick["distance"][1:].min() if len(tick["distance"]) > 1 else np.inf
        phase = np.eye(3)[int(tick["phase"])]
        return np.concatenate([
            100 * self._frame @ (self._aim - tick["position"]), self._frame @ tick["tissue_force"],
            [100 * tick["inserted"], 100 * self._distance, 100 * min(vital, 0.1), 100 * min(float(tick["ahead"]), 0.1)],
            phase, [force, float(tick["warning"]), 1.0 - self._steps / self.max_steps],
        ]).astype(np.float32)


def _numbers(values, shape, wanted):
    """An array of real numbers of this shape. Raises ValueError with what is wanted."""
    array = np.asarray(values)
    hidden = isinstance(values, np.ma.MaskedArray)
    if hidden or array.shape != shape or array.dtype.kind not in "biuf" or np.isnan(array).any():
        raise ValueError(wanted)
    return array


def _number(value, name):
    """A number. Raises TypeError that names it."""
    try:
        return float(None if isinstance(value, (str, bytes)) else value)
    except OverflowError:
        return np.inf
    except (TypeError, ValueError):
        raise TypeError(f"{name}: has to be a number, not {said(value)}") from None


def _seed(value):
    """A seed of random numbers, or None. Raises TypeError or ValueError that names it."""
    if value is None:
        return None
    seed = whole(value, "seed: has to be a whole number, or None")
    if seed < 0:
        raise ValueError(f"seed: has to be 0 or more, not {seed}")
    return seed


def _count(value, name):
    """A whole number above 0. Raises TypeError or ValueError that names it."""
    count = whole(value, f"{name}: has to be a whole number")
    if isinstance(value, (bool, np.bool_)) or count < 1:
        raise ValueError(f"{name}: has to be 1 or more, not {value!r}")
    return count


def _across(line):
    """Two unit vectors across a unit vector and each other."""
    side = np.cross(line, np.eye(3)[np.argmin(np.abs(line))])
    side /= np.linalg.norm(side)
    return side, np.cross(line, side)


def _serve(pipe, make, numbers, seed, inherited):
    """The life of a worker process: its environments, stepped when asked. It ends with its parent, whose ends of the pipes a
    forked process has `inherited`."""
    for one in inherited:
        one.close()
    try:
        envs = [make() for _ in numbers]
        children = np.random.SeedSequence(seed)
        streams = [np.random.SeedSequence(children.entropy, spawn_key=(n,)) for n in numbers]
        pipe.send(envs[0].action_space.shape)
        while True:
            what, argument = pipe.recv()
            if what == "reset":
                if argument is not None:
                    streams = [np.random.SeedSequence(argument, spawn_key=(n,)) for n in numbers]
                # Only the first episode needs its seed: those after it follow from the one before.
                pipe.send([env.reset(seed=s and int(s.generate_state(1)[0])) for env, s in zip(envs, streams)])
                streams = [None] * len(envs)
            elif what == "step":
                pipe.send([_step(env, action) for env, action in zip(envs, argument)])
            else:
                return
    except (EOFError, KeyboardInterrupt):
        pass
    except Exception as error:  # told to who waits for it, if anybody still does
        with contextlib.suppress(OSError):
            pipe.send(error)


def _step(env, action):
    observation, reward, terminated, truncated, info = env.step(action)
    if terminated or truncated:
        info = dict(info, final_observation=observation)
        observation, _ = env.reset()
    return observation, reward, terminated, truncated, info


_ENDED = "a process of the environments has ended: see what it printed"
_NOT_BEGUN = ('the processes of the environments have ended as they began: put what makes them below `if __name__ == "__main__":`; '
              "where it is there, see what they printed")


class Vector:
    """Many environments at once, over processes. An episode that ends begins anew by itself; its last observation is in
    infos[i]["final_observation"].

        with palpate.envs.Vector(8, processes=2, seed=1) as envs:
            observations = envs.reset()
            observations, rewards, terminated, truncated, infos = envs.step(actions)     # actions: 8 x 4

    The episodes of environment i follow from the seed and i alone, whatever the number of processes. An exception while the
    processes work, in one of them or here (Ctrl-C), closes all; reset() and step() then raise palpate.Error.

    Args:
        count: how many environments, 1 or more.
        make: what makes one; called in the processes, so it has to be a function of a module. Default: Biopsy.
        processes: 1 or more; default: all cores.
        seed: of all of them; default: another one each time.
        context: how processes start, see multiprocessing. With "spawn", the default, each reads the script again: there
            this belongs below the usual `if __name__ == "__main__":`.
    """

    count: int

    def __init__(
        self,
        count: int,
        make: Callable[[], Biopsy] = Biopsy,
        *,
        processes: int | None = None,
        seed: int | None = None,
        context: str = "spawn",
    ) -> None:
        count = _count(count, "count")
        processes = min(count, (os.cpu_count() or 1) if processes is None else _count(processes, "processes"))
        seed = np.random.SeedSequence(_seed(seed)).entropy
        start = multiprocessing.get_context(context)
        reads_script = start.get_start_method() != "fork"
        if reads_script and getattr(multiprocessing.current_process(), "_inheriting", False):
            # A process that reads the script of its parent again, and found no `if __name__ == "__main__":` in it. The parent
            # says so; here Python would print a traceback for each process.
            sys.exit(1)
        self.count = count
        self._parts = np.array_split(np.arange(count), processes)
        self._pipes, self._processes = [], []
        self._closed = None  # why the processes are gone
        try:
            for part in self._parts:
                here, there = start.Pipe()
                inherited = [*self._pipes, here] if start.get_start_method() == "fork" else []
                arguments = (there, make, [int(n) for n in part], seed, inherited)
                process = start.Process(target=_serve, args=arguments, daemon=True)
                process.start()
                there.close()
                self._pipes.append(here)
                self._processes.append(process)
            ended = _NOT_BEGUN if reads_script else _ENDED
            self._action_shape = (count, *[self._answer(pipe, ended) for pipe in self._pipes][0])
        except BaseException:
            self.close()
            raise

    def reset(self, *, seed: int | None = None) -> NDArray[np.float32]:
        """Begins all episodes; without a seed they follow from those before. Returns count x 16 observations."""
        requests = [("reset", _seed(seed))] * len(self._parts)
        return np.stack([observation for observation, _ in self._ask(requests)])

    def step(
        self, actions: ArrayLike
    ) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], list[dict[str, Any]]]:
        """One step of each.

        Args:
            actions: count x 4.

        Returns:
            observations (count x 16), rewards, terminated, truncated (count each), infos (list of dict)
        """
        shape = " x ".join(map(str, self._action_shape))
        actions = _numbers(actions, self._action_shape, f"actions: give {shape} numbers, a row for each environment")
        results = self._ask([("step", actions[part]) for part in self._parts])
        observations, rewards, terminated, truncated, infos = zip(*results)
        return np.stack(observations), np.array(rewards), np.array(terminated), np.array(truncated), list(infos)

    def close(self) -> None:
        """Ends the processes."""
        for pipe in self._pipes:
            try:
                pipe.send(("close", None))
            except OSError:
                pass
            pipe.close()
        for process in self._processes:
            process.join()
        self._pipes, self._processes = [], []
        self._closed = self._closed or "the environments are closed: make new ones"

    def __enter__(self) -> Vector:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _ask(self, requests):
        """Sends each process its request and gives all answers. After an exception in between, answers would be left over
        that the next request took for its own."""
        if self._closed:
            raise Error(self._closed)
        try:
            for pipe, request in zip(self._pipes, requests):
                self._send(pipe, request)
            return [answer for pipe in self._pipes for answer in self._answer(pipe)]
        except BaseException as error:
            self._closed = f"the environments were closed by an error ({type(error).__name__}): make new ones"
            self.close()
            raise

    @staticmethod
    def _send(pipe, request):
        try:
            pipe.send(request)
        except ConnectionError:
            raise Error(_ENDED) from None

    @staticmethod
    def _answer(pipe, ended=_ENDED):
        try:
            answer = pipe.recv()
        except (EOFError, ConnectionError):
            raise Error(ended) from None
        if isinstance(answer, Exception):
            raise answer
        return answer
