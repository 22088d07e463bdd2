"""Tests tests/bench/corpus. `Short` runs its short form with the real command; the others plant a command whose answers are
written down here. ctest runs this with VARIMESH and VARIMESH_SOURCE_DIR in the environment."""
import json
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

SOURCE = Path(os.environ["VARIMESH_SOURCE_DIR"])
OURS = sorted(file.stem for folder in ("tests/cases", "tests/cases/published")
              for file in (SOURCE / folder).glob("*.msh") if not file.is_symlink())

# Answers what answers.json says. "optimise" writes the mesh's name with "-out" into its output, so that `quality` knows it.
PLANTED = """#!{python}
import json, pathlib, sys
answers = json.loads(pathlib.Path(__file__).with_name("answers.json").read_text())
verb, mesh = sys.argv[1:3]
name = pathlib.Path(mesh).stem
if verb == "quality" and name == "out":
    name = pathlib.Path(mesh).read_text()
answer = answers[f"{{verb}} {{name}}" + (" split" if "split" in sys.argv else "")]
if verb == "optimise":
    pathlib.Path(sys.argv[4]).write_text(name + "-out" + ("-split" if "split" in sys.argv else ""))
print(json.dumps(answer.get("document")))
print(answer.get("errors", ""), file=sys.stderr)
sys.exit(answer.get("status", 0))
"""


def quality(invalid=0, uncertified=None, min_js=0.5, mean_js=0.8, elements=100):
    uncertified = invalid if uncertified is None else uncertified
    return {"document": {"mesh": {"elements": elements}, "quality": {
        "invalid_elements": invalid, "min_scaled_jacobian": min_js, "mean_scaled_jacobian": mean_js,
        "certified": {"valid": elements - uncertified, "invalid": invalid, "undecided": uncertified - invalid}}}}


def optimised(status=0, left=0, **more):
    document = {"stop_reason": "converged", "before": {}} | more
    if left:
        document["left"] = {"uncertified": left, "proved": 0, "sentence": f"{left} elements are not certified valid."}
    return {"status": status, "document": document}


class Corpus(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.meshes, self.page = self.folder / "meshes", self.folder / "page.md"
        self.meshes.mkdir()
        self.command = self.folder / "varimesh"
        self.command.write_text(PLANTED.format(python=sys.executable))
        self.command.chmod(0o755)
        self.answers = {}

    def run_corpus(self, *arguments, command=None):
        (self.folder / "answers.json").write_text(json.dumps(self.answers))
        return subprocess.run([SOURCE / "tests" / "bench" / "corpus", command or self.command, *map(str, arguments)],
                              capture_output=True, text=True, env=os.environ | {"VARIMESH_CASES": "/nowhere"})

    def plant(self, name, before, result, after=None):
        (self.meshes / f"{name}.msh").touch()
        self.answers |= {f"quality {name}": before, f"optimise {name}": result, f"quality {name}-out": after or before}

    def plant_split(self, name, result, after):
        self.answers |= {f"optimise {name} split": result, f"quality {name}-out-split": after}

    def corpus(self, *arguments):
        """Runs the script on the planted meshes."""
        names = [file.stem for file in sorted(self.meshes.iterdir())]
        return self.run_corpus(*names, "--also", self.meshes, "--page", self.page, *arguments)

    def finds(self, *sentences):
        done = self.corpus()
        self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
        wrong = [line for line in done.stderr.splitlines() if line.startswith("WRONG: ")]
        self.assertEqual(len(wrong), len(sentences), done.stderr)
        for line, sentence in zip(wrong, sentences):
            self.assertIn(sentence, line)
        return done

    def finds_nothing(self):
        done = self.corpus()
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertNotIn("WRONG", done.stderr)
        return [line for line in done.stdout.splitlines() if line.startswith("| ")][1:]


class Short(Corpus):
    def test_every_file_of_the_project_keeps_the_rules_and_is_as_good_as_on_the_page(self):
        done = self.run_corpus("--short", "--time-limit", "0", command=os.environ["VARIMESH"])
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertNotIn("new:", done.stderr, "a file is missing in docs/corpus.md; run tests/bench/corpus --write")
        rows = [line.split(" | ")[0].lstrip("| ") for line in done.stdout.splitlines() if line.startswith("| ")][1:]
        self.assertEqual([row for row in rows if "," not in row], OURS)
        self.assertGreater(len(OURS), 12)


class Rules(Corpus):
    def test_a_better_mesh_breaks_none(self):
        self.plant("a", quality(invalid=3, min_js=-1), optimised(), quality(min_js=0.25))
        self.plant("b", quality(min_js=0.5, mean_js=0.8), optimised(), quality(min_js=0.4, mean_js=0.9))
        a, b = self.finds_nothing()
        self.assertIn("| a | 100 | valid | 3 → 0 | 3 → 0 | -1.0000 → 0.2500 | 0.8000 → 0.8000 |", a)
        self.assertIn("| 0.5000 → 0.4000 | 0.8000 → 0.9000 |", b)

    def test_more_invalid_elements(self):
        self.plant("a", quality(invalid=3), optimised(4, left=4), quality(invalid=4))
        self.plant_split("a", optimised(), quality())
        self.finds("a: 3 elements are invalid at first, and 4", "a: 3 elements are not certified valid at first, and 4")

    def test_fewer_certified_elements(self):
        self.plant("a", quality(invalid=0, uncertified=0), optimised(4, left=1), quality(invalid=0, uncertified=1))
        self.plant_split("a", optimised(), quality())
        self.finds("a: 0 elements are not certified valid at first, and 1")

    def test_both_jacobians_of_a_valid_file_lower(self):
        self.plant("a", quality(min_js=0.5, mean_js=0.8), optimised(), quality(min_js=0.49999, mean_js=0.79999))
        self.finds("a: the file is valid, and both Js are lower: 0.500000 → 0.499990")

    def test_both_jacobians_of_an_invalid_file_may_be_lower(self):
        self.plant("a", quality(invalid=1, min_js=-0.1, mean_js=0.8), optimised(4, left=1),
                   quality(invalid=1, min_js=-0.2, mean_js=0.7))
        self.plant_split("a", optimised(), quality())
        self.finds_nothing()

    def test_a_refusal_without_a_remedy(self):
        sentence = "varimesh: 'meshes/{}.msh': The mesh has mixed orders{}."
        for name, rest in (("helped", "; raise them to one order"), ("left", "; one order was expected")):
            self.plant(name, {"status": 3}, {"status": 3, "errors": sentence.format(name, rest)})
        done = self.finds("left: refused, and the sentence does not say what to do: The mesh has mixed orders; one order was")
        self.assertIn("| The mesh has mixed orders; one order was expected; **breaks a rule** |", done.stdout)
        self.assertIn("| The mesh has mixed orders; raise them to one order. |", done.stdout)

    def test_a_refusal_is_in_the_table(self):
        self.plant("a", {"status": 3}, {"status": 3, "errors": "varimesh: 'a.msh': The file is in pieces; copy it again."})
        line, = self.finds_nothing()
        self.assertIn("| refused |", line)
        self.assertIn("| The file is in pieces; copy it again. |", line)

    def test_elements_left_without_an_explanation(self):
        self.plant("a", quality(invalid=2), optimised(4, left=1), quality(invalid=2))
        self.plant_split("a", optimised(4), quality(invalid=2))
        self.finds("a: 2 elements are not certified valid, and the command explains 1",
                   "a, split: 2 elements are not certified valid, and the command explains 0")

    def test_an_exit_status_that_contradicts_the_result(self):
        self.plant("a", quality(invalid=2), optimised(0, left=2), quality(invalid=2))
        self.plant("b", quality(), optimised(4))
        self.plant_split("b", optimised(), quality())
        self.finds("a: the exit status is 0, and 2 elements", "b: the exit status is 4, and 0 elements")

    def test_a_crash(self):
        self.plant("a", quality(), {"status": 1, "errors": "varimesh: It broke."})
        self.finds("a: ended with status 1: It broke.")

    def test_a_run_that_does_not_end(self):
        self.plant("a", quality(), optimised())
        self.command.write_text(self.command.read_text().replace(
            'if verb == "optimise":', 'if verb == "optimise":\n    import time; time.sleep(1000)'))
        done = self.corpus("--time-limit", "0.1", "--grace", "2")
        self.assertEqual(done.returncode, 1)
        self.assertIn("| did not end |", done.stdout)
        self.assertIn("WRONG: a: did not end", done.stderr)

    def test_what_is_left_is_split_on_a_second_line(self):
        self.plant("a", quality(invalid=2), optimised(4, left=2), quality(invalid=2))
        self.plant_split("a", optimised(), quality(elements=103))
        plain, split = self.finds_nothing()
        self.assertIn("| a | 100 | left some | 2 → 2 |", plain)
        self.assertIn("| a, split | 100 → 103 | valid | 2 → 0 |", split)


class Page(Corpus):
    HEAD = "| file | elements | status | invalid | not certified | min Js | mean Js | seconds | remarks |\n" + "|---" * 9 + "|\n"

    def write(self, *lines):
        self.page.write_text("# Title\n\n" + self.HEAD + "".join(f"{line}\n" for line in lines) + "\nThe end.\n")

    def test_says_what_is_worse_than_on_it(self):
        self.write("| a | 100 | valid | 3 → 0 | 3 → 0 | -1.0000 → 0.9000 | 0.8000 → 0.9000 | 0.1 |  |",
                   "| b | 100 | left some | 3 → 1 | 3 → 1 | -1.0000 → -0.2000 | 0.8000 → 0.9000 | 0.1 |  |",
                   "| c | 100 | valid | 3 → 0 | 3 → 0 | -1.0000 → 0.9000 | 0.8000 → 0.9000 | 0.1 |  |")
        self.plant("a", quality(invalid=3), optimised(), quality(min_js=0.89, mean_js=0.89))
        self.plant("b", quality(invalid=3), optimised(4, left=2), quality(invalid=2))
        self.plant("c", quality(invalid=3), {"status": 3, "errors": "varimesh: 'c.msh': No; take another."})
        self.plant_split("b", optimised(), quality())
        self.finds("a: worse than on the page: both Js are lower: min 0.9 → 0.89, mean 0.9 → 0.89",
                   "b: worse than on the page: 1 elements were invalid, and 2 are",
                   "b: worse than on the page: 1 elements were not certified valid, and 2 are",
                   "c: worse than on the page: the status was 'valid' and is 'refused'")

    def test_what_is_as_good_or_better_is_not_wrong(self):
        self.write("| a | 100 | left some | 3 → 1 | 3 → 1 | -1.0000 → -0.2000 | 0.8000 → 0.9000 | 0.1 |  |",
                   "| b |  | refused |  |  |  |  | 0.1 | No; take another. |")
        self.plant("a", quality(invalid=3), optimised(), quality(min_js=0.3, mean_js=0.85))
        self.plant("b", quality(), optimised())
        self.finds_nothing()

    def test_is_written(self):
        self.write("| a | 100 | left some | 3 → 1 | 3 → 1 | 0 → 0 | 0 → 0 | 0.1 |  |",
                   "| a, split | 100 | left some | 3 → 1 | 3 → 1 | 0 → 0 | 0 → 0 | 0.1 |  |",
                   "| z | 7 | valid | 3 → 0 | 3 → 0 | 0 → 0 | 0 → 0 | 0.1 |  |")
        self.plant("a", quality(invalid=3), optimised(), quality(min_js=0.3))
        done = self.corpus("--write")
        self.assertEqual(done.returncode, 0, done.stderr)
        text = self.page.read_text()
        self.assertTrue(text.startswith("# Title\n\n" + self.HEAD + "| a | 100 | valid | 3 → 0 |"), text)
        self.assertTrue(text.endswith("\n| z | 7 | valid | 3 → 0 | 3 → 0 | 0 → 0 | 0 → 0 | 0.1 |  |\n\nThe end.\n"), text)
        self.assertNotIn("split", text)

    def test_without_a_table_is_not_written(self):
        self.page.write_text("# Title\n")
        self.plant("a", quality(), optimised())
        done = self.corpus("--write")
        self.assertEqual(done.returncode, 1)
        self.assertIn("has no table to replace", done.stderr)
        self.assertEqual(self.page.read_text(), "# Title\n")


class Choice(Corpus):
    def test_says_which_folders_are_missing(self):
        for name in OURS:
            self.plant(name, quality(), optimised())
        done = self.run_corpus("--page", self.page)
        self.assertEqual(done.returncode, 0, done.stderr)
        for folder in ("msh", "other", "pairs"):
            self.assertIn(f"SKIPPED: there is no folder /nowhere/real/{folder}; set VARIMESH_CASES", done.stderr)
        self.assertEqual(len(done.stdout.splitlines()), 2 + len(OURS))

    def test_of_wrong_arguments(self):
        done = self.run_corpus("no-such-mesh", "--short")
        self.assertEqual(done.returncode, 2)
        self.assertIn("there is no file no-such-mesh; there are: aerofoil_disc_p4,", done.stderr)
        done = self.run_corpus(command="/nowhere/varimesh")
        self.assertEqual(done.returncode, 2)
        self.assertIn("/nowhere/varimesh is not a program", done.stderr)


if __name__ == "__main__":
    unittest.main()
