#!/usr/bin/env python3
"""A farm whose clocks are wrong, whose files are damaged, and whose database is older than its meshes. ctest runs it with
VARIMESH, VARIMESHD, SHIFTED_CLOCK and VARIMESH_SOURCE_DIR in the environment. It starts a PostgreSQL server of its own.

  farm_damage_test.py               the short form (one of the default tests): 4 jobs
  farm_damage_test.py --jobs 20     the long form
"""
import os
import signal
import struct
import subprocess
import sys
import time
import unittest

from farm import DATABASE_SERVER, TREE, WithFarm, skip_without, take_number
from programs import ENDLESS, LARGER, MESH, run

SHIFTED_CLOCK = os.environ.get("SHIFTED_CLOCK", str(TREE / "build/release/tests/server/libvarimesh_shifted_clock.so"))
HOUR = 3600
many_jobs = 4


class FarmDamage(WithFarm):
    def submit(self, server, iterations, *flags):
        return self.ask(server, "submit", LARGER, *ENDLESS[:-1], str(iterations), "--threads", "1", *flags)

    def local(self, iterations):
        """What a job of submit() has as its result."""
        out = self.folder / f"local{iterations}.msh"
        if not out.exists():
            done = run("optimise", LARGER, *ENDLESS[:-1], str(iterations), "--threads", "1", "--output", out)
            self.assertIn(done.returncode, (0, 4), done.stderr)
        return out.read_bytes()

    def result(self, server, name):
        out = self.folder / "result.msh"
        out.unlink(missing_ok=True)
        self.ask(server, "result", name, "--output", out)
        return out.read_bytes()

    def digest(self, name, which):
        """The digest of a job's input mesh, its results or its checkpoint: what it needs as such."""
        if which == "checkpoint":
            return self.query(f"SELECT checkpoint FROM jobs WHERE name = '{name}'")[0][0]
        is_mesh = "is_mesh" if which == "mesh" else "NOT is_mesh"
        rows = self.query(f"SELECT digest FROM needs JOIN jobs USING(key) WHERE name = '{name}' AND {is_mesh}")
        return [row[0] for row in rows]

    def damage(self, digest):
        path = self.folder / "meshes" / digest
        data = bytearray(path.read_bytes())
        data[len(data) // 2] ^= 1
        path.write_bytes(data)

    # ===== clocks =====

    def test_1_clocks_that_are_set_steal_no_lease(self):
        shift = self.folder / "shift"
        shift.write_bytes(struct.pack("q", 0))
        wrong = {"LD_PRELOAD": SHIFTED_CLOCK, "VARIMESH_CLOCK_SHIFT": str(shift)}

        def seconds_of_a_program():
            return int(subprocess.run(["date", "+%s"], env={**os.environ, **wrong}, capture_output=True, check=True).stdout)

        def set_clock(seconds):
            with shift.open("r+b") as file:
                file.write(struct.pack("q", seconds))

        set_clock(HOUR)
        self.assertAlmostEqual(seconds_of_a_program() - time.time(), HOUR, delta=5, msg="the library works")
        set_clock(0)
        wrong_front, front = self.front_end("--log-format", "json", **wrong), self.front_end()
        workers = [self.worker(environment=wrong), self.worker()]
        names = [self.submit(front, 900 + i) for i in range(many_jobs)]
        self.wait_for(front, names[0], "running")
        settings = 0
        while settings < 8 or self.query("SELECT count(*) FROM jobs WHERE ended IS NULL") != [["0"]]:
            set_clock((HOUR, 0, -HOUR, HOUR, -HOUR)[settings % 5])
            settings += 1
            time.sleep(1.5)  # half a lease
            if settings <= 4:
                names.append(self.submit(wrong_front, 900 + len(names)))
            self.assertLess(settings, 400, "jobs end")
        for i, name in enumerate(names):
            kept = self.wait_for(front, name, "succeeded", 300)
            self.assertEqual(kept["attempt"], 1, "no lease was stolen")
            self.assertEqual(self.result(wrong_front, name), self.local(900 + i))
        hours = {line[line.index('"time"'):][:22] for line in wrong_front.log if '"time"' in line}
        self.assertGreater(len(hours), 1, "the server has seen the wrong time")
        for worker in workers:
            self.assertEqual(worker.end(), 0)
        print(f"{len(names)} jobs, clocks set {settings} times by an hour or two: each ran once", file=sys.stderr)

    # ===== damaged files =====

    def test_2_a_damaged_mesh_is_not_run(self):
        front = self.front_end()
        job = self.submit(front, 151)
        (digest,) = self.digest(job, "mesh")
        self.damage(digest)
        worker = self.worker()
        while (kept := self.job(front, job))["state"] != "failed":
            self.assertNotEqual(kept["state"], "succeeded", "it ran on other bytes")
            time.sleep(0.05)
        said = run("watch", job, "--server", front.address)
        self.assertIn("digest", (said.stdout + said.stderr).lower() + "".join(worker.log).lower())
        again = self.submit(front, 151)
        self.wait_for(front, again, "succeeded")
        self.assertEqual(self.result(front, again), self.local(151), "the client has sent it again")

    def test_3_a_damaged_result_is_not_served(self):
        front = self.front_end()
        self.worker()
        job = self.submit(front, 152)
        self.wait_for(front, job, "succeeded")
        digests = set(self.digest(job, "result")) - set(self.digest(job, "mesh"))
        self.assertGreaterEqual(len(digests), 2, "the result and the history")
        for digest in digests:
            self.damage(digest)
        out = self.folder / "damaged.msh"
        done = run("result", job, "--server", front.address, "--output", out)
        self.assertNotEqual(done.returncode, 0)
        self.assertFalse(out.exists(), "nothing was written")
        self.assertTrue(done.stderr.strip())
        again = self.submit(front, 152)
        self.wait_for(front, again, "succeeded")
        self.assertEqual(self.result(front, again), self.local(152), "the same job is run again")

    def test_4_a_damaged_checkpoint_costs_only_time(self):
        front, worker = self.front_end(), self.worker("--checkpoint-seconds", "0.1")
        job = self.submit(front, 1500)
        deadline = time.monotonic() + 60
        while not self.digest(job, "checkpoint"):
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.02)
        worker.end(signal.SIGKILL)
        self.damage(self.digest(job, "checkpoint"))
        self.worker()
        self.assertEqual(self.wait_for(front, job, "succeeded", 200)["attempt"], 2)
        self.assertEqual(self.result(front, job), self.local(1500))

    # ===== an old database =====

    def test_5_a_database_may_be_older_than_the_meshes(self):
        front, worker = self.front_end(), self.worker()
        done_before = [self.submit(front, 160 + i) for i in range(many_jobs)]
        for name in done_before:
            self.wait_for(front, name, "succeeded")
        worker.end()
        waiting = [self.submit(front, 200 + i) for i in range(many_jobs)]
        dump = self.folder / "old.sql"
        with dump.open("w") as to:
            subprocess.run(["pg_dump", self.store], stdout=to, check=True, timeout=100)
        worker = self.worker()
        later = self.ask(front, "submit", MESH, "--label", "case=later")
        for name in (*waiting, later):
            self.wait_for(front, name, "succeeded")
        worker.end()
        front.process.kill()
        before, elsewhere = self.store, self.folder / "elsewhere"
        subprocess.run([DATABASE_SERVER, "start", elsewhere], check=True, timeout=120)
        try:
            type(self).store = elsewhere.read_text().strip()
            with dump.open() as sql:
                subprocess.run(["psql", "--quiet", "--set", "ON_ERROR_STOP=1", self.store], stdin=sql, check=True, timeout=100,
                               stdout=subprocess.DEVNULL)
            front = self.front_end()
            self.worker()
            for i, name in enumerate(done_before):
                self.assertEqual(self.result(front, name), self.local(160 + i), "whole, as it was")
            for i, name in enumerate(waiting):
                self.wait_for(front, name, "succeeded")
                self.assertEqual(self.result(front, name), self.local(200 + i), "run again, over its newer result")
            self.assertNotEqual(run("watch", later, "--server", front.address).returncode, 0, "the database does not know it")
            again = self.ask(front, "submit", MESH)
            self.wait_for(front, again, "succeeded")
        finally:
            subprocess.run([DATABASE_SERVER, "stop", elsewhere], check=True, timeout=60)
            type(self).store = before


if __name__ == "__main__":
    many_jobs = take_number("--jobs", many_jobs)
    skip_without(DATABASE_SERVER)
    unittest.main(verbosity=2)
