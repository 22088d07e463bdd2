"""The manual pages."""
import shutil
import sys
import unittest

from help_words import COMMANDS, OPTIONS, shell
from programs import WithFolder, run


class Manual(WithFolder):
    def test_pages_are_complete_and_man_does_not_complain(self):
        self.assertEqual(run("man", "--all", self.folder).returncode, 0)
        pages = {path.name: path for path in self.folder.iterdir()}
        self.assertEqual(set(pages), {"varimesh.1", *(f"varimesh-{name}.1" for name in COMMANDS)})
        for name, page in pages.items():
            done = shell("man", "--warnings", "--encoding=UTF-8", "-l", page)
            self.assertEqual((done.returncode, done.stderr), (0, ""), name)
            self.assertIn("EXAMPLES", done.stdout)
        text = shell("man", "-l", pages["varimesh-optimise.1"]).stdout
        self.assertEqual([option for option in OPTIONS if option not in text], [])
        self.assertEqual(run("man", "optimise").stdout, pages["varimesh-optimise.1"].read_text())
        self.assertEqual(run("man", "fly").returncode, 2)


if __name__ == "__main__":
    if not shutil.which("man"):
        print("SKIPPED: man is missing (deploy/setup test)")
        sys.exit(77)
    unittest.main(verbosity=2)
