#!/usr/bin/env python3
"""A small farm: two front ends and several workers on one PostgreSQL and one directory of meshes. ctest runs it with VARIMESH,
VARIMESHD and VARIMESH_SOURCE_DIR in the environment. It starts a PostgreSQL server of its own.

  farm_test.py                          the short form (one of the default tests): 6 kills of workers, 8 jobs
  farm_test.py --kills 100 --jobs 200   the long form
"""
import random
import signal
import subprocess
import time
import unittest

from farm import DATABASE_SERVER, WithFarm, skip_without, take_number
from programs import ENDLESS, LARGER, MESH, VARIMESHD, run, start, wait_for_line

kills, many_jobs = 6, 8


class Farm(WithFarm):
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
    kills, many_jobs = take_number("--kills", kills), take_number("--jobs", many_jobs)
    skip_without(DATABASE_SERVER)
    unittest.main(verbosity=2)
