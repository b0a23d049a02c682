"""The checks of the tree say nothing about good code, and name file and line of each fault that is put into a copy of it.

    checks_test.py ROOT
"""
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(sys.argv[1])
DEEP = """int f(int a)
{
    for (int i = 0; i < a; ++i) {
        if (a > 1) {
            while (a < 2) {
                if (a == i) {
                    return 1;
                }
            }
        }
    }
    return 0;
}
"""
LONG = "int f()\n{\n    int a = 0;\n" + 80 * "    ++a;\n" + "    return a;\n}\n"

# script, file of the tree, what is put at its end (or in a file of its own), what the check must say
FAULTS = [
    ("check_arrows", "volume/geometry.h", "#include <haptics/tick.h>\n", "volume/ must not include haptics/"),
    ("check_arrows", "chainmail/lattice.h", '#include "haptics/tick.h"\n', "chainmail/ must not include haptics/"),
    ("check_arrows", "render/picture.cpp", "#  include <haptics/tick.h>\n", "render/ must not include haptics/"),
    ("check_arrows", "channel/layout.h", "#include <render/viewer.h>\n", "channel/ must not include render/"),
    ("check_arrows", "haptics/servo.cpp", "#include <vtkActor.h>\n", "vtkActor.h belongs in reference, render/ only"),
    ("check_arrows", "apps/main.cpp", "#include <openvdb/openvdb.h>\n", "openvdb/openvdb.h belongs in volume/ only"),
    ("check_arrows", "haptics/dffb.cpp", "#include <apps/command.h>\n", "haptics/ must not include apps/"),
    ("check_sizes", "volume/new.cpp", DEEP, "loops and branches 4 deep"),
    ("check_sizes", "volume/new.h", "struct S {\n" + DEEP + "};\n", "loops and branches 4 deep"),
    ("check_sizes", "apps/new.cpp", LONG, "a function has at most 80"),
    ("check_sizes", "apps/new.cpp", "namespace a::b {\n" + LONG + "}\n", "a function has at most 80"),
    ("check_sizes", "tests/volume/new.cpp", 530 * "// line\n", "a file has at most"),
]
# Looks like a fault and is none.
INNOCENT = [
    ("check_arrows", "haptics/servo.cpp", "// #include <vtkActor.h>\n"),
    ("check_arrows", "haptics/servo.cpp", "#include <volume/geometry.h>\n#include <vector>\n"),
    ("check_sizes", "apps/new.cpp", 'const char* text = R"(' + DEEP + ')";\n' + DEEP.replace("if (a > 1)", "")),
    ("check_sizes", "apps/new.cpp", "namespace a {\n" + 90 * "int x();\n" + "}\n"),
]


def run(script, root):
    done = subprocess.run([sys.executable, ROOT / "scripts" / (script + ".py"), root], capture_output=True, text=True)
    return done.returncode, done.stdout


def said(script, name, text):
    """What a check says about the tree's file `name` with `text` at its end, and its exit status."""
    with tempfile.TemporaryDirectory() as folder:
        copy = pathlib.Path(folder) / name
        copy.parent.mkdir(parents=True)
        if (ROOT / name).exists():
            copy.write_bytes((ROOT / name).read_bytes())
        with copy.open("a", encoding="utf-8") as file:
            file.write(text)
        return run(script, folder)


def failures():
    for script, name, text, expected in FAULTS:
        status, out = said(script, name, text)
        if status != 1 or f"{name}:" not in out or expected not in out:
            yield f"{script} missed in {name}: {expected}\n  it said: {out.strip()}"
    for script, name, text in INNOCENT:
        status, out = said(script, name, text)
        if status != 0:
            yield f"{script} blames {name} wrongly: {out.strip()}"


found = list(failures())
print("\n".join(found) if found else f"{len(FAULTS)} faults caught, {len(INNOCENT)} times rightly silent")
sys.exit(1 if found else 0)
