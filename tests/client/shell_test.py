"""What people type and read: examples that run, suggestions, completion in the shells that are here, man pages, doctor.
Run by ctest like command_test.py, with the same environment."""
import json
import os
import pty
import re
import shutil
import subprocess
import sys
import unittest

from command_test import LARGER, MESH, VARIMESH, Server, WithFolder, run

COMMANDS = re.findall(r"^  ([a-z]+) ", run("--help").stdout.split("\nCommands:\n")[1].split("\n\n")[0], re.MULTILINE)
OPTIONS = re.findall(r"^  (--[a-z-]+)", run("optimise", "--help").stdout.split("\nOptimisation:\n")[1], re.MULTILINE)


def shell(name, *arguments):
    return subprocess.run([name, *map(str, arguments)], capture_output=True, text=True, timeout=30)


class Help(WithFolder):
    def test_the_examples_run_as_they_stand(self):
        server = Server()
        self.addCleanup(server.stop)
        shutil.copy(MESH, self.folder / "wing.msh")
        for command in ["", *COMMANDS]:
            help_text = run(*([command] if command else []), "--help").stdout
            lines = re.findall(r"^  (varimesh .*)$", help_text, re.MULTILINE)
            self.assertTrue(lines, command)
            for line in lines:
                job = run("submit", MESH, "--server", server.address).stdout.strip()
                if command in ("delete", "result"):
                    self.assertEqual(run("watch", job, "--server", server.address).returncode, 0)
                words = line.replace("HOST:PORT", server.address).replace("JOB", job).split()
                done = subprocess.run([VARIMESH, *words[1:]], cwd=self.folder, capture_output=True, text=True, timeout=30)
                expected = 4 if words[1:] == ["quality", "wing.msh", "--certify"] else 0
                self.assertEqual(done.returncode, expected, f"{line}: {done.stderr}")

    def test_misspelt_words_are_suggested(self):
        for wrong, meant in ((["optimize", MESH], "'optimise'"), (["optimise", MESH, "--enrgy", "winslow"], "'--energy'"),
                             (["optimise", MESH, "-o", "x.msh", "--energy", "winslo"], "'winslow'"),
                             (["jobs", "--sever", "x"], "'--server'")):
            done = run(*wrong)
            self.assertEqual((done.returncode, done.stdout), (2, ""))
            self.assertIn(f"did you mean {meant}?", done.stderr)
            self.assertIn("--help", done.stderr)
        self.assertIn("--output is required", run("optimise", MESH).stderr)


class Colour(WithFolder):
    def test_is_nowhere_off_a_terminal(self):
        for arguments in (["--help"], ["doctor"], ["quality", MESH], ["optimise", LARGER, "-o", self.folder / "o.msh"]):
            done = run(*arguments)
            self.assertNotIn("\x1b", done.stdout + done.stderr, arguments)

    def on_a_terminal(self, **environment):
        ours, theirs = pty.openpty()
        process = subprocess.Popen([VARIMESH, "doctor"], stdout=theirs, env={**os.environ, **environment})
        process.wait(20)
        os.close(theirs)
        text = os.read(ours, 65536).decode()
        os.close(ours)
        return text

    def test_is_on_one_unless_it_is_not_wanted(self):
        self.assertIn("\x1b[32mok\x1b[0m", self.on_a_terminal(NO_COLOR=""))
        self.assertNotIn("\x1b", self.on_a_terminal(NO_COLOR="1"))


class Doctor(WithFolder):
    def test_finds_this_machine_well(self):
        found = json.loads(run("doctor", "--json").stdout)
        self.assertEqual(list(found), ["varimesh", "grpc", "protobuf", "processor", "vectors", "threads", "temporary files"])
        self.assertFalse([one for one in found.values() if one["wrong"]])
        self.assertRegex(found["vectors"]["found"], "^(EMU128|SCALAR|SSE4|SSSE3|SSE2|AVX2|AVX3|AVX3_DL|NEON)$")
        self.assertEqual(found["threads"]["found"].split()[0], str(len(os.sched_getaffinity(0))))

    def test_finds_what_is_wrong(self):
        server = Server()
        self.addCleanup(server.stop)
        well = run("doctor", "--server", server.address)
        self.assertEqual(well.returncode, 0, well.stdout)
        self.assertIn("answered in", well.stdout)
        away = run("doctor", "--server", "127.0.0.1:1")
        self.assertEqual(away.returncode, 5)
        self.assertIn("no  server", away.stdout)
        full = run("doctor", env={**os.environ, "TMPDIR": "/proc"})
        self.assertEqual(full.returncode, 1)
        self.assertIn("set TMPDIR", full.stdout)


class Completed(WithFolder):
    def setUp(self):
        super().setUp()
        for name in ("bash", "zsh", "fish"):
            (self.folder / name).write_text(run("completion", name).stdout)
        (self.folder / "wing mesh.msh").touch()


class Bash(Completed):
    def bash(self, *words):
        script = (f"cd '{self.folder}'; source ./bash; COMP_WORDS=(varimesh {' '.join(words)}); COMP_CWORD={len(words)}; "
                  "compopt() { :; }; _varimesh; printf '%s\\n' \"${COMPREPLY[@]}\"")
        return shell("bash", "-c", script).stdout.split("\n")[:-1]

    def test_completes(self):
        self.assertEqual(self.bash("opt"), ["optimise"])
        self.assertEqual(set(self.bash("''")) - {"-h", "--help", "--version"}, set(COMMANDS))
        self.assertEqual(self.bash("optimise", "--ener"), ["--energy"])
        self.assertEqual(self.bash("optimise", "--energy", "w"), ["winslow"])
        self.assertEqual(self.bash("optimise", "--energy", "=", "w"), ["winslow"])
        self.assertEqual(self.bash("submit", "--output-format", "msh41-"), ["msh41-binary"])
        self.assertEqual(self.bash("jobs", "--state", "ca"), ["cancelling", "cancelled"])
        self.assertEqual(self.bash("optimise", "wing"), ["wing mesh.msh"])
        self.assertEqual(self.bash("optimise", "--tolerance", "wing"), [""])
        self.assertEqual(set(OPTIONS) - set(self.bash("optimise", "--")), set())


class Fish(Completed):
    def fish(self, line):
        done = shell("fish", "-c", f"cd '{self.folder}'; source fish; complete -C '{line}'")
        self.assertEqual(done.stderr, "")
        return [one.split("\t")[0] for one in done.stdout.splitlines()]

    def test_completes(self):
        self.assertEqual(self.fish("varimesh opt"), ["optimise"])
        self.assertEqual(self.fish("varimesh optimise --ener"), ["--energy"])
        self.assertEqual(self.fish("varimesh optimise --energy w"), ["winslow"])
        self.assertEqual(self.fish("varimesh convert wing"), ["wing mesh.msh"])
        self.assertEqual(set(OPTIONS) - set(self.fish("varimesh optimise --")), set())


class Zsh(Completed):
    def test_completes(self):
        """What is handed to zsh's own functions."""
        script = ("_arguments() { print -rl -- \"$@\" }; _describe() { print -rl -- $commands }; "
                  f"run() {{ words=(varimesh \"$@\"); CURRENT=$(( $#words )); source {self.folder}/zsh }}; ")
        done = shell("zsh", "-f", "-c", script + "run ''")
        self.assertEqual([line.split(":")[0] for line in done.stdout.splitlines()], COMMANDS)
        done = shell("zsh", "-f", "-c", script + "run optimise ''")
        self.assertEqual(done.stderr, "")
        self.assertIn("--energy=[What is minimised]:value:(hyperelastic linear-elastic winslow distortion)", done.stdout)
        self.assertIn("*--output=[Where the result goes (", done.stdout)
        self.assertIn("1:IN:_files", done.stdout)
        for option in OPTIONS:
            self.assertIn(f"{option}=[", done.stdout)


class Manual(WithFolder):
    def test_pages_are_whole_and_without_complaint(self):
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
    needed = {"Fish": "fish", "Zsh": "zsh", "Manual": "man"}.get(sys.argv[1])
    if needed and not shutil.which(needed):
        print(f"SKIPPED: {needed} is missing (deploy/setup test)")
        sys.exit(77)
    unittest.main(verbosity=2)
