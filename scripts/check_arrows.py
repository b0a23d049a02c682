#!/usr/bin/env python3
"""Checks which folder includes which, and how long files are; docs/architecture.md explains the permitted arrows.

    check_arrows.py [ROOT]      exit status 1 and one line per fault
"""
import pathlib
import re
import sys

# A folder may include itself and these.
ARROWS = {
    "base": set(),
    "volume": {"base"},
    "volume/prepare": {"base", "volume", "datasets"},
    "occupancy": {"volume"},
    "chainmail": {"volume", "occupancy"},
    "datasets": {"base", "volume"},
    "channel": {"base"},
    "ultrasound": {"base", "channel"},
    "ct": {"base", "channel"},
    "render": {"base", "channel", "ultrasound", "ct"},
    "haptics": {"base", "volume", "occupancy", "chainmail", "datasets", "channel", "ultrasound"},
    "haptics/falcon": {"base", "volume", "datasets", "haptics"},
    "session": {"base", "volume", "datasets", "haptics", "haptics/falcon", "channel"},
    "report": {"base", "volume", "datasets", "haptics"},
    "training": {"base", "volume", "datasets", "haptics", "session", "report"},
    "command": {"base", "session"},
    "studies": {"base", "volume", "occupancy", "chainmail", "datasets", "haptics", "session", "report", "command", "channel", "ultrasound"},
    "planner": {"base", "chainmail", "datasets", "haptics", "session", "command", "studies"},
    "sweep": {"base", "volume", "datasets", "haptics", "session", "report", "command"},
    "python": {
        "base", "volume", "volume/prepare", "datasets", "channel", "haptics", "session", "ultrasound", "planner", "report", "sweep",
    },
    "trainer": {"base"},
    "reference/tetgen": {"base", "reference"},
    "reference": {"base", "volume", "occupancy", "chainmail", "datasets", "haptics", "studies"},
    "apps": {
        "base", "volume", "volume/prepare", "datasets", "haptics", "haptics/falcon", "channel", "session", "report", "command",
        "studies", "planner", "sweep", "training", "trainer", "ultrasound", "ct", "render", "reference", "reference/tetgen",
    },
}
# Third-party headers that stay in one folder.
OWNERS = {
    "openvdb/": {"volume"},
    "pybind11/": {"python"},
    "dcmtk/": {"volume"},
    "openjpeg": {"volume"},
    "itk": {"tests"},  # an independent reader to compare with
    "vtk": {"render", "reference"},
    "GLFW/": {"render", "trainer"},
    "imgui": {"trainer"},
    "stb/": {"trainer"},
    "sqlite3": {"haptics", "sweep", "training"},
    "libusb": {"haptics"},
    "CGAL/": {"reference"},
    "getfem/": {"reference"},
    "gmm/": {"reference"},
    "Bullet": {"apps"},
    "btBullet": {"apps"},
    "dmumps_c": {"reference"},
    "tetgen.h": {"reference"},
}
MOST_LINES = 520
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^">]+)[">]')


def folder_of(path):
    """The folder of ARROWS that `path` (relative) lies in, or None."""
    inside = [f for f in ARROWS if path.startswith(f + "/")]
    return max(inside, key=len, default=None)


def faults(root):
    for path in sorted(p for f in ARROWS if "/" not in f for p in (root / f).rglob("*") if p.suffix in (".h", ".cpp", ".inl")):
        name = path.relative_to(root).as_posix()
        folder = folder_of(name)
        lines = path.read_text(encoding="utf-8").splitlines()
        if len(lines) > MOST_LINES:
            yield f"{name}: {len(lines)} lines: a file has at most {MOST_LINES}"
        for number, line in enumerate(lines, 1):
            match = INCLUDE.match(line)
            if not match:
                continue
            included = match.group(1)
            target = folder_of(included)
            if target and target != folder and target not in ARROWS[folder]:
                yield f"{name}:{number}: {folder}/ must not include {target}/ ({included})"
            for prefix, owners in OWNERS.items():
                if included.startswith(prefix) and folder.split("/")[0] not in owners:
                    yield f"{name}:{number}: {included} belongs in {', '.join(sorted(owners))}/ only"


root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ".")
found = list(faults(root))
print("\n".join(found) if found else "the arrows between folders hold")
sys.exit(1 if found else 0)
