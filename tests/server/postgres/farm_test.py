#!/usr/bin/env python3
"""A small farm: two front ends and several workers on one PostgreSQL and one directory of meshes. ctest runs it with VARIMESH,
VARIMESHD and VARIMESH_SOURCE_DIR in the environment. It starts a PostgreSQL server of its own.

  farm_test.py                          the short form (one of the default tests): 6 kills of workers, 8 jobs
  farm_test.py --kills 100 --jobs 200 --iterations 1000 Farm.test_5_nothing_is_lost_when_workers_are_killed
                                        the long form
"""
import random
import re
import signal
import subprocess
import sys
import threading
import time
import unittest
import urllib.request

from farm import DATABASE_SERVER, TREE, WithFarm, skip_without, take_number
from programs import ENDLESS, LARGER, MESH, VARIMESHD, run, start, wait_for_line

kills, many_jobs, many_iterations = 6, 8, 300


def autoscaler_queries():
    """What KEDA asks the database."""
    return re.findall(r"query: (.*)", (TREE / "deploy/farm/kubernetes/overlays/keda/scaling.yaml").read_text())


class Reclaims(threading.Thread):
    """Looks how long the jobs of workers that were killed are without another one."""

    def __init__(self, query):
        super().__init__()
        self.query, self.lost, self.seconds, self.with_checkpoint, self.ended = query, {}, [], 0, threading.Event()
        self.lock = threading.Lock()
        self.start()

    def note(self, worker):
        """The worker was killed just now."""
        rows = self.query("SELECT name, token, checkpoint_iteration FROM jobs WHERE state = 2 AND "
                          f"position(':{worker.state.resolve()} ' in worker) > 0")
        with self.lock:
            for name, token, iteration in rows:
                self.lost[name, token] = time.monotonic()
                self.with_checkpoint += iteration != "0"

    def run(self):
        while not self.ended.wait(0.25):
            with self.lock:
                lost = dict(self.lost)
            if not lost:
                continue
            wanted = "', '".join(name for name, _ in lost)
            held = {(name, token) for name, token in
                    self.query(f"SELECT name, token FROM jobs WHERE state = 2 AND name IN ('{wanted}')")}
            for key, since in lost.items():
                if key not in held:
                    self.seconds.append(time.monotonic() - since)
                    with self.lock:
                        del self.lost[key]


class Farm(WithFarm):
    def test_1_any_front_end_answers_for_any_job(self):
        first, second = self.front_end(), self.front_end()
        job = self.ask(first, "submit", MESH)
        self.assertEqual(self.job(second, job)["state"], "pending", "front ends run no jobs")
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
        job = self.ask(front, "submit", LARGER, *ENDLESS[:-1], "2500", "--threads", "1")  # longer than both restarts
        for _ in range(2):
            self.wait_for(front, job, "running")
            for worker in workers:
                self.assertEqual(worker.end(), 0, "".join(worker.log))
                worker.start()
        self.wait_for(front, job, "succeeded", 200)

    def test_5_nothing_is_lost_when_workers_are_killed(self):
        fronts = self.front_end(), self.front_end()
        workers = [self.worker("--checkpoint-seconds", "0.1") for _ in range(4)]
        names = [self.ask(fronts[i % 2], "submit", LARGER, *ENDLESS[:-1], str(many_iterations), "--threads", "1", "--label",
                          f"number={i}") for i in range(many_jobs)]
        chance = random.Random(7)
        reclaims = Reclaims(self.query)
        self.addCleanup(reclaims.join)
        self.addCleanup(reclaims.ended.set)
        for i in range(kills):
            time.sleep(chance.uniform(0.5, 2.5))
            place = chance.randrange(len(workers))
            workers[place].end(signal.SIGKILL)
            if i % 2 == 0:  # on another machine: its jobs wait for their leases
                reclaims.note(workers[place])
                workers[place] = self.worker("--checkpoint-seconds", "0.1")
            else:
                workers[place].start()
        left = sum(row[0] == "1" for row in self.query("SELECT state FROM jobs WHERE state IN (1, 2)"))
        results, attempts = set(), 0
        for i, name in enumerate(names):
            kept = self.wait_for(fronts[0], name, "succeeded", 600)
            attempts += kept["attempt"]
            self.assertLessEqual(kept["attempt"], kills + 1)
            out = self.folder / f"out{i}.msh"
            self.ask(fronts[1], "result", name, "--output", out)
            results.add(out.read_bytes())
        self.assertEqual(len(results), 1, "an attempt that was lost has changed no result")
        reclaims.ended.set()
        reclaims.join()
        self.assertEqual(reclaims.lost, {})
        print(f"{kills} kills, {many_jobs} jobs, {attempts} attempts, {left} jobs waited at the last kill; {len(reclaims.seconds)} "
              f"jobs without a lease, {reclaims.with_checkpoint} with a checkpoint, were taken back after at most "
              f"{max(reclaims.seconds, default=0):.1f} s (lease {self.lease_seconds} s)", file=sys.stderr)
        self.assertLess(max(reclaims.seconds, default=0), self.lease_seconds + 5)

    def test_6_a_cluster_learns_what_it_asks(self):
        servers = [self.front_end("--metrics", "127.0.0.1:0"), self.worker("--metrics", "127.0.0.1:0")]
        for server in servers:
            deadline = time.monotonic() + 10  # the log comes by another pipe than the line that says that it runs
            while not (found := re.search(r"http://(\S+)/metrics", "".join(server.log))):
                self.assertLess(time.monotonic(), deadline, "".join(server.log))
                time.sleep(0.01)
            address = found[1]
            for probe in ("live", "ready"):
                with urllib.request.urlopen(f"http://{address}/healthz/{probe}", timeout=10) as answer:
                    self.assertEqual(answer.status, 200)
        servers[1].end()
        before = [int(self.query(query)[0][0]) for query in autoscaler_queries()]
        self.ask(servers[0], "submit", MESH, "--label", "case=scaled")
        time.sleep(1.1)
        after = [int(self.query(query)[0][0]) for query in autoscaler_queries()]
        self.assertEqual(after[0], before[0] + 1)
        self.assertGreaterEqual(after[1], 1, "seconds that the job has waited")
        self.ask(servers[0], "submit", MESH, "--label", "case=scaled", "--device", "gpu")
        self.assertEqual(int(self.query(autoscaler_queries()[0])[0][0]), after[0], "the workers have no devices")

    def progress(self, job):
        """The attempt and the last iteration that its worker has told the database."""
        stored = bytes.fromhex(self.query(f"SELECT encode(job, 'hex') FROM jobs WHERE name = '{job}'")[0][0])
        text = subprocess.run(["protoc", f"-I{TREE / 'proto'}", "--decode=varimesh.v1.Job", "varimesh/v1/job.proto"],
                              input=stored, capture_output=True, check=True, timeout=20).stdout.decode()
        found = [re.search(pattern, text) for pattern in (r"(?m)^attempt: (\d+)", r"(?m)^iteration \{\n(?:.*\n)*?  number: (\d+)")]
        return tuple(int(one[1]) if one else 0 for one in found)

    def test_7_a_job_goes_on_from_its_checkpoint(self):
        front, worker = self.front_end(), self.worker("--checkpoint-seconds", "0.1")
        job = self.ask(front, "submit", LARGER, *ENDLESS[:-1], "1200", "--threads", "1", "--label", "case=resumed")
        deadline = time.monotonic() + 60
        while int(self.query(f"SELECT checkpoint_iteration FROM jobs WHERE name = '{job}'")[0][0]) < 300:
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.02)
        worker.end(signal.SIGKILL)
        saved = int(self.query(f"SELECT checkpoint_iteration FROM jobs WHERE name = '{job}'")[0][0])
        last = self.progress(job)
        self.assertEqual(last[0], 1, "it is not at its end")
        self.worker()
        # A worker tells its first iteration at once.
        while (now := self.progress(job)) in (last, (2, last[1])):
            self.assertLess(time.monotonic(), deadline)
        self.assertEqual(now[0], 2)
        self.assertGreater(now[1], saved, "not from its beginning")
        self.wait_for(front, job, "succeeded")


if __name__ == "__main__":
    kills, many_jobs = take_number("--kills", kills), take_number("--jobs", many_jobs)
    many_iterations = take_number("--iterations", many_iterations)
    skip_without(DATABASE_SERVER)
    unittest.main(verbosity=2)
