"""The checks of the tree say nothing about good code, and name file and line of each fault that is put into a copy of it.

    checks_test.py ROOT
"""
import pathlib
import shutil
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
TABLE = "\n| key | meaning |\n|---|---|\n| `x` | what it is |\n"
MEANING = "\n| `--json` key | meaning |\n|---|---|\n"
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
    ("check_translations", "trainer/screens.cpp", 'void f() { words("Not translated at all"); }\n', "goes past tr()"),
    ("check_translations", "trainer/widgets.cpp", 'void f() { ImGui::Button("Close"); }\n', "goes past tr()"),
    ("check_translations", "render/coach.cpp", 'std::string f() { return "Touch the skin"; }\n', "goes past tr()"),
    ("check_tables", "docs/press.md", TABLE + "| `y` | 0.0 (0.0 to 0.1) | 0.0 | -0.71 |\n", "4 columns under a header of 2"),
    ("check_tables", "README.md", TABLE + "| `y` |\n", "1 columns under a header of 2"),
    ("check_tables", "docs/score.md", MEANING + "| `total` | 94.6 (90.7 to 98.1) |\n", "say in words what it is"),
    ("check_tables", "docs/score.md", MEANING + "| `totals` | sum of the points |\n", "there is no measure `totals`"),
    ("check_tables", "haptics/measures.cpp", '    {"new_mm", "new mm", 1, none},\n', "`new_mm` is not explained"),
]
# Looks like a fault and is none.
INNOCENT = [
    ("check_arrows", "haptics/servo.cpp", "// #include <vtkActor.h>\n"),
    ("check_arrows", "haptics/servo.cpp", "#include <volume/geometry.h>\n#include <vector>\n"),
    ("check_translations", "trainer/screens.cpp", 'void f() { words(tr("Translated here")); }  // not "this one" \n'),
    ("check_sizes", "apps/new.cpp", 'const char* text = R"(' + DEEP + ')";\n' + DEEP.replace("if (a > 1)", "")),
    ("check_sizes", "apps/new.cpp", "namespace a {\n" + 90 * "int x();\n" + "}\n"),
    ("check_tables", "docs/score.md", TABLE + "| `y \\\\| z` | either |\n\n```\n| a | b |\n| c |\n```\n"),
]
# What a check reads beside the file with the fault.
BESIDE = {"check_tables": ["docs/score.md", "haptics/measures.cpp"]}


def run(script, root):
    done = subprocess.run([sys.executable, ROOT / "scripts" / (script + ".py"), root], capture_output=True, text=True)
    return done.returncode, done.stdout


def said(script, name, text):
    """What a check says about the tree's file `name` with `text` at its end, and its exit status."""
    with tempfile.TemporaryDirectory() as folder:
        for one in {name, *BESIDE.get(script, [])}:
            copy = pathlib.Path(folder) / one
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes((ROOT / one).read_bytes() if (ROOT / one).exists() else b"")
        with (pathlib.Path(folder) / name).open("a", encoding="utf-8") as file:
            file.write(text)
        return run(script, folder)


def said_of_catalogue(change):
    """What check_translations says about a copy of all that it reads, after `change` of the copy's folder."""
    with tempfile.TemporaryDirectory() as folder:
        for part in ("apps", "base", "haptics", "render", "trainer", "training/cases", "training/curricula", "datasets/tables", "datasets/scenes", "scripts", "translations"):
            shutil.copytree(ROOT / part, pathlib.Path(folder) / part)
        change(pathlib.Path(folder))
        return run("check_translations", folder)


def edit(file, old, new):
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))


CATALOGUE = [
    (lambda root: None, 0, ""),
    (lambda root: edit(root / "trainer/state.cpp", 'marked("Start")', 'marked("Start at once")'), 1, "'Start at once' is not translated"),
    (lambda root: edit(root / "translations/de.po", 'msgstr "Beginnen"', 'msgstr ""'), 1, "'Start' is not translated"),
    (lambda root: edit(root / "translations/de.po", "von 100 Punkten", "von {} Punkten"), 1, "its translation"),
    (lambda root: edit(root / "training/cases/cyst/case.toml", "Reach the cyst,", "Go to the cyst,"), 1, "'Go to the cyst,"),
    (lambda root: edit(root / "datasets/scenes/ct-core-biopsy.toml", 'structure = "lesion"', 'structure = "metastasis"'), 1, "'metastasis' is not translated"),
]


def failures():
    for change, expected, words in CATALOGUE:
        status, out = said_of_catalogue(change)
        if status != expected or words not in out:
            yield f"check_translations: expected {words!r}, it said: {out.strip()}"
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
