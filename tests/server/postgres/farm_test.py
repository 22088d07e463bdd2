#!/usr/bin/env python3
"""A small farm: two front ends and several workers on one PostgreSQL and one directory of meshes. ctest runs it with VARIMESH,
VARIMESHD and VARIMESH_SOURCE_DIR in the environment. It starts a PostgreSQL server of its own.

  farm_test.py                          the short form (one of the default tests): 6 kills of workers, 8 jobs
  farm_test.py --kills 100 --jobs 200   the long form
"""
import json
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import urllib.request
from pathlib import Path

HERE = Path(__file__).resolve().parent
TREE = HERE.parents[2]
for variable, path in {"VARIMESH": "build/release/client/varimesh", "VARIMESHD": "build/release/server/varimeshd",
                       "VARIMESH_SOURCE_DIR": "."}.items():
    os.environ.setdefault(variable, str(TREE / path))
sys.path[:0] = [str(HERE.parents[1] / "client")]
from programs import ENDLESS, LARGER, MESH, VARIMESH, VARIMESHD, Server, run, start, wait_for_line

kills, many_jobs = 6, 8


class Worker:
    """A varimeshd that only runs jobs, with a state directory of its own."""

    def __init__(self, state, *flags):
        self.state = state
        self.arguments = [VARIMESHD, "--role", "worker", "--state", str(state), "--threads", "1", *flags]
        self.log = []
        self.start()

    def start(self):
        self.process = subprocess.Popen(self.arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.reader = threading.Thread(target=lambda stream: self.log.extend(stream), args=(self.process.stderr,))
        self.reader.start()
        line = self.process.stdout.readline()
        assert line == "varimeshd runs jobs\n", line + "".join(self.log)

    def end(self, number=signal.SIGTERM):
        """Ends it with a signal. Returns the exit status."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.send_signal(number)
        status = self.process.wait(60)
        self.reader.join()
        self.process.stdout.close()
        self.process.stderr.close()
        return status


class Farm(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.folder = Path(cls.place.name)
        cls.database("start")
        cls.store = (cls.folder / "database").read_text().strip()
        subprocess.run([VARIMESHD, "migrate", "--store", cls.store], check=True, stdout=subprocess.DEVNULL, timeout=30)
        cls.count = 0

    @classmethod
    def tearDownClass(cls):
        cls.database("stop")
        cls.place.cleanup()

    @classmethod
    def database(cls, step):
        subprocess.run([HERE / "database_server", step, cls.folder / "database"], check=True, timeout=120)

    @classmethod
    def shared(cls, *flags):
        return ["--store", cls.store, "--meshes", str(cls.folder / "meshes"), "--lease-seconds", "3", *flags]

    def state(self):
        Farm.count += 1
        return self.folder / f"state{Farm.count}"

    def front_end(self):
        server = Server("--role", "frontend", "--state", str(self.state()), "--admin", "127.0.0.1:0", *self.shared())
        self.addCleanup(server.stop)
        return server

    def worker(self, *flags):
        worker = Worker(self.state(), *self.shared(*flags))
        self.addCleanup(worker.end)
        return worker

    def ask(self, server, *arguments):
        done = run(*arguments, "--server", server.address)
        self.assertEqual(done.returncode, 0, done.stderr + "".join(server.log))
        return done.stdout.strip()

    def jobs(self, server):
        address = re.search(r"http://(127\.0\.0\.1:\d+)/", "".join(server.log))[1]
        with urllib.request.urlopen(f"http://{address}/api/status", timeout=20) as answer:
            return {job["job"]: job for job in json.load(answer)["jobs"]}

    def wait_for(self, server, name, state, seconds=60):
        deadline = time.monotonic() + seconds
        while (kept := self.jobs(server)[name])["state"] != state:
            self.assertNotEqual(kept["state"], "failed", kept)
            self.assertLess(time.monotonic(), deadline, f"{kept}\n{''.join(server.log)}")
            time.sleep(0.05)
        return kept

    def test_1_any_front_end_answers_for_any_job(self):
        first, second = self.front_end(), self.front_end()
        job = self.ask(first, "submit", MESH)
        self.assertEqual(self.jobs(second)[job]["state"], "pending", "front ends run no jobs")
        self.worker()
        self.wait_for(second, job, "succeeded")
        out, local = self.folder / "out.msh", self.folder / "local.msh"
        self.ask(second, "result", job, "--output", out)
        self.assertEqual(run("optimise", MESH, "--output", local).returncode, 0)
        self.assertEqual(out.read_bytes(), local.read_bytes(), "the same bytes as without a server")
        self.assertTrue(self.ask(second, "submit", MESH), "the mesh is there, although the other front end took it")

    def test_2_a_watch_goes_on_at_the_other_front_end(self):
        first, second = self.front_end(), self.front_end()
        self.worker()
        job = self.ask(first, "submit", LARGER, *ENDLESS)
        self.wait_for(second, job, "running")
        watch = start("watch", job, "--server", first.address)
        wait_for_line(watch, r"iteration|sweep")
        first.process.kill()
        watch.kill()
        watch.communicate()
        again = start("watch", job, "--server", second.address)
        wait_for_line(again, r"iteration|sweep")
        self.ask(second, "cancel", job)
        again.communicate(timeout=40)
        self.wait_for(second, job, "cancelled")

    def test_3_another_state_of_the_meshes_is_refused(self):
        self.front_end()
        done = subprocess.run([VARIMESHD, "--listen", "127.0.0.1:0", "--state", str(self.state()), "--store", self.store,
                               "--meshes", str(self.folder / "others")], capture_output=True, text=True, timeout=30)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn("in another directory", done.stderr)
        for flags, words in ((["--role", "worker"], "--store"), (["--meshes", "x"], "--store"),
                             (["--store", self.store, "--role", "worker"], "--meshes"),
                             ([*self.shared(), "--role", "worker", "--listen", "127.0.0.1:0"], "--listen")):
            done = subprocess.run([VARIMESHD, "--state", str(self.state()), *flags], capture_output=True, text=True,
                                  timeout=30)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn(words, done.stderr)

    def test_4_a_rolling_restart_loses_nothing(self):
        front, workers = self.front_end(), [self.worker(), self.worker()]
        job = self.ask(front, "submit", LARGER, *ENDLESS[:-1], "600", "--threads", "1")
        for _ in range(2):
            self.wait_for(front, job, "running")
            for worker in workers:
                self.assertEqual(worker.end(), 0, "".join(worker.log))
                worker.start()
        self.wait_for(front, job, "succeeded")

    def test_5_nothing_is_lost_when_workers_are_killed(self):
        front, workers = self.front_end(), [self.worker("--checkpoint-seconds", "0.1") for _ in range(3)]
        names = [self.ask(front, "submit", LARGER, *ENDLESS[:-1], "300", "--threads", "1", "--label", f"number={i}")
                 for i in range(many_jobs)]
        chance = random.Random(7)
        for _ in range(kills):
            time.sleep(chance.uniform(0.5, 2.5))
            worker = chance.choice(workers)
            worker.end(signal.SIGKILL)
            worker.start()
        results = set()
        for i, name in enumerate(names):
            kept = self.wait_for(front, name, "succeeded", 600)
            self.assertLessEqual(kept["attempt"], kills + 1)
            out = self.folder / f"out{i}.msh"
            self.ask(front, "result", name, "--output", out)
            results.add(out.read_bytes())
        self.assertEqual(len(results), 1, "an attempt that was lost has changed no result")


if __name__ == "__main__":
    for flag in ("--kills", "--jobs"):
        if flag in sys.argv:
            at = sys.argv.index(flag)
            value = int(sys.argv[at + 1])
            kills, many_jobs = (value, many_jobs) if flag == "--kills" else (kills, value)
            del sys.argv[at:at + 2]
    with tempfile.TemporaryDirectory() as tried:
        file = Path(tried) / "database"
        begun = subprocess.run([HERE / "database_server", "start", file], capture_output=True, text=True, timeout=120)
        if begun.returncode != 0:
            print(f"SKIPPED: {begun.stdout.strip()}")
            sys.exit(77)
        subprocess.run([HERE / "database_server", "stop", file], check=True, timeout=60)
    unittest.main(verbosity=2)
