"""Lines that benchmarks keep belong to one program."""
import sys
import tempfile
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from kept_lines import KeptLines  # noqa: E402


class Kept(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.file, self.program = Path(folder.name) / "lines", Path(folder.name) / "program"
        self.program.write_text("one")

    def kept(self, file="lines"):
        return KeptLines(self.file.with_name(file) if file else None, self.program, ("mesh", "order"))

    def test_lines_are_found_again(self):
        self.kept().add({"mesh": "a", "order": 3, "left": 0})
        self.kept().add({"mesh": "a", "order": 4, "left": 1})
        self.assertEqual(self.kept().get("a", 4)["left"], 1)
        self.assertIsNone(self.kept().get("b", 4))

    def test_lines_of_another_program_are_not_mixed_with_these(self):
        self.kept().add({"mesh": "a", "order": 3})
        self.program.write_text("two")
        with self.assertRaises(SystemExit) as end:
            self.kept()
        self.assertEqual(end.exception.code, 2)

    def test_lines_that_name_no_program_are_those_of_another(self):
        self.file.write_text('{"mesh": "a", "order": 3}\n')
        with self.assertRaises(SystemExit):
            self.kept()

    def test_without_a_file_nothing_is_kept(self):
        self.assertEqual(self.kept(None).add({"mesh": "a", "order": 3})["order"], 3)
        self.assertIsNone(self.kept(None).get("a", 3))


if __name__ == "__main__":
    unittest.main()
