"""Ctrl-C: once, twice, on a terminal, and while a server hangs. VARIMESH_LONG_TESTS=1 interrupts at 50 times per case."""
import json
import os
import pty
import random
import re
import signal
import subprocess
import time
import unittest
from pathlib import Path

from programs import CASES, ENDLESS, LARGER, MESH, VARIMESH, Server, WithFolder, WithServer, run, start, wait_for_line

LONG = "VARIMESH_LONG_TESTS" in os.environ
INTERRUPTED = 130


def wait_until_signals_are_caught(process):
    """Before the signal is blocked, the command would end without a message."""
    status = Path(f"/proc/{process.pid}/status")
    while not int(re.search(r"(?m)^SigBlk:\s*(\w+)$", status.read_text())[1], 16) & 1 << signal.SIGINT - 1:
        time.sleep(0.001)


def quality(path):
    document = json.loads(run("quality", path, "--json").stdout)["quality"]
    return {**document, **document["certified"]}


class InProcess(WithFolder):
    """The work so far is kept, whenever the interrupt comes."""

    def interrupt(self, seconds, *arguments, number=signal.SIGINT):
        """Returns the status and standard error of a run that is interrupted after this many seconds."""
        process = start("optimise", *arguments, "--quiet")
        wait_until_signals_are_caught(process)
        time.sleep(seconds)
        process.send_signal(number)
        _, stderr = process.communicate(timeout=40)
        return process.returncode, stderr

    def check_case(self, mesh, *options):
        before = quality(CASES / mesh)
        began = time.monotonic()
        self.assertIn(run("optimise", CASES / mesh, "-o", self.folder / "whole.msh", *options).returncode, (0, 4))
        whole = time.monotonic() - began
        chance = random.Random(f"{mesh} {options}")
        outs = [self.folder / name for name in ("out.msh", "out.vtu", "history.csv", "report.html")]
        arguments = ["-o", outs[0], "-o", outs[1], "--history", outs[2], "--report", outs[3], *options]
        interruptions = 0
        for _ in range(50 if LONG else 4):
            seconds = chance.uniform(0, whole)
            with self.subTest(mesh=mesh, options=options, seconds=seconds):
                for out in outs:
                    out.unlink(missing_ok=True)
                status, stderr = self.interrupt(seconds, CASES / mesh, *arguments)
                if status in (0, 4):  # it was over
                    continue
                interruptions += 1
                self.assertEqual(status, INTERRUPTED, stderr)
                self.assertRegex(stderr, "interrupted .*out.msh, .*out.vtu")
                for out in outs:
                    self.assertTrue(out.exists(), out)
                after = quality(outs[0])
                self.assertLessEqual(after["invalid"] + after["undecided"], before["invalid"] + before["undecided"])
                if before["invalid"] + before["undecided"] == 0:
                    self.assertTrue(after["min_scaled_jacobian"] >= before["min_scaled_jacobian"] or
                                    after["mean_scaled_jacobian"] >= before["mean_scaled_jacobian"])
        self.assertGreater(interruptions, 0)

    def test_triangles(self):
        self.check_case("circle_p5.msh", "--tolerance", "1e-9")

    def test_an_aerofoil_for_the_worst_element(self):
        self.check_case("aerofoil_p4.msh", "--objective", "worst", "--max-iterations", "40")

    def test_quadrilaterals(self):
        self.check_case("annulus_p3.msh", "--tolerance", "1e-9")

    def test_tetrahedra_that_are_split(self):
        self.check_case("sphere_p3.msh", "--repair", "split")

    def test_prisms(self):
        self.check_case("cylinder_p2.msh", "--tolerance", "1e-9")

    def test_sigterm_is_an_interrupt_too(self):
        out = self.folder / "out.msh"
        status, stderr = self.interrupt(0.2, LARGER, "-o", out, *ENDLESS, number=signal.SIGTERM)
        self.assertEqual(status, INTERRUPTED, stderr)
        self.assertTrue(out.exists())

    def test_an_interrupt_while_a_pipe_is_read_ends_the_command(self):
        pipe = self.folder / "in.msh"
        os.mkfifo(pipe)
        status, _ = self.interrupt(0.1, pipe, "-o", self.folder / "out.msh")
        self.assertEqual(status, INTERRUPTED)
        self.assertFalse((self.folder / "out.msh").exists())


class OnAServer(WithServer):
    """The job goes on running, unless the user says otherwise."""

    def start_job(self, **keywords):
        return start("optimise", LARGER, "-o", self.folder / "out.msh", *ENDLESS, "--server", self.server.address,
                     **keywords)

    def cancel_all(self):
        for job in json.loads(self.remote("jobs", "--state", "running", "--json").stdout)["jobs"]:
            self.remote("cancel", job["job"])

    def test_without_a_terminal_the_job_is_left_running(self):
        client = self.start_job(stdin=subprocess.DEVNULL)
        wait_for_line(client, "residual")
        client.send_signal(signal.SIGINT)
        _, stderr = client.communicate(timeout=20)
        self.assertEqual(client.returncode, INTERRUPTED, stderr)
        job = re.search(r"varimesh watch (\S+) --server " + re.escape(self.server.address), stderr)[1]
        running = json.loads(self.remote("jobs", "--state", "running", "--json").stdout)["jobs"]
        self.assertIn(job, [each["job"] for each in running])
        self.cancel_all()

    def answer_on_a_terminal(self, answer):
        """Interrupts a job, answers the question, and returns the status and what was printed."""
        mine, terminal = pty.openpty()
        client = subprocess.Popen(
            [VARIMESH, "optimise", LARGER, "-o", self.folder / "out.msh", *ENDLESS, "--server", self.server.address],
            stdin=terminal, stdout=terminal, stderr=terminal)
        os.close(terminal)
        printed = ""

        def read_until(pattern):
            nonlocal printed
            while not re.search(pattern, printed):
                printed += os.read(mine, 65536).decode()

        read_until("residual")
        client.send_signal(signal.SIGINT)
        read_until(r"\[L/c\]")
        os.write(mine, answer)
        status = client.wait(40)
        try:
            while True:
                printed += os.read(mine, 65536).decode()
        except OSError:  # the other end is closed
            os.close(mine)
        return status, printed

    def test_on_a_terminal_the_default_leaves_the_job_running(self):
        status, printed = self.answer_on_a_terminal(b"\n")
        self.assertEqual(status, INTERRUPTED, printed)
        self.assertIn("goes on running", printed)
        self.assertNotIn("0 jobs", self.remote("jobs", "--state", "running").stdout)
        self.assertFalse((self.folder / "out.msh").exists())
        self.cancel_all()

    def test_on_a_terminal_the_job_can_be_cancelled_and_its_best_mesh_fetched(self):
        status, printed = self.answer_on_a_terminal(b"c\n")
        self.assertEqual(status, INTERRUPTED, printed)
        self.assertIn("the best mesh so far is in", printed)
        self.assertLessEqual(quality(self.folder / "out.msh")["invalid"], quality(LARGER)["invalid"])


class Interrupts(WithFolder):
    def test_a_second_ctrl_c_leaves_nothing_behind(self):
        # Nothing reads from the pipe, so the command waits, and the meshes of the service stay on the disk.
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

    def test_one_ctrl_c_ends_a_command_that_waits_for_a_server_that_hangs(self):
        server = Server()
        try:
            client = start("optimise", LARGER, "-o", self.folder / "out.msh", *ENDLESS, "--server", server.address)
            wait_for_line(client, "residual")
            server.process.send_signal(signal.SIGSTOP)
            client.send_signal(signal.SIGINT)
            _, stderr = client.communicate(timeout=20)
            self.assertEqual(client.returncode, 130, stderr)
            self.assertIn("goes on running", stderr)
            asking = start("jobs", "--server", server.address)
            wait_until_signals_are_caught(asking)
            asking.send_signal(signal.SIGINT)
            self.assertIn("nterrupted", asking.communicate(timeout=10)[1])
            self.assertEqual(asking.returncode, 130)
        finally:
            server.process.send_signal(signal.SIGCONT)
            server.stop()


if __name__ == "__main__":
    unittest.main(verbosity=2)
