"""The command where things are not as they should be: special files, full disks, servers that go away, Ctrl-C. Run by
ctest like command_test.py, with the same environment."""
import json
import os
import re
import signal
import stat
import subprocess
import threading
import time
import unittest
from pathlib import Path

from command_test import LARGER, MESH, VARIMESH, VARIMESHD, Server, WithFolder, run

ENDLESS = ["--method", "sweeps", "--tolerance", "1e-300", "--max-iterations", "100000000"]


def run_bytes(*arguments, **keywords):
    """As run(), with arguments and outputs as bytes."""
    keywords = {"stdout": subprocess.PIPE, **keywords}
    return subprocess.run([VARIMESH, *arguments], stderr=subprocess.PIPE, timeout=50, **keywords)


def start(*arguments, **keywords):
    return subprocess.Popen([VARIMESH, *map(str, arguments)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                            **keywords)


def wait_for_line(process, pattern):
    """Reads standard error up to a line that matches."""
    for line in process.stderr:
        if re.search(pattern, line):
            return line
    raise AssertionError(f"no line with {pattern}; the status is {process.wait(10)}")


class Outputs(WithFolder):
    def setUp(self):
        super().setUp()
        self.plain = self.folder / "plain.msh"
        self.assertEqual(run("optimise", MESH, "-o", self.plain, "--quiet").returncode, 0)

    def test_links_are_followed_and_rights_kept(self):
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

    def test_a_link_to_a_file_that_is_not_there_yet_makes_it(self):
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

    def test_standard_output_takes_the_mesh_alone(self):
        done = run_bytes("optimise", MESH, "-o", "/dev/stdout")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stdout, self.plain.read_bytes())
        self.assertIn(b"invalid elements", done.stderr)
        both = run("optimise", MESH, "-o", "/dev/stdout", "--json")
        self.assertEqual((both.returncode, both.stdout), (2, ""))

    def test_what_is_printed_has_to_arrive(self):
        for arguments in (["optimise", MESH, "-o", self.folder / "o.msh", "--json"], ["quality", MESH], ["info"],
                          ["optimise", MESH, "-o", "/dev/stdout", "--quiet"], ["--help"]):
            with open("/dev/full", "wb") as full:
                done = run_bytes(*arguments, stdout=full)
            self.assertEqual(done.returncode, 3, arguments)
            self.assertIn(b"cannot be written", done.stderr, arguments)
            self.assertIn(b"No space left", done.stderr, arguments)


class Inputs(WithFolder):
    def test_a_pipe_is_read_to_its_end(self):
        whole, piped = self.folder / "whole.msh", self.folder / "piped.msh"
        self.assertEqual(run("optimise", MESH, "-o", whole, "--quiet").returncode, 0)
        done = run_bytes("optimise", "/dev/stdin", "-o", piped, "--quiet", input=MESH.read_bytes())
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(piped.read_bytes(), whole.read_bytes())

    def test_a_file_that_fails_under_the_reading_is_refused(self):
        # Its first byte belongs to no memory of the process: opening succeeds, reading does not.
        broken, out = "/proc/self/mem", self.folder / "out.msh"
        for arguments in (["optimise", broken, "-o", out], ["optimise", MESH, "-o", out, "--displacements", broken],
                          ["quality", broken]):
            done = run(*arguments)
            self.assertEqual(done.returncode, 3, f"{arguments}: {done.stderr}")
            self.assertRegex(done.stderr, r"/proc/self/mem.*Input/output error", arguments)
        self.assertFalse(out.exists())

    def test_what_is_not_utf_8_is_refused_where_it_would_be_sent(self):
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
        # A sentence that lists them has to arrive.
        done = run("optimise", mesh, "-o", out, "--quiet", "--fix", "Boden")
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn(r"'Fl\xe4che'", done.stderr)

    def test_what_is_wrong_with_a_mesh_is_said_with_its_name(self):
        mesh = self.folder / "in.msh"
        mesh.write_bytes(MESH.read_bytes()[:300])
        done = run("optimise", mesh, "-o", self.folder / "out.msh")
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertRegex(done.stderr, r"varimesh: '.*in\.msh': .{20,}")

    def test_a_format_that_contradicts_the_ending_is_refused(self):
        for name, form in (("out.vtu", "msh22"), ("out.msh", "vtu")):
            done = run("convert", MESH, self.folder / name, "--format", form)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn("contradicts", done.stderr)
        self.assertEqual(list(self.folder.iterdir()), [])


class Interrupts(WithFolder):
    def test_a_second_ctrl_c_leaves_nothing_behind(self):
        # Nobody reads from the pipe: the command waits for ever, with the service's meshes on the disk.
        pipe, temporary = self.folder / "pipe.msh", self.folder / "tmp"
        os.mkfifo(pipe)
        temporary.mkdir()
        client = start("optimise", MESH, "-o", pipe, env={**os.environ, "TMPDIR": str(temporary)})
        wait_for_line(client, "succeeded")
        self.assertNotEqual(list(temporary.iterdir()), [])
        for _ in range(2):
            client.send_signal(signal.SIGINT)
            while client.poll() is None and not re.search(r"(?m)^ShdPnd:\s*0+$",
                                                          Path(f"/proc/{client.pid}/status").read_text()):
                time.sleep(0.01)
        _, stderr = client.communicate(timeout=20)
        self.assertEqual(client.returncode, 130, stderr)
        self.assertEqual(list(temporary.iterdir()), [])

    def test_one_ctrl_c_ends_what_waits_for_a_server_that_hangs(self):
        server = Server()
        try:
            client = start("optimise", LARGER, "-o", self.folder / "out.msh", *ENDLESS, "--server", server.address)
            wait_for_line(client, "residual")
            server.process.send_signal(signal.SIGSTOP)
            client.send_signal(signal.SIGINT)
            _, stderr = client.communicate(timeout=20)
            self.assertEqual(client.returncode, 130, stderr)
            self.assertIn("may still run", stderr)
            asking = start("jobs", "--server", server.address)
            status = Path(f"/proc/{asking.pid}/status")
            while not int(re.search(r"(?m)^SigBlk:\s*(\w+)$", status.read_text())[1], 16) & 1 << signal.SIGINT - 1:
                time.sleep(0.01)  # before that it ends all the same, and says nothing
            asking.send_signal(signal.SIGINT)
            self.assertIn("nterrupted", asking.communicate(timeout=10)[1])
            self.assertEqual(asking.returncode, 130)
        finally:
            server.process.send_signal(signal.SIGCONT)
            server.stop()


class Away(WithFolder):
    def test_says_when_the_server_goes_and_when_it_is_back(self):
        server = Server()
        client = start("optimise", LARGER, "-o", self.folder / "out.msh", *ENDLESS, "--server", server.address)
        wait_for_line(client, "residual")
        server.process.kill()
        wait_for_line(client, "the server is not answering; trying again")
        server.stop()
        back = subprocess.Popen([VARIMESHD, "--listen", server.address, "--log-level", "off"], stdout=subprocess.DEVNULL)
        try:
            _, stderr = client.communicate(timeout=30)
        finally:
            back.terminate()
            back.wait(20)
        # This server keeps its jobs in memory: the new one does not know this one.
        self.assertEqual(re.findall("not answering|answers again", stderr), ["answers again"], stderr)
        self.assertEqual(client.returncode, 2, stderr)

    def test_goes_on_through_a_server_that_restarts(self):
        work = [LARGER, "--method", "sweeps", "--active-set", "off", "--tolerance", "1e-300", "--max-iterations", "1000"]
        alone, out, fetched = (self.folder / name for name in ("alone.msh", "out.msh", "fetched.msh"))
        self.assertEqual(run("optimise", *work, "-o", alone, "--quiet").returncode, 0)
        flags = ["--state", self.folder / "state", "--checkpoint-seconds", "0.1"]
        server = Server(*flags)
        optimising = start("optimise", *work, "-o", out, "--server", server.address)
        wait_for_line(optimising, "residual")
        job = run("jobs", "--server", server.address).stdout.split()[0]
        watching = start("watch", job, "--server", server.address)
        wait_for_line(watching, "residual")
        time.sleep(0.5)
        server.process.kill()
        for client in (optimising, watching):
            wait_for_line(client, "the server is not answering; trying again")
        server.stop()
        back = Server(*flags, listen=server.address)
        try:
            for client in (optimising, watching):
                _, stderr = client.communicate(timeout=60)
                self.assertEqual(client.returncode, 0, stderr)
                self.assertEqual(re.findall("not answering|answers again", stderr), ["answers again"], stderr)
            self.assertEqual(run("result", job, "-o", fetched, "--server", back.address).returncode, 0)
            self.assertEqual(out.read_bytes(), alone.read_bytes())
            self.assertEqual(fetched.read_bytes(), alone.read_bytes())
        finally:
            back.stop()

    def test_asks_for_what_there_is(self):
        server = Server()
        try:
            job = run("submit", MESH, "--server", server.address).stdout.strip()
            self.assertEqual(run("watch", job, "--server", server.address).returncode, 0)
            ahead = run("watch", job, "--after", 99999, "--server", server.address)
            self.assertEqual((ahead.returncode, ahead.stdout), (2, ""), ahead.stderr)
            self.assertRegex(ahead.stderr, r"has no event number 99999: its last is \d+;")
            out = self.folder / "out.msh"
            lost = run("result", job, "-o", out, "--history", self.folder / "missing" / "history.csv", "--server",
                       server.address)
            self.assertEqual(lost.returncode, 3, lost.stderr)
            self.assertIn("history.csv", lost.stderr)
            self.assertFalse(out.exists())
            document = run("watch", job, "--json", "--server", server.address)
            self.assertTrue(json.loads(document.stdout)["converged"])
        finally:
            server.stop()


if __name__ == "__main__":
    unittest.main(verbosity=2)
