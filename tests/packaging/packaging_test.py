"""One version everywhere, and Debian's packages take all that is installed, each file once.

    packaging_test.py [INSTALLED]      INSTALLED: the prefix of `cmake --install`; without it the versions and files alone
"""

import fnmatch
import pathlib
import re
import subprocess
import sys
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
INSTALLED = pathlib.Path(sys.argv.pop(1)) if len(sys.argv) > 1 and pathlib.Path(sys.argv[1]).is_dir() else None
# In a package, but not installed by CMake.
NOT_BY_CMAKE = {"usr/share/doc/palpate/site": "debian/rules calls scripts/site"}
# Beside pages that belong to other packages.
EXCLUDED = {"palpate": ("palpate-view.1", "palpate-reference.1", "palpate-mesh.1")}


def text(name):
    return (ROOT / name).read_text(encoding="utf-8")


class Versions(unittest.TestCase):
    def setUp(self):
        self.version = re.search(r"project\(palpate VERSION ([\d.]+)", text("CMakeLists.txt"))[1]

    def test_all_say_the_version_of_cmake(self):
        self.assertEqual(re.match(r"palpate \(([\d.]+)\)", text("debian/changelog"))[1], self.version)
        self.assertEqual(re.search(r"^## ([\d.]+)", text("CHANGELOG.md"), re.M)[1], self.version)
        self.assertEqual(re.search(r'<release version="([\d.]+)"', text("packaging/org.palpate.Palpate.metainfo.xml"))[1], self.version)

    def test_no_other_file_has_it_by_hand(self):
        listed = subprocess.run(["git", "-C", ROOT, "grep", "-lF", f"palpate {self.version}", "--", "*.cpp", "*.h", "*.cmake", "*.py", "scripts"],
                                capture_output=True, text=True).stdout.split()
        self.assertEqual([f for f in listed if not f.startswith("tests/") and f != "base/build.h"], [])


class Files(unittest.TestCase):
    def test_desktop_entry_and_appstream_are_valid(self):
        for command in (["desktop-file-validate", ROOT / "packaging/palpate.desktop"],
                        ["appstreamcli", "validate", "--no-net", ROOT / "packaging/org.palpate.Palpate.metainfo.xml"]):
            done = subprocess.run(command, capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_build_depends_are_what_install_packages_installs(self):
        script = text("scripts/install-packages")
        field = re.search(r"^Build-Depends:\n((?: .*\n)+)", text("debian/control"), re.M)[1]
        for package in re.findall(r"^ ([\w.+-]+)", field, re.M):
            if package != "debhelper-compat":
                self.assertRegex(script, rf"(?<![\w-]){re.escape(package)}(?![\w-])", package)


@unittest.skipUnless(INSTALLED, "scripts/check-package gives what is installed")
class Installed(unittest.TestCase):
    def test_every_file_is_in_one_package(self):
        # Without Debian's folder of its architecture, and without usr/.
        files = {p.relative_to(INSTALLED).as_posix() for p in INSTALLED.rglob("*") if not p.is_dir()}
        owners = {f: [] for f in files}
        elsewhere = {line.removeprefix("usr/") for line in text("debian/not-installed").splitlines()}
        for listing in sorted((ROOT / "debian").glob("*.install")):
            for line in listing.read_text(encoding="utf-8").split():
                if line in NOT_BY_CMAKE:
                    continue
                taken = self.matching(line, files)
                self.assertTrue(taken, f"{listing.name}: nothing installed is {line}")
                for file in taken:
                    if not file.endswith(EXCLUDED.get(listing.stem, ("\0",))):
                        owners[file].append(listing.stem)
        for file, packages in owners.items():
            if file not in elsewhere:
                self.assertEqual(len(set(packages)), 1, f"{file} is in {packages}")

    def matching(self, pattern, files):
        pattern = pattern.removeprefix("usr/")
        both = {pattern, pattern.replace("lib/*/", "lib/")}
        return {f for f in files for p in both if fnmatch.fnmatch(f, p) or fnmatch.fnmatch(f, p + "/*")}


if __name__ == "__main__":
    unittest.main()
