"""Runs the examples of docs/python.md in their order, as a reader who copies them would."""
import contextlib
import io
import os
import re
import shutil
import sys
import unittest

import support
from support import MESH, SOURCE

support.need()
MISSING = []
PAGE = SOURCE / "docs" / "python.md"
BLOCK = re.compile(r"(?:<!-- needs (\w+) -->\n)?```python\n(.*?)```", re.DOTALL)


class Examples(support.WithFolder):
    def test_run_as_they_stand(self):
        text = PAGE.read_text()
        blocks = list(BLOCK.finditer(text))
        self.assertEqual(len(blocks), text.count("```python"))
        self.assertGreater(len(blocks), 5)
        shutil.copy(MESH, self.folder / "in.msh")
        names = {"__name__": "__main__"}
        printed = io.StringIO()
        with contextlib.chdir(self.folder), contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            for block in blocks:
                needs, code = block.groups()
                if needs and not support.there(needs):
                    MISSING.append(f"python3-{needs}")
                    continue
                line = text[: block.start(2)].count("\n")
                exec(compile("\n" * line + code, PAGE, "exec"), names)  # noqa: S102
        made = set(os.listdir(self.folder))
        self.assertLessEqual({"out.msh", "winslow.msh", "wing.vtu"}, made)
        self.assertLessEqual(set() if MISSING else {"from-meshio.msh", "disk.msh"}, made)
        for words in ("9 of 9 valid", "did you mean 'energy'?", "distortion 0."):
            self.assertIn(words, printed.getvalue())


if __name__ == "__main__":
    well = unittest.main(verbosity=2, exit=False).result.wasSuccessful()
    if well and MISSING:
        support.skip(f"{', '.join(MISSING)} missing, so some of the page's examples were left out (deploy/setup test)")
    sys.exit(0 if well else 1)
