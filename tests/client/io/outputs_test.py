"""Outputs: links, pipes, devices, standard output, full disks."""
import os
import stat
import threading
import unittest
from pathlib import Path

from programs import CASES, MESH, WithFolder, run, run_bytes


class Outputs(WithFolder):
    def setUp(self):
        super().setUp()
        self.plain = self.folder / "plain.msh"
        self.assertEqual(run("optimise", MESH, "-o", self.plain, "--quiet").returncode, 0)

    def test_links_are_followed_and_permissions_kept(self):
        (self.folder / "real").mkdir()
        for name, command in (("a.msh", ["optimise", MESH, "--quiet", "-o"]), ("b.msh", ["convert", MESH]),
                              ("c.csv", ["optimise", MESH, "--quiet", "-o", self.folder / "out.msh", "--history"])):
            target, link = self.folder / "real" / name, self.folder / name
            target.write_text("old")
            target.chmod(0o640)
            link.symlink_to(Path("real") / name)
            done = run(*command, link)
            self.assertEqual(done.returncode, 0, f"{name}: {done.stderr}")
            self.assertTrue(link.is_symlink(), name)
            self.assertGreater(target.stat().st_size, 100, name)
            self.assertEqual(target.stat().st_mode & 0o777, 0o640, name)
        self.assertEqual((self.folder / "a.msh").read_bytes(), self.plain.read_bytes())
        self.assertEqual(len(list((self.folder / "real").iterdir())), 3)

    def test_a_link_to_a_missing_file_makes_the_file(self):
        link = self.folder / "link.msh"
        link.symlink_to("made.msh")
        self.assertEqual(run("optimise", MESH, "-o", link, "--quiet").returncode, 0)
        self.assertTrue(link.is_symlink())
        self.assertEqual((self.folder / "made.msh").read_bytes(), self.plain.read_bytes())

    def test_a_pipe_gets_the_bytes(self):
        pipe, got = self.folder / "pipe.msh", []
        os.mkfifo(pipe)
        reader = threading.Thread(target=lambda: got.append(pipe.read_bytes()), daemon=True)
        reader.start()
        done = run("optimise", MESH, "-o", pipe, "--quiet")
        reader.join(10)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue(stat.S_ISFIFO(pipe.stat().st_mode))
        self.assertEqual(got, [self.plain.read_bytes()])

    def test_a_report_comes_with_formats_that_are_only_written(self):
        report = self.folder / "report.html"
        done = run("optimise", MESH, "-o", self.folder / "out.su2", "--report", report, "--quiet")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertNotIn("There is no picture", report.read_text())

    def test_a_device_stays_a_device(self):
        device = self.folder / "null"
        try:
            os.mknod(device, 0o666 | stat.S_IFCHR, os.stat("/dev/null").st_rdev)
            device.open("wb").close()
        except OSError as error:
            self.skipTest(f"no device can be made here: {error}")
        done = run("optimise", MESH, "-o", device, "--quiet")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue(stat.S_ISCHR(device.stat().st_mode))

    def test_standard_output_gets_only_the_mesh(self):
        done = run_bytes("optimise", MESH, "-o", "/dev/stdout")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stdout, self.plain.read_bytes())
        self.assertIn(b"invalid elements", done.stderr)
        both = run("optimise", MESH, "-o", "/dev/stdout", "--json")
        self.assertEqual((both.returncode, both.stdout), (2, ""))

    def test_standard_output_gets_only_the_history_or_the_report(self):
        layer = CASES / "thick_layer_p3.msh"
        commands = (("optimise", MESH, "-o", self.folder / "out.msh", "--history"), ("optimise", MESH, "-o", self.folder / "out.msh", "--report"),
                    ("quality", MESH, "--report"), ("layers", layer, "--wall", "wing", "--layers", "4", "--first", "1e-3", "-o", self.folder / "out.msh", "--report"))
        for command in commands:
            for name in ("-", "/dev/stdout"):
                done = run(*command, name)
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertNotIn("invalid elements ", done.stdout, command)
                self.assertIn("invalid elements", done.stderr, command)
                lines = done.stdout.splitlines()
                if command[-1] == "--history":
                    self.assertEqual({line.count(",") for line in lines}, {lines[0].count(",")}, "each line is one of the table")
                    self.assertGreater(lines[0].count(","), 3)
                else:
                    self.assertEqual((lines[0].lower(), lines[-1]), ("<!doctype html>", "</html>"), command)
                self.assertEqual(run(*command, name, "--json").returncode, 2, command)

    def test_a_dash_is_standard_output_for_every_command_that_writes_a_mesh(self):
        layer = CASES / "thick_layer_p3.msh"
        commands = ([(".msh", "optimise", MESH, "-o", "-"), (".msh", "quality", MESH, "-o", "-"), (".msh", "convert", MESH, "-o", "-"),
                     (".msh", "layers", layer, "--wall", "wing", "--layers", "4", "--first", "1e-3", "-o", "-")] +
                    [(ending, "convert", MESH, "-", "--format", name) for ending, name in ((".msh", "msh22"), (".msh", "msh41-binary"), (".vtu", "vtu"),
                                                                                           (".mesh", "mfem"), (".xml", "nektar"), (".su2", "su2"))])
        for number, (ending, *command) in enumerate(commands):
            folder = self.folder / str(number)
            folder.mkdir()
            done = run_bytes(*command, cwd=folder)
            named = run(*(folder / ("named" + ending) if word == "-" else word for word in command))
            self.assertEqual(done.returncode, named.returncode, (done.stderr, named.stderr))
            self.assertEqual(done.stdout, (folder / ("named" + ending)).read_bytes(), command)
            self.assertEqual(os.listdir(folder), ["named" + ending], command)
        two = run("optimise", MESH, "-o", "-", "-o", "/dev/stdout")
        self.assertEqual(two.returncode, 2)
        self.assertIn("Two outputs", two.stderr)
        for flag in ("--history", "--report"):
            both = run("optimise", MESH, "-o", "-", flag, "-")
            self.assertEqual((both.returncode, both.stdout), (2, ""), flag)
        chained = run_bytes("quality", "-", "--certify", input=run_bytes("optimise", MESH, "-o", "-", "--quiet").stdout)
        self.assertEqual(chained.returncode, 0, chained.stderr)

    def test_exits_with_3_if_standard_output_is_full(self):
        for arguments in (["optimise", MESH, "-o", self.folder / "o.msh", "--json"], ["quality", MESH], ["info"],
                          ["optimise", MESH, "-o", "/dev/stdout", "--quiet"], ["--help"]):
            with open("/dev/full", "wb") as full:
                done = run_bytes(*arguments, stdout=full)
            self.assertEqual(done.returncode, 3, arguments)
            self.assertIn(b"cannot be written", done.stderr, arguments)
            self.assertIn(b"No space left", done.stderr, arguments)

    def test_a_folder_is_refused_as_one_whatever_its_ending(self):
        for name in ("folder", "folder.msh"):
            (self.folder / name).mkdir()
            done = run("optimise", MESH, "-o", self.folder / name)
            self.assertEqual(done.returncode, 3)
            self.assertIn("is a folder; name a file in it.", done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
