"""The commands for many jobs at once: submit with several meshes, wait, results, and jobs --watch."""
import contextlib
import fcntl
import hashlib
import json
import os
import pty
import re
import shlex
import shutil
import signal
import struct
import subprocess
import termios
import time
import unittest

from programs import CASES, ENDLESS, FOLDED, LARGER, MESH, VARIMESH, Server, WithFolder, WithServer, run, start


def wait_for_work(process):
    """Waits until the process has worked for two seconds, so that its runs have begun. One that has not has no mesh."""
    def seconds():
        with open(f"/proc/{process.pid}/stat", encoding="utf-8") as file:
            return sum(map(int, file.read().rsplit(")")[-1].split()[11:13])) / os.sysconf("SC_CLK_TCK")
    while seconds() < 2:
        assert process.poll() is None
        time.sleep(0.05)


class Runs(WithFolder):
    def meshes(self, **cases):
        for name, case in cases.items():
            (self.folder / f"{name}.msh").write_bytes(case.encode() if isinstance(case, str) else case.read_bytes())
        return [self.folder / f"{name}.msh" for name in cases]

    def interrupted(self, *arguments, **keywords):
        """Interrupts a run of endless meshes that reads its last mesh from a pipe into which nothing is written. So the
        others have been submitted, and the last has not."""
        pipe, into = self.folder / "pipe.msh", self.folder / "out"
        os.mkfifo(pipe)
        running = start("optimise", *self.meshes(a=LARGER, b=LARGER), pipe, "--into", into, *ENDLESS, *arguments, **keywords)
        writer = None
        while writer is None:
            self.assertIsNone(running.poll())
            with contextlib.suppress(OSError):  # until the command has opened the pipe
                writer = os.open(pipe, os.O_WRONLY | os.O_NONBLOCK)
        if "--server" not in arguments:
            wait_for_work(running)
        running.send_signal(signal.SIGINT)
        _, errors = running.communicate(timeout=60)
        os.close(writer)
        self.assertEqual(running.returncode, 130, errors)
        self.assertIn("1 of 3 meshes were not submitted", errors)
        return into, errors


class Several(Runs):
    """optimise --into, without a server."""

    def test_each_result_is_that_of_the_mesh_alone(self):
        meshes, into = self.meshes(a=MESH, b=LARGER, c=FOLDED), self.folder / "new" / "results"
        done = run("optimise", *meshes, "--into", into)
        self.assertEqual(done.returncode, 4, done.stderr)
        self.assertEqual(sorted(line.split()[0] for line in done.stdout.splitlines()),
                         [str(into / mesh.name) for mesh in meshes])
        self.assertIn("3 jobs ended: 2 certified valid, 1 with elements that are not certified valid", done.stderr)
        for mesh in meshes:
            alone = self.folder / "alone.msh"
            run("optimise", mesh, "-o", alone)
            self.assertEqual((into / mesh.name).read_bytes(), alone.read_bytes(), mesh)

    def test_a_mesh_that_is_refused_leaves_the_others(self):
        (good,) = self.meshes(good=MESH)
        wrong, missing = self.folder / "wrong.msh", self.folder / "missing.msh"
        wrong.write_text("no mesh")
        done = run("optimise", wrong, good, missing, "--into", self.folder / "out", "--json")
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertIn("missing.msh was not optimised", done.stderr)
        jobs = json.loads(done.stdout)["jobs"]
        self.assertEqual(sorted(len(job["files"]) for job in jobs), [0, 1])
        self.assertEqual(os.listdir(self.folder / "out"), ["good.msh"])

    def test_files_of_nektar_are_certified_as_they_are_read(self):
        mesh, into = self.folder / "mesh.xml", self.folder / "out"
        self.assertEqual(run("convert", CASES / "interior_p4.msh", mesh).returncode, 0)
        for where in (["-o", self.folder / "alone.xml"], ["--into", into]):
            done = run("optimise", mesh, *where)
            self.assertEqual(done.returncode, 4, done.stderr)
            self.assertIn("cannot be certified valid, because Nektar++ makes their interior", done.stderr)

    def test_what_cannot_be_is_said_before_any_work(self):
        one, other = self.meshes(one=MESH, other=MESH)
        twin = self.folder / "twin" / "one.msh"
        twin.parent.mkdir()
        shutil.copy(MESH, twin)
        into = self.folder / "out"
        for arguments, what in (([one, other, "-o", into], "name one with --into"),
                                ([one], "--output is required"),
                                ([one, twin, "--into", into], "Two meshes have the file name one.msh"),
                                ([one, "--into", self.folder], "would replace the mesh"),
                                ([one, "--into", into, "--report", "r.html"], "--report belongs to one mesh"),
                                (["-", "--into", into], "Standard input has no name")):
            done = run("optimise", *arguments)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn(what, done.stderr)
            self.assertFalse(list(into.glob("*")))
        done = run("optimise", one, "--into", self.folder / ("n" * 300))
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertIn("cannot be made: File name too long", done.stderr)

    def test_an_interrupt_keeps_the_best_meshes(self):
        meshes, into = self.meshes(a=LARGER, b=LARGER), self.folder / "out"
        running = start("optimise", *meshes, "--into", into, *ENDLESS)
        wait_for_work(running)
        running.send_signal(signal.SIGINT)
        _, errors = running.communicate(timeout=60)
        self.assertEqual(running.returncode, 130, errors)
        self.assertEqual(sorted(os.listdir(into)), ["a.msh", "b.msh"])

    def test_an_interrupt_before_all_are_submitted(self):
        into, errors = self.interrupted()
        self.assertIn("the runs end and their best meshes are written", errors)
        self.assertEqual(sorted(os.listdir(into)), ["a.msh", "b.msh"])


class SeveralOnAServer(Runs):
    def setUp(self):
        super().setUp()
        tokens = self.folder / "tokens"
        tokens.write_text(f"ann submit,read,cancel {hashlib.sha256(b'secret').hexdigest()}\n")
        tokens.chmod(0o600)
        self.server = Server("--tokens", str(tokens), "--max-bytes-per-owner", "1000000")
        self.addCleanup(self.server.stop)
        self.anns = {"env": {**os.environ, "VARIMESH_TOKEN": "secret"}}

    def test_a_mesh_that_the_server_has_no_room_for_leaves_the_others(self):
        done = run("optimise", *self.meshes(a=MESH, b="x" * 2000000, c=FOLDED), "--into", self.folder / "out", "--server",
                   self.server.address, **self.anns)
        self.assertEqual(done.returncode, 5, done.stderr)
        self.assertIn("b.msh was not optimised", done.stderr)
        self.assertEqual(sorted(os.listdir(self.folder / "out")), ["a.msh", "c.msh"])

    def test_an_interrupt_before_all_are_submitted(self):
        _, errors = self.interrupted("--server", self.server.address, **self.anns)
        jobs = re.findall(r"jobs/[0-9a-f]+", errors)
        self.assertEqual(len(set(jobs)), 2, errors)
        for job in jobs:
            self.assertEqual(run("cancel", job, "--server", self.server.address, **self.anns).returncode, 0)


class Many(WithServer):
    def setUp(self):
        super().setUp()
        self.label = f"test={self.id()}"

    def meshes(self, *names):
        for name in names:
            path = self.folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(MESH, path)
        return [self.folder / name for name in names]

    def submit(self, *arguments):
        done = self.remote("submit", *arguments, "--label", self.label)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout.split()

    def test_each_mesh_is_a_job_and_comes_back_under_its_name(self):
        jobs = self.submit(*self.meshes("a.msh", "b.msh", "c.msh"))
        self.assertEqual(len(set(jobs)), 3)
        waited = self.remote("wait", "--all", "--label", self.label)
        self.assertEqual(waited.returncode, 0, waited.stderr)
        self.assertEqual(sorted(line.split()[0] for line in waited.stdout.splitlines()), sorted(jobs))
        for line in waited.stdout.splitlines():
            self.assertRegex(line, r"succeeded  [abc]\.msh  .*min Js 0\.\d+, every element certified valid$")
        self.assertIn("3 jobs ended: 3 certified valid", waited.stderr)
        into = self.folder / "results" / "of" / "run"
        fetched = self.remote("results", "--label", self.label, "--into", into)
        self.assertEqual(fetched.returncode, 0, fetched.stderr)
        self.assertEqual(sorted(os.listdir(into)), ["a.msh", "b.msh", "c.msh"])
        self.assertEqual(len(fetched.stdout.splitlines()), 3)
        for mesh in into.iterdir():
            self.assertEqual(run("quality", mesh, "--certify").returncode, 0)
        # What is there is not fetched again, and nothing else is overwritten.
        before = {mesh.name: mesh.stat().st_mtime_ns for mesh in into.iterdir()}
        (into / "b.msh").unlink()
        (into / "c.msh").write_text("mine\n")
        again = self.remote("results", *jobs, jobs[0], "--into", into, "--json")
        self.assertEqual(again.returncode, 3, again.stderr)
        self.assertIn("another file at " + str(into / "c.msh"), again.stderr)
        self.assertEqual((into / "c.msh").read_text(), "mine\n")
        self.assertEqual((into / "a.msh").stat().st_mtime_ns, before["a.msh"])
        self.assertTrue((into / "b.msh").exists())
        files = {entry["file"]: entry["files"] for entry in json.loads(again.stdout)["jobs"]}
        self.assertEqual(files, {"a.msh": [str(into / "a.msh")], "b.msh": [str(into / "b.msh")], "c.msh": []})

    def test_results_with_one_name_are_kept_apart(self):
        jobs = self.submit(*self.meshes("x/part.msh", "y/part.msh"))
        both = self.submit(*self.meshes("two.msh"), "--output-format", "msh22", "--output-format", "msh41")
        named = self.submit(*self.meshes("z.msh"), "--label", "file=../../escaped.msh")
        self.assertEqual(self.remote("wait", *jobs, *both, *named, "--quiet").returncode, 0)
        into = self.folder / "out"
        self.assertEqual(self.remote("results", "--label", self.label, "--into", into).returncode, 0)
        ids = sorted(job.split("/")[1] for job in jobs)
        self.assertEqual(sorted(os.listdir(into)),
                         sorted([f"part-{ids[0]}.msh", f"part-{ids[1]}.msh", "two-msh22.msh", "two-msh41.msh",
                                 named[0].split("/")[1] + ".msh"]))

    def test_a_mesh_that_is_refused_does_not_hold_back_the_others(self):
        good = self.meshes("first.msh", "last.msh")
        done = self.remote("submit", good[0], self.folder / "missing.msh", good[1], "--label", self.label)
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertEqual(len(done.stdout.split()), 2)
        self.assertIn("missing.msh was not submitted", done.stderr)

    def test_a_request_id_tells_meshes_apart(self):
        meshes = self.meshes("a.msh", "b.msh")
        once = self.submit(*meshes, "--request-id", "all")
        self.assertEqual(self.submit(*meshes, "--request-id", "all"), once)
        self.assertEqual(len(set(once)), 2)
        same = self.remote("submit", *self.meshes("x/a.msh", "y/a.msh"), "--request-id", "other")
        self.assertEqual(same.returncode, 2)
        self.assertIn("Two meshes have the file name a.msh", same.stderr)

    def test_the_status_tells_the_worst_end(self):
        left = self.folder / "folded.msh"
        left.write_text(FOLDED)
        bad = self.folder / "bad.msh"
        bad.write_text("solid cube\n")
        (left_job,) = self.submit(left)
        waited = self.remote("wait", left_job)
        self.assertEqual(waited.returncode, 4, waited.stdout + waited.stderr)
        self.assertRegex(waited.stdout, r"\d elements? not certified valid")
        (failed,) = self.submit(bad)
        waited = self.remote("wait", left_job, failed)
        self.assertEqual(waited.returncode, 1)
        self.assertIn("2 jobs ended: 1 with elements that are not certified valid, 1 failed", waited.stderr)
        fetched = self.remote("results", left_job, failed, "--into", self.folder / "out")
        self.assertEqual(fetched.returncode, 1)
        self.assertRegex(fetched.stderr, failed + r"  failed  bad\.msh .*")
        self.assertEqual(os.listdir(self.folder / "out"), ["folded.msh"])

    def test_nothing_is_chosen_by_accident(self):
        for wrong in (["wait"], ["wait", "jobs/0000000000000000", "--all"], ["wait", "--label", "is=nowhere"],
                      ["wait", "jobs/0000000000000000"], ["results", "--into", self.folder]):
            self.assertEqual(self.remote(*wrong).returncode, 2, wrong)
        self.assertEqual(self.remote("jobs", "--watch", "--json").returncode, 2)
        self.assertIn("There are no such jobs", self.remote("jobs", "--watch", "--label", "is=nowhere").stderr)

    def test_waiting_is_interrupted_and_the_job_goes_on(self):
        (job,) = self.submit(LARGER, *ENDLESS, "--label", "said=it's here")
        waiting = start("wait", "--label", self.label, "--label", "said=it's here", "--server", self.server.address)
        with self.assertRaises(subprocess.TimeoutExpired):
            waiting.wait(1)
        waiting.send_signal(signal.SIGINT)
        _, errors = waiting.communicate(timeout=20)
        self.assertEqual(waiting.returncode, 130, errors)
        (line,) = [line for line in errors.splitlines() if line.startswith("  varimesh wait")]
        self.assertEqual(shlex.split(line)[2:], ["--label", self.label, "--label", "said=it's here", "--server",
                                                 self.server.address])
        running = self.remote("results", job, "--into", self.folder / "out")
        self.assertEqual(running.returncode, 1)
        self.assertIn("1 job has not ended", running.stderr)
        self.assertNotIn("0 jobs", running.stderr)
        self.assertEqual(self.remote("cancel", job).returncode, 0)
        self.assertEqual(self.remote("wait", job).returncode, 1)
        # A job that was cancelled while it ran has a mesh too.
        self.assertEqual(self.remote("results", job, "--into", self.folder / "out").returncode, 1)
        self.assertEqual(os.listdir(self.folder / "out"), [LARGER.name])

    def test_a_job_that_is_deleted_is_not_waited_for(self):
        (job,) = self.submit(LARGER, *ENDLESS)
        waiting = start("wait", job, "--server", self.server.address)
        with self.assertRaises(subprocess.TimeoutExpired):
            waiting.wait(1)
        waiting.send_signal(signal.SIGSTOP)
        self.remote("cancel", job)
        self.remote("watch", job, "--quiet")
        self.assertEqual(self.remote("delete", job).returncode, 0)
        waiting.send_signal(signal.SIGCONT)
        _, errors = waiting.communicate(timeout=20)
        self.assertEqual(waiting.returncode, 1, errors)
        self.assertIn(f"{job} was deleted by someone else", errors)


class Watch(WithServer):
    def test_every_change_is_one_line(self):
        job = self.remote("submit", MESH, "--label", "for=lines").stdout.strip()
        done = self.remote("jobs", "--label", "for=lines", "--watch")
        self.assertEqual(done.returncode, 0, done.stderr)
        states = [line.split()[1] for line in done.stdout.splitlines()]
        self.assertEqual(states[-1], "succeeded")
        self.assertEqual(len(states), len(set(states)))
        self.assertTrue(all(line.startswith(job) for line in done.stdout.splitlines()))

    def test_a_terminal_shows_a_table_until_ctrl_c(self):
        job = self.remote("submit", LARGER, *ENDLESS, "--label", "for=table").stdout.strip()
        ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 120, 0, 0))
        watching = subprocess.Popen([VARIMESH, "jobs", "--watch", "--label", "for=table", "--server", self.server.address],
                                    stdout=theirs, stderr=theirs, stdin=theirs)
        os.close(theirs)
        shown = b""
        while shown.count(b"running") < 2:  # drawn at least twice
            shown += os.read(ours, 4096)
        watching.send_signal(signal.SIGINT)
        self.assertEqual(watching.wait(20), 130)
        os.close(ours)
        self.assertIn(b"\x1b[H", shown)
        self.assertIn(b"FILE AND LABELS", shown)
        self.assertIn(job.encode(), shown)
        self.remote("cancel", job)


if __name__ == "__main__":
    unittest.main(verbosity=2)
