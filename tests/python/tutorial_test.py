"""The blocks of docs/python.md run, one after the other."""

import re
import subprocess
import sys
import unittest

from common import SOURCE, InFolder


class Tutorial(InFolder):
    def test_every_block_of_docs_python_runs(self):
        text = (SOURCE / "docs" / "python.md").read_text(encoding="utf-8")
        blocks = re.findall(r"^```python\n(.*?)^```", text, re.S | re.M)
        self.assertGreater(len(blocks), 8)
        script = self.folder / "tutorial.py"
        script.write_text("\n".join(blocks))
        done = subprocess.run([sys.executable, script], cwd=self.folder, capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("None None tool.radius_mm", done.stdout)
        self.assertRegex(done.stdout, r"0\.\d\d N at 4\.0 mm")


if __name__ == "__main__":
    unittest.main()
