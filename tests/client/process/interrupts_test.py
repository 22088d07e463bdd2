"""Ctrl-C: once, twice, on a terminal, and while a server hangs. The long form interrupts 50 runs per case:
  ctest --test-dir build/release -C Long -R client.process.interrupts.long -V"""
import json
import os
import pty
import random
import re
import resource
import select
import signal
import subprocess
import sys
import time
import unittest
from pathlib import Path

from programs import CASES, ENDLESS, LARGER, MESH, VARIMESH, Server, WithFolder, WithServer, run, start, wait_for_line

LONG = "VARIMESH_LONG_TESTS" in os.environ
INTERRUPTED = 130
# Seconds that a run may go on after the interrupt, outputs included: at least, and per element. The short form counts
# seconds on a processor, since other programs may keep processors and disks busy. The long form also counts the seconds
# that a user waits.
LEAST_SECONDS, SECONDS_PER_ELEMENT = 0.5, 1e-6
MOST_SECONDS_WAITED = 10  # whatever else runs


def processor_seconds(process):
    """Of a process that is still running."""
    user, system = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def processor_seconds_of_all():
    """Of all processes that have been waited for."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def wait_until_signals_are_caught(process):
    """Before the signal is blocked, the command would end without a message."""
    status = Path(f"/proc/{process.pid}/status")
    while not int(re.search(r"(?m)^SigBlk:\s*(\w+)$", status.read_text())[1], 16) & 1 << signal.SIGINT - 1:
        time.sleep(0.001)


def quality(path):
    document = json.loads(run("quality", path, "--json").stdout)["quality"]
    return {**document, **document["certified"]}


def uncertified(judged):
    return judged["invalid"] + judged["undecided"]


class InProcess(WithFolder):
    """The work so far is kept, whenever the interrupt comes."""

    def interrupt(self, seconds, *arguments, number=signal.SIGINT):
        """Interrupts a run after this many seconds. Returns its status, its standard error, and how many seconds it took
        to end, as the limit counts them."""
        process = start("optimise", *arguments, "--quiet")
        wait_until_signals_are_caught(process)
        time.sleep(seconds)
        processor = -processor_seconds_of_all() - processor_seconds(process)
        began = time.monotonic()
        process.send_signal(number)
        _, stderr = process.communicate(timeout=40)
        waited = time.monotonic() - began
        processor += processor_seconds_of_all()
        self.assertLess(waited, MOST_SECONDS_WAITED)
        return process.returncode, stderr, max(processor, waited) if LONG else processor

    def check_outputs(self, outs, before):
        for out in outs:
            self.assertTrue(out.exists(), out)
        after = quality(outs[0])
        self.assertLessEqual(uncertified(after), uncertified(before))
        if uncertified(before) == 0:
            self.assertTrue(after["min_scaled_jacobian"] >= before["min_scaled_jacobian"] or
                            after["mean_scaled_jacobian"] >= before["mean_scaled_jacobian"])

    def check_case(self, mesh, *options):
        before = quality(CASES / mesh)
        elements = json.loads(run("quality", CASES / mesh, "--json").stdout)["mesh"]["elements"]
        allowed = LEAST_SECONDS + SECONDS_PER_ELEMENT * elements
        began = time.monotonic()
        self.assertIn(run("optimise", CASES / mesh, "-o", self.folder / "whole.msh", *options).returncode, (0, 4))
        whole = time.monotonic() - began
        chance = random.Random(f"{mesh} {options}")
        outs = [self.folder / name for name in ("out.msh", "out.vtu", "history.csv", "report.html")]
        arguments = ["-o", outs[0], "-o", outs[1], "--history", outs[2], "--report", outs[3], *options]
        wanted = 50 if LONG else 3
        endings = []
        for _ in range(3 * wanted):  # some are over before they are interrupted
            seconds = chance.uniform(0, whole)
            with self.subTest(mesh=mesh, options=options, seconds=seconds):
                for out in outs:
                    out.unlink(missing_ok=True)
                status, stderr, ending = self.interrupt(seconds, CASES / mesh, *arguments)
                if status in (0, 4):
                    whole = min(whole, 1.2 * seconds)
                    continue
                endings.append(ending)
                self.assertEqual(status, INTERRUPTED, stderr)
                self.assertRegex(stderr, "interrupted .*out.msh, .*out.vtu")
                self.assertLessEqual(ending, allowed)
                self.check_outputs(outs, before)
            if len(endings) == wanted:
                break
        if LONG:
            print(f"{mesh}: {len(endings)} interruptions; the longest took {max(endings):.3f} s to end, of {allowed:.3f}")
        self.assertEqual(len(endings), wanted)

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

    def test_sigterm_and_the_end_of_the_terminal_are_interrupts_too(self):
        for number in (signal.SIGTERM, signal.SIGHUP):
            out = self.folder / f"out-{number}.msh"
            status, stderr, *_ = self.interrupt(0.2, LARGER, "-o", out, *ENDLESS, number=number)
            self.assertEqual(status, INTERRUPTED, stderr)
            self.assertTrue(out.exists())

    def test_with_nohup_the_end_of_the_terminal_is_none(self):
        process = subprocess.Popen(["nohup", VARIMESH, "optimise", LARGER, "-o", self.folder / "out.msh", *ENDLESS],
                                   stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.addCleanup(lambda: (process.poll() is None and process.kill(), process.communicate()))
        wait_until_signals_are_caught(process)
        process.send_signal(signal.SIGHUP)
        time.sleep(1)
        self.assertIsNone(process.poll())
        process.send_signal(signal.SIGTERM)
        self.assertEqual(process.wait(20), INTERRUPTED)

    def test_an_interrupt_while_a_pipe_is_read_ends_the_command(self):
        pipe = self.folder / "in.msh"
        os.mkfifo(pipe)
        status, *_ = self.interrupt(0.1, pipe, "-o", self.folder / "out.msh")
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
            deadline = time.monotonic() + 40
            while not re.search(pattern, printed):
                ready, *_ = select.select([mine], [], [], max(0, deadline - time.monotonic()))
                self.assertTrue(ready, f"no {pattern} in {printed!r}")
                printed += os.read(mine, 65536).decode()

        read_until("min Js")
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
        wait_for_line(client, "accuracy")
        deadline = time.monotonic() + 20
        while not list(temporary.iterdir()) and time.monotonic() < deadline:
            time.sleep(0.01)
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
