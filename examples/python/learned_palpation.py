"""A palpation policy learned with numpy alone, against the scripted fingertip of the simulator.

    PYTHONPATH=build/release/lib/python3/dist-packages /usr/bin/python3 examples/python/learned_palpation.py [OUTPUT.png]

A lump of 14 mm lies somewhere under the skin of a block of fat. A finger presses and feels the force, nothing else. The
scripted fingertip (palpate.Session.perform) searches a raster, follows two lines over the stiffest place and marks the lump's
edges. The learned policy presses nine places, guesses where the lump is, presses five more places around its guess, and
corrects it. Both guesses are ridge regressions on what was felt, fitted on bodies that no test sees. Either finger tells a
stiffness from another by 6 %, as the simulator's expert does; the scripted hand also trembles, which the learned one does not.

Writes learned_palpation.png. Some minutes.
"""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import palpate

TRAINING, TESTS = 40, 12
TOUCH = 0.06                     # of a force that is felt, standard deviation as a share of it: the expert's (docs/score.md)
COPIES = 30                      # of each body in the fit, each felt with other errors
REACH = 12e-3                    # the lump's middle is so far from the aim at most, along x and z [m]
DEPTH, SPEED = 7e-3, 0.06        # of a press [m], [m/s]
FIRST = [(x, z) for x in (-14e-3, 0, 14e-3) for z in (-14e-3, 0, 14e-3)]
SECOND = [(0, 0), (8e-3, 0), (-8e-3, 0), (0, 8e-3), (0, -8e-3)]


def body(lump, **keys):
    """A block of fat with a lump whose middle is at (x, z) [m], 13 mm deep."""
    return palpate.Model(palpate.Scene("find-lump").changed({
        "volume.voxel_mm": 2, "volume.parameters.width_mm": 80, "model.setting": "fast",
        "insert.lump.centre_mm.x": 1e3 * lump[0], "insert.lump.centre_mm.y": 13.0, "insert.lump.centre_mm.z": 1e3 * lump[1], **keys}))


class Finger:
    """Presses one place after the other in one session, and feels forces."""

    def __init__(self, model):
        self.session = palpate.Session(model)
        self.radius = 1e-3 * model.scene.to_dict()["tool"]["radius_mm"]
        self.at = np.array([0.0, -self.radius - 2e-3, 0.0])
        self.pressed = []
        self.session.advance(np.tile(self.at, (600, 1)))  # forces are ramped up

    def go(self, to):
        """Straight to a place; the rows of the way."""
        count = max(2, round(np.linalg.norm(to - self.at) / SPEED * 1000))
        way = self.at + np.linspace(0, 1, count + 1)[1:, None] * (to - self.at)
        self.at = way[-1]
        return self.session.run(way)

    def press(self, x, z):
        """How much force it takes to go DEPTH deep [N]: the largest force, and that half way."""
        self.pressed.append((x, z))
        self.go(np.array([x, -self.radius - 2e-3, z]))
        down = self.go(np.array([x, -self.radius + DEPTH, z]))
        force = -down["tissue_force"][:, 1]
        self.go(np.array([x, -self.radius - 2e-3, z]))
        return force.max(), force[len(force) * 2 // 3]

    def forces(self, places, middle=(0.0, 0.0)):
        """Forces at places around `middle`: places x 2 [N]."""
        return np.array([self.press(middle[0] + x, middle[1] + z) for x, z in places])


def felt(forces, random):
    """What a finger makes of forces: with errors of touch, as shares of their mean, since only differences tell."""
    noisy = forces * (1 + random.normal(0, TOUCH, (len(forces), 1)))
    return (noisy / noisy.mean(axis=0) - 1).ravel()


class Ridge:
    """Two coordinates as a linear function of features, their squares and products with the strongest."""

    def __init__(self, features, answers, weight=1e-2):
        self.scale = features.std(axis=0) + 1e-12
        bent = self.bent(features)
        self.weights = np.linalg.solve(bent.T @ bent + weight * len(bent) * np.eye(bent.shape[1]), bent.T @ answers)

    def bent(self, features):
        linear = np.atleast_2d(features) / self.scale
        return np.hstack([np.ones((len(linear), 1)), linear, np.tanh(linear) * np.abs(linear)])

    def __call__(self, features):
        return self.bent(features) @ self.weights


def somewhere(random, count):
    return random.uniform(-REACH, REACH, (count, 2))


def learn(random):
    """The two regressions. The second one learns around guesses that are off as the first one's are."""
    lumps = somewhere(random, TRAINING)
    first, around, second = [], [], []
    for number, lump in enumerate(lumps):
        finger = Finger(body(lump))
        first.append(finger.forces(FIRST))
        guess = lump + random.normal(0, 3e-3, 2)
        around.append(lump - guess)
        second.append(finger.forces(SECOND, guess))
        print(f"\rlearning: body {number + 1} of {TRAINING}", end="", flush=True)
    print()
    return tuple(
        Ridge(np.array([felt(f, random) for f in forces for _ in range(COPIES)]), np.repeat(answers, COPIES, axis=0))
        for forces, answers in ((first, lumps), (second, around)))


def find(model, policy, random):
    """Where the learned policy says that the lump is, and the finger that it used."""
    finger = Finger(model)
    guess = policy[0](felt(finger.forces(FIRST), random))[0]
    guess = guess + policy[1](felt(finger.forces(SECOND, guess), random))[0]
    return guess, finger


def scripted(model, seed):
    """The same of the simulator's own fingertip, from its four marks."""
    session = palpate.Session(model)
    ticks = session.perform("expert", seed=seed)
    marked = (ticks["buttons"] & palpate.MARK) != 0
    marks = ticks["position"][marked & ~np.roll(marked, 1)]
    middle = marks[:, [0, 2]].mean(axis=0) if len(marks) else np.array([np.nan, np.nan])
    return middle, len(ticks)


def draw(output, lumps, errors, seconds, last):
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5))
    names = ["no finger", "scripted", "learned"]
    left.boxplot([1e3 * errors[n] for n in names], labels=names)
    for i, name in enumerate(names):
        left.plot(np.full(len(lumps), i + 1) + np.linspace(-0.15, 0.15, len(lumps)), 1e3 * errors[name], ".", color="#cc6677")
    left.set(ylabel="distance from the lump's middle [mm]", ylim=(0, None),
             title=f"{len(lumps)} bodies; {seconds['scripted']:.0f} s scripted, {seconds['learned']:.0f} s learned")
    left.grid(alpha=0.3, axis="y")
    lump, finger, guess, marked = last
    pressed = 1e3 * np.array(finger.pressed)
    right.add_patch(plt.Circle(1e3 * lump, 7, color="#ddcc77", label="lump"))
    right.plot(*pressed[:9].T, "o", color="#4477aa", label="first presses")
    right.plot(*pressed[9:].T, "s", color="#228833", label="second presses")
    right.plot(*(1e3 * guess), "x", color="black", ms=10, mew=2, label="learned")
    right.plot(*(1e3 * marked), "+", color="#cc6677", ms=12, mew=2, label="scripted")
    right.set(xlabel="x [mm]", ylabel="z [mm]", aspect="equal", xlim=(-25, 25), ylim=(-25, 25), title="the last of them, from above")
    right.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.02, 0.5))
    figure.tight_layout()
    figure.savefig(output, dpi=120)


def main():
    random = np.random.default_rng(1)
    policy = learn(random)
    lumps = somewhere(random, TESTS)
    errors = {"no finger": np.linalg.norm(lumps, axis=1), "scripted": np.zeros(TESTS), "learned": np.zeros(TESTS)}
    ticks = {"scripted": [], "learned": []}
    for i, lump in enumerate(lumps):
        model = body(lump)
        guess, finger = find(model, policy, random)
        marked, took = scripted(model, i)
        errors["learned"][i], errors["scripted"][i] = np.linalg.norm(guess - lump), np.linalg.norm(marked - lump)
        ticks["learned"].append(finger.session.ticks)
        ticks["scripted"].append(took)
        print(f"body {i + 1} of {TESTS}: learned {1e3 * errors['learned'][i]:.1f} mm off, scripted {1e3 * errors['scripted'][i]:.1f} mm")
    seconds = {name: np.mean(t) * palpate.TICK_SECONDS for name, t in ticks.items()}
    for name in ("no finger", "scripted", "learned"):
        e = 1e3 * errors[name]
        print(f"{name}: median {np.nanmedian(e):.1f} mm, worst {np.nanmax(e):.1f} mm"
              + (f", {seconds[name]:.1f} s of palpation" if name in seconds else ""))
    output = sys.argv[1] if len(sys.argv) > 1 else "learned_palpation.png"
    draw(output, lumps, errors, seconds, (lumps[-1], finger, guess, marked))
    print(output)


if __name__ == "__main__":
    main()
