"""What measurements of forces share: bodies from arrays of labels, and a ball that presses them. Needs the build dev."""
import csv
import io
import json
import pathlib
import subprocess
import sys

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "build/dev/lib/python3/dist-packages"))
import palpate  # noqa: E402

FAT_ON_BONE = {1: "fat", 2: ("base", "bone"), 3: ("aim", "fat")}


def save(file, labels, voxel, origin, names=None, turned=np.eye(3), **more):
    """Saves a volume; voxel: its size [m], origin: the middle of the first one [m]."""
    affine = np.eye(4)
    affine[:3, :3] = turned * voxel
    affine[:3, 3] = origin
    palpate.Volume.from_numpy(labels, affine, names or FAT_ON_BONE, **more).save(file)


def scene(volume, radius, entry, aim, model='setting = "SETTING"'):
    """A scene in which a ball [mm] presses the structure "aim" of a file from `entry` to `aim` [mm]."""
    entry, aim = ([float(x) for x in place] for place in (entry, aim))
    return f"""
        name = "pressed"
        volume.file = "{volume}"
        tool = {{kind = "sphere", radius_mm = {radius}}}
        safety.device = "ideal"
        dffb.mode = "off"
        target = {{structure = "aim", entry_mm = {entry}, aim_mm = {aim}}}
        model.level = "elastic"
        model.{model}
        """


def model_of(setting):
    """What a scene says for a setting, or for MMxNODES: spacing_mm and window of [model.elastic]."""
    if "x" not in setting:
        return f'setting = "{setting}"'
    spacing, window = setting.split("x")
    return f"elastic = {{spacing_mm = {spacing}, window = {window}}}"


def session(text, setting):
    """A session in a scene at a setting, or at MMxNODES."""
    return palpate.Session(palpate.Scene.parse(text.replace('setting = "SETTING"', model_of(setting))))


def turn(axis, degrees):
    """Matrix of a turn about an axis."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    j, k = [i for i in range(3) if i != axis]
    out = np.eye(3)
    out[j, j] = out[k, k] = c
    out[j, k], out[k, j] = -s, s
    return out


def run(program, *words):
    """Standard output of a program of the build."""
    return subprocess.run([ROOT / "build/dev/bin" / program, *words], check=True, stdout=subprocess.PIPE, text=True).stdout


def pressed(file, radius, depths, hold=0.2, side=0.0):
    """Forces along y [N] by `palpate press` at each depth [mm], held for `hold` seconds; side: along x and z [mm]."""
    speed, place, seconds = 20.0, -1.0, 0.0  # mm/s, mm, s
    rows, looks = [(seconds, place)], []
    for depth in depths:
        seconds += (depth - place) / speed
        rows += [(seconds, depth), (seconds + hold, depth)]
        seconds += hold
        place = depth
        looks.append(seconds)
    path = file.with_name("path.csv")
    path.write_text("seconds,x_mm,y_mm,z_mm\n" + "".join(f"{t:.6f},{side},{d - radius:.6f},{side}\n" for t, d in rows))
    samples = list(csv.DictReader(io.StringIO(run("palpate", "press", file, "--path", path, "--csv", "-"))))
    times = np.array([float(sample["seconds"]) for sample in samples])
    return np.array([-float(samples[np.abs(times - t).argmin()]["force_y_n"]) for t in looks])


def reference_forces(text, folder, radius, depths, size=2):
    """The same by finite elements of `size` [mm] at the ball, of a body that is alike on both sides of x = 0 and of z = 0."""
    file = pathlib.Path(folder) / "reference.toml"
    file.write_text(text.replace("SETTING", "default"))
    out = run("palpate-reference", file, "--law", "neo-hookean", "--size", str(size), "--radius-mm", str(radius), "--mirrored", "xz", "--looks",
              ",".join(map(str, depths)), "--json", "-")
    return np.array([-look["force_n"][1] for look in json.loads(out)["looks"]])
