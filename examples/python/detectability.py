"""How stiff and how deep a lump may be and still be felt: a sweep, and the least difference of force that fingers tell apart.

    PYTHONPATH=build/release/lib/python3/dist-packages /usr/bin/python3 examples/python/detectability.py [OUTPUT.png]

Writes detectability.png, and the sweep's table to the folder beside it. A minute or two; a second run reads the table.
"""

import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import palpate

DIAMETER = 10.0                              # of the lump [mm]
STIFFNESS = [4.5, 6.4, 10.4, 16.4, 42.5]     # [kPa]; fibroadenoma to high-grade carcinoma: Samani 2007
DEPTHS = [4.0, 6.0, 8.0, 11.0, 15.0]         # from the surface to the lump [mm]
JUST_NOTICEABLE = [7.0, 10.0]                # of a force [%]: at best, and commonly; docs/sweeps.md


def main():
    output = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "detectability.png")
    cases = [{"tissue.idc_high_grade.youngs_kpa": stiffness, "insert.lump.centre_mm.y": depth + DIAMETER / 2}
             for depth in DEPTHS for stiffness in STIFFNESS]
    result = palpate.sweep(
        "find-lump", cases, folder=output.with_suffix(""),
        procedure={"kind": "press", "depth_mm": 6, "speed_mm_s": 30},
        outputs=["force_n", "reference_force_n", "force_n_change_pct"],
        set={"volume.parameters.width_mm": 64, "volume.voxel_mm": 2, "model.setting": "fast",
             "insert.lump.diameter_mm": DIAMETER, "insert.lump.centre_mm.x": 0, "insert.lump.centre_mm.z": 0},
        reference={"insert.lump.tissue": "fat"},
        progress=lambda done, of: print(f"\r{done} of {of} cases", end="", flush=True))
    print()
    for row in result.failed:
        print(f"case {row['case']} failed: {row['error']}")
    change = np.array([np.nan if v is None else v for v in result["force_n_change_pct"]], float)
    change = change.reshape(len(DEPTHS), len(STIFFNESS))

    figure, axes = plt.subplots(figsize=(7, 5))
    image = axes.pcolormesh(range(len(STIFFNESS)), range(len(DEPTHS)), change, cmap="viridis", shading="nearest")
    for i, row in enumerate(change):
        for j, value in enumerate(row):
            axes.text(j, i, f"{value:.1f}", ha="center", va="center", color="white" if value < 0.6 * np.nanmax(change) else "black")
    axes.contour(change, levels=JUST_NOTICEABLE, colors=["#ffffff", "#ffcc66"], linewidths=2)
    handles = [plt.Line2D([], [], color=colour, linewidth=2) for colour in ("#ffffff", "#ffcc66")]
    axes.legend(handles, [f"felt from {level:g} % on" for level in JUST_NOTICEABLE], loc="upper center", facecolor="#777777",
                labelcolor="white", fontsize=8, ncol=2, bbox_to_anchor=(0.5, -0.14))
    axes.set_xticks(range(len(STIFFNESS)), [f"{s:g}" for s in STIFFNESS])
    axes.set_yticks(range(len(DEPTHS)), [f"{d:g}" for d in DEPTHS])
    axes.invert_yaxis()
    axes.set(xlabel="Young's modulus of the lump [kPa]", ylabel="depth of its nearest point [mm]",
             title=f"More force over a lump of {DIAMETER:g} mm in fat, fingertip 6 mm deep")
    figure.colorbar(image, label="force above that of fat alone [%]")
    figure.tight_layout()
    figure.savefig(output, dpi=120)
    felt = int(np.count_nonzero(change >= JUST_NOTICEABLE[1]))
    print(f"{felt} of {change.size} lumps change the force by {JUST_NOTICEABLE[1]:g} % or more; {output}")


if __name__ == "__main__":
    main()
