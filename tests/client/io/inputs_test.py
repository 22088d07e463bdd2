"""Inputs: pipes, files that fail while they are read, text that is not UTF-8."""
import re
import unittest

from programs import MESH, WithFolder, run, run_bytes


class Inputs(WithFolder):
    def test_a_pipe_is_read_to_its_end(self):
        whole, piped = self.folder / "whole.msh", self.folder / "piped.msh"
        self.assertEqual(run("optimise", MESH, "-o", whole, "--quiet").returncode, 0)
        done = run_bytes("optimise", "/dev/stdin", "-o", piped, "--quiet", input=MESH.read_bytes())
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(piped.read_bytes(), whole.read_bytes())
        for arguments in (["optimise", "-", "-o", piped, "--quiet"], ["convert", "-", piped]):
            piped.unlink()
            done = run_bytes(*arguments, input=(MESH if arguments[0] == "optimise" else whole).read_bytes())
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(piped.read_bytes(), whole.read_bytes(), arguments)
        shown = run_bytes("quality", "-", input=MESH.read_bytes())
        self.assertEqual(shown.stdout, run_bytes("quality", MESH).stdout)

    def test_a_file_that_fails_while_it_is_read_is_refused(self):
        # The file can be opened but not read, because its first byte belongs to no memory of the process.
        broken, out = "/proc/self/mem", self.folder / "out.msh"
        for arguments in (["optimise", broken, "-o", out], ["optimise", MESH, "-o", out, "--displacements", broken],
                          ["quality", broken]):
            done = run(*arguments)
            self.assertEqual(done.returncode, 3, f"{arguments}: {done.stderr}")
            self.assertRegex(done.stderr, r"/proc/self/mem.*Input/output error", arguments)
        self.assertFalse(out.exists())

    def test_text_that_is_sent_must_be_utf_8(self):
        out = self.folder / "out.msh"
        for flag in ("--fix", "--free"):
            done = run_bytes("optimise", MESH, "-o", out, flag, b"W\xe4nde")
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn(b"'W\\xe4nde' is not UTF-8", done.stderr)
        done = run_bytes("submit", MESH, "--label", b"where=K\xf6ln", "--server", "127.0.0.1:1")
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn(b"is not UTF-8", done.stderr)

    def test_group_names_in_any_encoding_survive(self):
        mesh, out = self.folder / "in.msh", self.folder / "out.msh"
        names = b"$PhysicalNames\n1\n2 1 \"Fl\xe4che\"\n$EndPhysicalNames\n"
        mesh.write_bytes(re.sub(rb"(?s)\$PhysicalNames.*\$EndPhysicalNames\n", b"", MESH.read_bytes())
                         .replace(b"$EndMeshFormat\n", b"$EndMeshFormat\n" + names))
        done = run("optimise", mesh, "-o", out, "--quiet")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn(b"\"Fl\xe4che\"", out.read_bytes())
        # The server's error message, which lists the names, must arrive too.
        done = run("optimise", mesh, "-o", out, "--quiet", "--fix", "Boden")
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn(r"'Fl\xe4che'", done.stderr)

    def test_errors_in_a_mesh_name_the_file(self):
        mesh = self.folder / "in.msh"
        mesh.write_bytes(MESH.read_bytes()[:300])
        done = run("optimise", mesh, "-o", self.folder / "out.msh")
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertRegex(done.stderr, r"varimesh: '.*in\.msh': .{20,}")


if __name__ == "__main__":
    unittest.main(verbosity=2)
