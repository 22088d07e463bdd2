"""Checks the documentation: links have targets, named files exist, excerpts are in the files that they quote, and commands
run as printed, in order, in a temporary folder. ctest runs this with the name of a group."""
import contextlib
import importlib.util
import io
import os
import re
import shutil
import subprocess
import sys
import unittest
from pathlib import Path

import support
from support import CASES, SOURCE, VARIMESH, VARIMESHD, Server

PAGES = [SOURCE / "README.md", *sorted((SOURCE / "docs").glob("*.md"))]
NOTES = sorted((SOURCE / "docs" / "notes").glob("*.md"))
BLOCK = re.compile(r"(?:<!-- (?P<note>[^\n]*) -->\n)?^```(?P<kind>\w*)\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE)

# Pages whose commands are run by other tests.
ELSEWHERE = {"python.md": "tests/client/python/documentation_test.py", "workflows.md": "tests/deploy/workflows_test.py",
             "http.md": "tests/server/http/calls_test.py"}

# Blocks that are not run here, by page and first words, with the reason.
NOT_HERE = {
    ("README.md", "deploy/demo"): "sets the machine up; what every change must pass",
    ("README.md", "varimesh mesh"): "needs a CAD file; tests/client/commands/curve_test.py makes one",
    ("development.md", "tests/run"): "the tests themselves",
    ("development.md", "build/release"): "programs that take hours or need root",
    ("development.md", "tests/bench"): "builds the benchmarks, or takes hours",
    ("tutorial.md", "deploy/demo"): "the class Beginnings runs it",
    ("tutorial-cad.md", "deploy/setup"): "the class Beginnings runs it",
    ("tutorial-layers.md", "deploy/setup"): "the class Beginnings runs it",
    ("server.md", "varimeshd --listen"): "it does not end; tests/client/programs.py starts it",
    ("server.md", "varimeshd token"): "the server in it does not end; tests/client/jobs/tokens_test.py makes tokens",
    ("server.md", "varimeshd --role"): "it needs a database; tests/server/postgres/farm_test.py starts one",
    ("server.md", "AWS_SHARED_CREDENTIALS_FILE"): "it needs a bucket; tests/server/postgres/bucket_farm_test.py has one",
    ("server.md", "varimeshd migrate"): "it needs a database; tests/server/postgres/database_test.py starts one",
    ("server.md", "varimeshd backup"): "needs a state directory; tests/server/command_line/varimeshd_test.py has one",
    ("server.md", "docker build"): "deploy/test-image builds and runs it",
    ("server.md", "VARIMESHD_MAX_PRIORITY"): "needs the file above; tests/server/command_line/settings_test.py makes one",
    ("security.md", "varimesh certificates"): "the server in it does not end; tests/server/tls/calls_test.py does this",
    ("security.md", "varimeshd --listen"): "it does not end; tests/deploy/nginx_test.py starts it",
    ("operations.md", "pg_dump"): "needs a farm; tests/server/postgres/farm_faults_test.py saves and restores one",
    ("page.md", "varimesh ui"): "it does not end; tests/client/commands/ui_test.py starts it",
    ("page.md", "varimeshd --http"): "it does not end; tests/server/http/page_test.py opens the page",
    ("report.md", "varimeshd --admin"): "it does not end; tests/server/admin/admin_server_test.py starts it",
    ("geometry.md", "varimesh optimise"): "needs a CAD file; tests/client/commands/geometry_test.py makes one",
    ("geometry.md", "varimesh curve"): "needs a CAD file; tests/client/commands/curve_test.py makes one",
    ("geometry.md", "varimesh mesh"): "needs a CAD file; tests/client/commands/curve_test.py makes one",
    ("performance.md", "tests/bench/cases"): "builds the benchmarks",
    ("corpus.md", "tests/bench/corpus"): "minutes; tests/bench/published/corpus_test.py runs the short form",
    ("paper.md", "tests/bench/paper"): "an hour; tests/bench/figures/paper_test.py runs the short form",
    ("python.md", "deploy/make-wheel"): "deploy/test-wheel does this on a bare Debian",
    ("python.md", "venv/bin/pip"): "needs the wheels; tests/client/python/wheel_test.py makes and installs both",
    ("python.md", "cmake --build"): "the build tree of whoever reads; the tests import the package from theirs",
}


class Block:
    """A fenced block: its kind, its text, the comment in the line above it, and the number of the line before its text."""

    def __init__(self, page, match):
        self.kind, self.text, self.note = match["kind"], match["text"], match["note"] or ""
        self.line = page.read_text()[: match.start("text")].count("\n")
        self.where = f"{page.name}:{self.line + 1}"
        self.runs = self.kind in ("sh", "python") and not any(
            page.name == name and self.text.startswith(words) for name, words in NOT_HERE)


def blocks(page):
    text = page.read_text()
    found = [Block(page, match) for match in BLOCK.finditer(text)]
    assert 2 * len(found) == len(re.findall("^```", text, re.MULTILINE)), f"{page.name} has an unclosed block"
    return found


def prose(page):
    """The page without its blocks."""
    return BLOCK.sub("", page.read_text())


def slug(heading):
    """The anchor that GitHub gives a heading."""
    words = re.sub(r"`|\[([^]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
    return re.sub(r"[^\w\- ]", "", words).replace(" ", "-")


def anchors(page):
    return {slug(heading) for heading in re.findall(r"^#+ (.*)$", prose(page), re.MULTILINE)}


class Links(unittest.TestCase):
    def test_lead_somewhere(self):
        links = 0
        for page in PAGES + NOTES:
            for target in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
                if re.match(r"\w+:", target):
                    continue
                path, _, anchor = target.partition("#")
                file = (page.parent / path).resolve() if path else page
                self.assertTrue(file.exists(), f"{page.name}: {target}")
                if anchor:
                    self.assertIn(anchor, anchors(file), f"{page.name}: {target}")
                links += 1
        self.assertGreater(links, 50)

    def test_named_files_exist(self):
        names = 0
        for page in PAGES + NOTES:
            for name in re.findall(r"`((?:core|server|client|proto|tests|deploy|docs)/[\w./-]*)`", prose(page)):
                self.assertTrue("NAME" in name or (SOURCE / name).exists(), f"{page.name}: {name}")
                names += 1
        self.assertGreater(names, 10)

    def test_every_page_is_in_the_index(self):
        text = (SOURCE / "README.md").read_text()
        for page in PAGES[1:]:
            self.assertIn(f"](docs/{page.name})", text)

    def test_every_note_is_linked_from_a_page(self):
        text = "".join(page.read_text() for page in PAGES)
        self.assertGreater(len(NOTES), 0)
        for note in NOTES:
            self.assertIn(f"](notes/{note.name})", text)

    def test_promises_name_tests_that_there_are(self):
        tree = "".join(file.read_text(errors="ignore") for file in (SOURCE / "tests").rglob("*")
                       if file.suffix in (".cpp", ".py", ".txt") and file.name != Path(__file__).name)
        text = (SOURCE / "docs" / "security.md").read_text()
        attacks = (SOURCE / "docs" / "notes" / "attacks.md").read_text()
        rows = [line.split("|") for line in text.split("| threat |")[1].split("\n\n")[0].splitlines()[2:]]
        self.assertGreater(len(rows), 15)
        unshown = [row[1] for row in rows if "`" not in row[-2] and not row[2].startswith(" nothing:")]
        self.assertEqual(unshown, [], "promises that no test shows")
        for suite, test in re.findall(r"`(?:server|core|client|faults|deploy)\.(?:\w+/|s3\.|isolation\.|http\.|jobs\.tls\.|farm\.)?(\w+)\.?(\w*)[^`]*`", text + attacks):
            self.assertTrue(re.search(rf"\b{suite}\b", tree) and re.search(rf"\b{test}", tree), f"{suite}.{test}")
        for name in re.findall(r"attacks? (`[^|.;]*)", text + attacks):
            for attack in re.findall(r"`([a-z][^`]*)`", name):
                self.assertTrue(f'"{attack}"' in tree, attack)

    def test_every_picture_is_shown(self):
        text = "".join(page.read_text() for page in PAGES)
        folder = SOURCE / "docs" / "pictures"
        for picture in (path for path in folder.rglob("*") if path.is_file()):
            self.assertIn(f"pictures/{picture.relative_to(folder)})", text)
            self.assertLess(picture.stat().st_size, 150_000, picture.name)


class Excerpts(unittest.TestCase):
    def test_are_in_the_file_that_they_are_from(self):
        """`<!-- from FILE -->` names the quoted file. A line of three dots stands for omitted lines."""
        excerpts = 0
        for page in PAGES:
            for block in blocks(page):
                if block.kind in ("", "text", "sh", "python"):
                    continue
                match = re.fullmatch(r"from (\S+)", block.note)
                self.assertTrue(match, f"{block.where}: a block of {block.kind} must name the tested file of its text")
                whole = [line.strip() for line in (SOURCE / match[1]).read_text().splitlines()]
                place = 0
                for part in re.split(r"^\W*\.\.\.$", block.text, flags=re.MULTILINE):
                    lines = [line.strip() for line in part.strip().splitlines()]
                    place = next((i + len(lines) for i in range(place, len(whole)) if whole[i : i + len(lines)] == lines), None)
                    self.assertIsNotNone(place, f"{block.where}: {match[1]} does not have\n{part}")
                excerpts += 1
        self.assertGreater(excerpts, 2)


class WithPrograms(support.WithFolder):
    """A temporary folder, and a PATH that begins with the programs of the build tree and Debian's python3."""

    def setUp(self):
        super().setUp()
        programs = self.folder / "programs"
        programs.mkdir()
        for name, target in {"varimesh": VARIMESH, "varimeshd": VARIMESHD, "python3": sys.executable}.items():
            (programs / name).symlink_to(target)
        self.work = self.folder / "work"
        self.work.mkdir()
        self.environment = {**os.environ, "PATH": f"{programs}:{os.environ['PATH']}", "HOME": str(self.folder)}

    @staticmethod
    def has(name):
        beside = Path(VARIMESH).resolve().parent.parent / "lib" / "varimesh"  # where an installation has such programs
        return shutil.which(name) is not None or (beside / name).exists() or importlib.util.find_spec(name) is not None

    def run_page(self, page, replace=None, names=None):
        """Runs the page's blocks: each sh block as a script, all Python blocks in one interpreter. Returns the output of
        each."""
        printed = []
        for block in blocks(page):
            if not block.runs:
                continue
            if block.note.startswith("needs ") and not self.has(block.note.removeprefix("needs ")):
                print(f"SKIPPED: {block.where}: {block.note.removeprefix('needs ')} is missing (deploy/setup test)", flush=True)
                continue
            text = block.text
            for words, others in (replace or {}).items():
                text = text.replace(words, others)
            if block.kind == "sh":
                printed.append(self.run_shell(text, block))
            else:
                out = io.StringIO()
                with contextlib.chdir(self.work), contextlib.redirect_stdout(out):
                    exec(compile("\n" * block.line + text, page, "exec"), names)  # noqa: S102
                printed.append(out.getvalue())
        return printed

    def run_shell(self, text, block):
        text = "trap 'kill $(jobs -p) 2>/dev/null || true; wait' EXIT\n" + text  # ends any server that is still running
        done = subprocess.run(["bash", "-euc", text], cwd=self.work, env=self.environment, text=True, timeout=200,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        self.assertEqual(done.returncode, 0, f"{block.where}:\n{done.stdout}")
        return done.stdout


# In place of CMake: makes the files of a build that the demo looks at, and puts the programs that are asked for where CMake would.
CMAKE = r"""#!/bin/bash
set -eu
if [ "$1" = --build ]; then
  build=$2
  shift 3  # --build FOLDER --target
  for target in "$@"; do
    case $target in
      varimeshd) ln -sfn "$BUILT/server" "$build/server" ;;
      varimesh_command) find "$BUILT/client" -maxdepth 1 -type f -perm -u+x -exec ln -sf -t "$build/client" {} + ;;
      varimesh_python) ln -sfn "$BUILT/client/python" "$build/client/python" ;;
      varimesh_opencascade | varimesh_hdf5) ;;
      *) echo "no target $target" >&2; exit 1 ;;
    esac
  done
else  # --preset release -B FOLDER
  mkdir -p "$4/client"
  [ ! -e "$BUILT/lib" ] || ln -sfn "$BUILT/lib" "$4/lib"
  printf 'build %s: phony\n' varimeshd varimesh_command varimesh_python varimesh_opencascade varimesh_hdf5 >"$4/build.ninja"
fi
"""


class Beginnings(support.WithFolder):
    """The first blocks of the tutorials, as on a machine on which nothing is built. Only CMake and Ninja are played: the
    programs are there already."""

    def begin(self, page):
        tree, stubs = self.folder / "tree", self.folder / "stubs"
        tree.mkdir()
        stubs.mkdir()
        shutil.copytree(SOURCE / "deploy", tree / "deploy")
        (tree / "tests").mkdir()
        (tree / "tests" / "cases").symlink_to(CASES)
        for name, text in (("cmake", CMAKE), ("ninja", "#!/bin/sh\necho '[1/1] all'\n")):
            (stubs / name).write_text(text)
            (stubs / name).chmod(0o755)
        (stubs / "python3").symlink_to(sys.executable)
        built = Path(VARIMESH).resolve().parent.parent
        environment = {**os.environ, "PATH": f"{stubs}:{os.environ['PATH']}", "HOME": str(self.folder), "VARIMESH_SETUP": "skip",
                       "BUILT": str(built), "PYTHONPATH": ""}
        block = next(block for block in blocks(SOURCE / "docs" / page) if block.text.startswith("deploy/"))
        after = "\npwd; command -v varimesh varimeshd; python3 -c 'import varimesh; print(varimesh.__file__)'\n"
        done = subprocess.run(["bash", "-euc", block.text + after], cwd=tree, env=environment, text=True, timeout=200,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertEqual(done.stdout.splitlines()[-4:], [
            f"{tree}/{page.removesuffix('.md')}", *(f"{tree}/build/demo/{path}" for path in (
                "client/varimesh", "server/varimeshd", "client/python/package/varimesh/__init__.py"))])
        self.assertIn("building the server and the command in build/demo", done.stdout)
        self.assertLessEqual({"demo.msh", "demo.vtu", "demo.html"}, set(os.listdir(tree / "out")))
        return done.stdout

    def test_of_the_tutorial(self):
        self.assertIn("every element is certified valid", self.begin("tutorial.md"))

    def test_of_the_tutorial_from_cad(self):
        self.begin("tutorial-cad.md")

    def test_of_the_tutorial_of_layers(self):
        self.begin("tutorial-layers.md")


class Tutorial(WithPrograms):
    def test_runs_unchanged(self):
        os.environ["PATH"] = self.environment["PATH"]  # varimesh.local() looks for the server there
        printed = self.run_page(SOURCE / "docs" / "tutorial.md", names={"__name__": "__main__"})
        before = next(text for text in printed if "proved scaled Jacobian" in text)
        self.assertGreater(int(re.search(r"invalid elements +(\d+)\n", before)[1]), 0)
        for words in ("certified\n", "certified for Nektar++\n", "certified for MFEM\n", "the same, to the last bit\n"):
            self.assertIn(words, "".join(printed))
        made = set(os.listdir(self.work))
        self.assertLessEqual({"part.step", "better.msh", "better.xml", "better.mesh", "better.vtu", "better.html", "best.msh", "from-python.msh"}, made)
        self.check_figures(self.quality("from-python.msh"), self.quality("better.msh"))

    def check_figures(self, one, other):
        """
        Words and whole numbers are the same. Gmsh 4.13 rounds nodes differently in its command and in its Python package, by up to
        5e-15, and the optimum then differs in the digits that are printed last.
        """
        decimal = re.compile(r"-?\d+\.\d+")
        self.assertEqual(decimal.sub("", one), decimal.sub("", other))
        for figure, expected in zip(decimal.findall(one), decimal.findall(other)):
            self.assertAlmostEqual(float(figure), float(expected), delta=5e-5)

    def quality(self, name):
        done = subprocess.run([VARIMESH, "quality", self.work / name, "--certify"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stdout)
        return done.stdout


class FromCad(WithPrograms):
    def test_runs_unchanged(self):
        printed = "".join(self.run_page(SOURCE / "docs" / "tutorial-cad.md"))
        self.assertIn("certified\n", printed)
        self.assertRegex(printed, r"Refining split \d+ edges? at surface")
        done = subprocess.run([VARIMESH, "quality", self.work / "refined.msh", "--certify"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertIn("touch these surfaces", printed)
        self.assertIn("status 4\n", printed)
        self.assertLessEqual({"part.step", "part.msh", "part.html", "part.xml", "refined.msh", "coarse.msh"},
                             set(os.listdir(self.work)))


class LayersFromCad(WithPrograms):
    def test_runs_unchanged(self):
        printed = "".join(self.run_page(SOURCE / "docs" / "tutorial-layers.md"))
        for words in ("layers     20 above", "certified\n", "certified for Nektar++\n"):
            self.assertIn(words, printed)
        self.assertIn('NAME="aerofoil"', (self.work / "thin.xml").read_text())
        self.assertIn(b"bc/aerofoil", (self.work / "thin.pyfrm").read_bytes())


class Commands(WithPrograms):
    """The commands of every page except those whose commands other tests run."""

    def setUp(self):
        super().setUp()
        shutil.copy(CASES / "sphere_p3.msh", self.work / "wing.msh")
        shutil.copy(CASES / "circle_p5.msh", self.work / "section.msh")
        shutil.copy(CASES / "thick_layer_p3.msh", self.work / "thick.msh")
        subprocess.run([VARIMESH, "convert", "thick.msh", "tetrahedra.msh", "--simplices"], cwd=self.work, check=True)
        self.server = Server("--state", str(self.folder / "state"))
        self.addCleanup(self.server.stop)

    def test_of_every_page_run_unchanged(self):
        import varimesh

        os.environ["PATH"] = self.environment["PATH"]  # varimesh.local() looks for the server there
        with varimesh.Client(self.server.address) as client:
            job = client.submit(self.work / "wing.msh", outputs=["msh41-binary", "parts"])
            job.wait()
            mesh = job.result().mesh
        words = {"HOST:PORT": self.server.address, "127.0.0.1:50051": f"unix:{self.folder}/socket", " JOB ": f" {job.name} "}
        ran = []
        for page in PAGES:
            if page.name in ELSEWHERE or page.name.startswith("tutorial"):
                continue
            with self.subTest(page.name):
                names = {"__name__": "__main__", "nodes": mesh.nodes, "cells": mesh.cells["tetrahedron"]}
                ran += [page.name] * len(self.run_page(page, words, names))
        self.assertLessEqual({"README.md", "report.md"}, set(ran))

    def test_tables_of_flags_match_the_help(self):
        for command, name in (([VARIMESH, "optimise", "--help-all"], "options.md"), ([VARIMESHD, "--help"], "server.md")):
            shown = subprocess.run(command, capture_output=True, text=True).stdout
            flags = set(re.findall(r"^ +(?:-\w, ?)?(--[a-z-]+)", shown, re.MULTILINE)) - {"--help", "--help-all", "--version"}
            page = (SOURCE / "docs" / name).read_text()
            rows = set(re.findall(r"`(--[a-z-]+)", "".join(re.findall(r"^\| (`--[^|]*)\|", page, re.MULTILINE))))
            self.assertGreater(len(rows), 10)
            self.assertLessEqual(flags, set(re.findall(r"--[a-z-]+", page)), name)
            self.assertLessEqual(rows, set(re.findall(r"--[a-z-]+", shown)), name)

    def test_the_table_of_blocks_that_do_not_run_here_is_true(self):
        for name, words in NOT_HERE:
            page = next(one for one in PAGES if one.name == name)
            self.assertTrue(any(block.text.startswith(words) for block in blocks(page)), (name, words))
        for name, test in ELSEWHERE.items():
            self.assertIn(f'"{name}"', (SOURCE / test).read_text())


if __name__ == "__main__":
    if sys.argv[1] in ("Beginnings", "Tutorial", "Commands"):
        support.need()
    if sys.argv[1] == "Beginnings" and not (Path(VARIMESH).resolve().parent / "python" / "package").exists():
        support.skip("the programs are not in a build tree")
    if sys.argv[1] == "FromCad" and not (Path(VARIMESH).resolve().parent / "libvarimesh_opencascade.so").exists():
        support.skip("VariMesh was built without OpenCASCADE (deploy/setup geometry)")
    if sys.argv[1] in ("Tutorial", "FromCad") and not (shutil.which("gmsh") and importlib.util.find_spec("gmsh")):
        support.skip("gmsh or python3-gmsh is missing (deploy/setup test)")
    unittest.main(verbosity=2)
