"""varimesh completion, in the shells that are installed. Run with the name of a group."""
import shutil
import sys
import unittest

from help_words import COMMANDS, OPTIONS, shell
from programs import WithFolder, run


class Completed(WithFolder):
    def setUp(self):
        super().setUp()
        for name in ("bash", "zsh", "fish"):
            (self.folder / name).write_text(run("completion", name).stdout)
        (self.folder / "wing mesh.msh").touch()


# A program in place of varimesh: completion asks it for the names of jobs.
# The last name is one of a server that wants its words to be run.
ASKED = ("varimesh() { echo \"$@\" >asked; printf '%s\\n' jobs/12345678 jobs/1299 'jobs/12$(touch${IFS}run)' '$(touch${IFS}run)'; }; "
         "timeout() { shift; \"$@\"; }; SERVER=there:2; ")
# How --server is written, and what is asked then. The words are those that bash makes of it.
SERVERS = (("--server here:1", ("--server", "here", ":", "1"), "here:1"),
           ("--server=here:1", ("--server", "=", "here", ":", "1"), "here:1"),
           ("--server unix:/a/b", ("--server", "unix", ":", "/a/b"), "unix:/a/b"),
           ('--server "$SERVER"', ("--server", "'\"$SERVER\"'"), "there:2"))


class Bash(Completed):
    def bash(self, *words, line=""):
        script = (ASKED + f"cd '{self.folder}'; source ./bash; COMP_WORDS=(varimesh {' '.join(words)}); COMP_CWORD={len(words)}; "
                  f"COMP_LINE='{line}'; COMP_POINT={len(line)}; "
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

    def test_offers_the_jobs_of_the_server(self):
        self.assertEqual(self.bash("watch", "123"), ["12345678"])
        for written, words, asked in SERVERS:
            offered = self.bash("results", *words, "12", line=f"varimesh results {written} 12")
            self.assertEqual(offered, ["12345678", "1299"], written)
            self.assertEqual((self.folder / "asked").read_text(), f"jobs --names --server {asked}\n")
        self.assertEqual(self.bash("results", "--server", "here", ":", "1", line="varimesh results --server here:1"), [""])
        self.assertFalse((self.folder / "run").exists())


class Fish(Completed):
    def fish(self, line):
        done = shell("fish", "-c", f"cd '{self.folder}'; source fish; complete -C '{line}'")
        self.assertEqual(done.stderr, "")
        return [one.split("\t")[0] for one in done.stdout.splitlines()]

    def test_completes(self):
        self.assertEqual(self.fish("varimesh opt"), ["optimise"])
        self.assertEqual(self.fish("varimesh optimise --energ"), ["--energy"])
        self.assertEqual(self.fish("varimesh optimise --energy w"), ["winslow"])
        self.assertEqual(self.fish("varimesh convert wing"), ["wing mesh.msh"])
        self.assertEqual(set(OPTIONS) - set(self.fish("varimesh optimise --")), set())

    def test_offers_the_jobs_of_the_server(self):
        programs = self.folder / "programs"
        programs.mkdir()
        (programs / "varimesh").write_text("#!/bin/bash\n" + ASKED + "cd \"$(dirname \"$0\")/..\"; varimesh \"$@\"\n")
        (programs / "varimesh").chmod(0o755)
        for written, _, asked in (("", (), ""),) + SERVERS:
            line = f"varimesh results {written} 12"
            done = shell("fish", "-c", f"set -x PATH {programs} $PATH; set SERVER there:2; source {self.folder}/fish; complete -C '{line}'")
            self.assertEqual(sorted(one.split("\t")[0] for one in done.stdout.splitlines()), ["12345678", "1299"], written)
            self.assertEqual((self.folder / "asked").read_text().split()[2:], ["--server", asked] if asked else [])
        self.assertFalse((self.folder / "run").exists())


class Zsh(Completed):
    def test_completes(self):
        """Checks what the script passes to zsh's own functions."""
        script = ("_arguments() { print -rl -- \"$@\" }; _describe() { print -rl -- $commands }; "
                  f"run() {{ words=(varimesh \"$@\"); CURRENT=$(( $#words )); source {self.folder}/zsh }}; ")
        done = shell("zsh", "-f", "-c", script + "run ''")
        self.assertEqual([line.split(":")[0] for line in done.stdout.splitlines()], COMMANDS)
        done = shell("zsh", "-f", "-c", script + "run optimise ''")
        self.assertEqual(done.stderr, "")
        self.assertIn("--energy=[The energy that is minimised]:value:(hyperelastic linear-elastic winslow distortion)", done.stdout)
        self.assertIn("*--output=[Write the result to this file (", done.stdout)
        self.assertIn("1:IN:_files", done.stdout)
        for option in OPTIONS:
            value = "" if option in ("--orient", "--simplices") else "="  # these are switches
            self.assertIn(f"{option}{value}[", done.stdout)

    def test_offers_the_jobs_of_the_server(self):
        script = (ASKED + "_arguments() { }; compadd() { print -rl -- $names }; words=(varimesh watch ''); CURRENT=3; "
                  f"cd {self.folder}; source ./zsh; ")
        for written, _, asked in (("", (), ""),) + SERVERS:
            quoted = " ".join(f"'{word}'" for word in written.split())  # zsh keeps the quotes of the line in its words
            offered = shell("zsh", "-f", "-c", script + f"words=(watch {quoted} ''); _varimesh_jobs")
            self.assertEqual(offered.stdout.split(), ["12345678", "1299"], written + offered.stderr)
            self.assertEqual((self.folder / "asked").read_text().split()[2:], ["--server", asked] if asked else [])
        self.assertFalse((self.folder / "run").exists())


if __name__ == "__main__":
    needed = {"Fish": "fish", "Zsh": "zsh"}.get(sys.argv[1])
    if needed and not shutil.which(needed):
        print(f"SKIPPED: {needed} is missing (deploy/setup test)")
        sys.exit(77)
    unittest.main(verbosity=2)
