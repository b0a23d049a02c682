"""Force by depth of a ball on a phantom, soft and stiff, against Hertz's law for a half-space.

    PYTHONPATH=build/release/lib/python3/dist-packages /usr/bin/python3 examples/python/force_depth.py [OUTPUT.png]

Writes force_depth.png. A few seconds.
"""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import palpate

RADIUS, DEPTH = 10e-3, 6e-3
MODULI_KPA = [2.0, 4.0, 8.0]


def press(modulus_kpa, lump):
    """(depth [m], force [N]) on the way down and on the way up."""
    scene = palpate.Scene("block").changed({
        "tissue.fat.youngs_kpa": modulus_kpa,
        "volume.voxel_mm": 2,
        "volume.parameters.tumour_diameter_mm": 20 if lump else 4,
        "volume.parameters.tumour_centre_mm": 16 if lump else 50,
        "target.aim_mm.y": 16 if lump else 50,
    })
    model = palpate.Model(scene)
    ticks = palpate.Session(model).run(palpate.press_path([0, -RADIUS, 0], [0, 1, 0], DEPTH, speed=0.01))
    depth, force = ticks["position"][:, 1] + RADIUS, -ticks["tissue_force"][:, 1]
    turn = np.argmax(depth)
    return depth[600:turn], force[600:turn], scene


def hertz(depth, modulus, poisson):
    """Force of a rigid ball on an elastic half-space (Hertz 1882; Johnson, Contact Mechanics, 4.2) [N]."""
    return 4 / 3 * modulus / (1 - poisson**2) * np.sqrt(RADIUS) * np.clip(depth, 0, None) ** 1.5


def main():
    figure, axes = plt.subplots(figsize=(7, 4.5))
    poisson = next(t["poisson_ratio"] for t in palpate.Model("block").volume.tissues if t["name"] == "fat")
    for modulus, colour in zip(MODULI_KPA, ["#4477aa", "#228833", "#cc6677"]):
        depth, force, _ = press(modulus, lump=False)
        axes.plot(1e3 * depth, force, color=colour, label=f"fat of {modulus:g} kPa")
        axes.plot(1e3 * depth, hertz(depth, 1e3 * modulus, poisson), ":", color=colour)
        with_lump = press(modulus, lump=True)
        axes.plot(1e3 * with_lump[0], with_lump[1], "--", color=colour)
        print(f"{modulus:g} kPa: {force[-1]:.3f} N at {1e3 * depth[-1]:.1f} mm, {with_lump[1][-1]:.3f} N over a lump, "
              f"{hertz(depth[-1], 1e3 * modulus, poisson):.3f} N by Hertz for a half-space")
    axes.plot([], [], "--", color="grey", label="over a stiff ball of 20 mm, 6 mm deep")
    axes.plot([], [], ":", color="grey", label="Hertz, half-space")
    axes.set(xlabel="depth of the ball [mm]", ylabel="force of the tissue [N]", xlim=(0, 1e3 * DEPTH), ylim=(0, None),
             title="A ball of 10 mm radius on a block of fat, 60 mm thick")
    axes.legend()
    axes.grid(alpha=0.3)
    figure.tight_layout()
    output = sys.argv[1] if len(sys.argv) > 1 else "force_depth.png"
    figure.savefig(output, dpi=120)
    print(output)


if __name__ == "__main__":
    main()
