"""The examples of docs/python.md, run in the order in which they stand, as somebody would who copies them."""
import contextlib
import io
import os
import re
import shutil
import unittest

import support
from support import MESH, SOURCE

support.need()
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
        printed, missing = io.StringIO(), []
        with contextlib.chdir(self.folder), contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            for block in blocks:
                needs, code = block.groups()
                if needs and not support.there(needs):
                    missing.append(f"python3-{needs}")
                    continue
                line = text[: block.start(2)].count("\n")
                exec(compile("\n" * line + code, PAGE, "exec"), names)  # noqa: S102
        made = set(os.listdir(self.folder))
        self.assertLessEqual({"out.msh", "winslow.msh", "wing.vtu"} | (set() if missing else {"from-meshio.msh", "disk.msh"}), made)
        for words in ("9 of 9 valid", "did you mean 'energy'?", "distortion 0."):
            self.assertIn(words, printed.getvalue())
        if missing:
            self.skipTest(f"examples that need {', '.join(missing)} were left out (deploy/setup test)")


if __name__ == "__main__":
    unittest.main(verbosity=2)
