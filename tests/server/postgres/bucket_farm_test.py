#!/usr/bin/env python3
"""A farm whose meshes are in a bucket of an S3 server that ends while jobs run. ctest runs it with VARIMESH, VARIMESHD and
VARIMESH_SOURCE_DIR in the environment. It starts a PostgreSQL server and an S3 server of its own.

  bucket_farm_test.py                       the short form (one of the default tests): the S3 server is away for 8 seconds
  bucket_farm_test.py --away 60 --unreliable 60 --jobs 20   the long form
"""
import re
import subprocess
import sys
import time
import unittest

from faulty_proxy import FaultyProxy
from farm import DATABASE_SERVER, S3_SERVER, WithFarm, skip_without, take_number
from programs import ENDLESS, LARGER, MESH, VARIMESH, VARIMESHD, run

away_seconds, unreliable_seconds, many_jobs = 8, 5, 4


class BucketFarm(WithFarm):
    bucket = True

    def test_1_runs_jobs(self):
        first, second = self.front_end(), self.front_end()
        self.worker()
        job = self.ask(first, "submit", MESH)
        self.wait_for(second, job, "succeeded")
        out, local = self.folder / "out.msh", self.folder / "local.msh"
        self.ask(second, "result", job, "--output", out)
        self.assertEqual(run("optimise", MESH, "--output", local).returncode, 0)
        self.assertEqual(out.read_bytes(), local.read_bytes(), "the same bytes as without a server")
        self.assertTrue(self.ask(second, "submit", MESH), "the mesh is there, although the other front end took it")
        for server in (first, second):
            self.assertNotIn("S3RVER", "".join(server.log), "no log has the credentials")

    def test_2_no_job_fails_while_the_bucket_is_away(self):
        front, workers = self.front_end(), [self.worker("--checkpoint-seconds", "0.5") for _ in range(2)]
        names = [self.ask(front, "submit", LARGER, *ENDLESS[:-1], str(200 + 40 * i), "--threads", "1") for i in
                 range(many_jobs)]
        while self.query("SELECT count(*) FROM jobs WHERE state = 2") == [["0"]]:
            time.sleep(0.1)
        time.sleep(1)
        self.s3("kill")
        # The client is told to try again, and waits.
        waiting = subprocess.Popen([VARIMESH, "submit", str(MESH), "--server", front.address], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        time.sleep(away_seconds)
        for worker in workers:
            self.assertIsNone(worker.process.poll(), "".join(worker.log))
        self.s3("again")
        back = time.monotonic()
        names.append(self.ask(front, "submit", MESH))
        self.assertLess(time.monotonic() - back, 5, "a submission after the return of the bucket")
        output, errors = waiting.communicate(timeout=100)
        self.assertIn(waiting.returncode, (0, 5), errors)  # it has waited, or failed in order
        if waiting.returncode == 0:
            names.append(output.strip())
        for i, name in enumerate(names):
            self.assertEqual(self.wait_for(front, name, "succeeded", 300)["attempt"], 1)
            out = self.folder / f"out{i}.msh"
            self.ask(front, "result", name, "--output", out)
            if i < many_jobs:
                local = self.folder / "local.msh"
                done = run("optimise", LARGER, *ENDLESS[:-1], str(200 + 40 * i), "--threads", "1", "--output", local)
                self.assertIn(done.returncode, (0, 4), done.stderr)
                self.assertEqual(out.read_bytes(), local.read_bytes())

    def test_3_no_job_fails_while_the_bucket_is_unreliable(self):
        port = int(re.search(r"127\.0\.0\.1:(\d+)", self.meshes)[1])
        proxy, direct = FaultyProxy(port), self.meshes
        self.addCleanup(proxy.close)
        type(self).meshes = direct.replace(f":{port}", f":{proxy.port}")
        try:
            front = self.front_end()
            for _ in range(2):
                self.worker("--checkpoint-seconds", "0.5")
            proxy.faulty = True
            names, begun = [], time.monotonic()
            while len(names) < many_jobs or time.monotonic() - begun < unreliable_seconds:
                names.append(self.ask(front, "submit", LARGER, *ENDLESS[:-1], str(150 + len(names)), "--threads", "1"))
            for i, name in enumerate(names):
                self.assertEqual(self.wait_for(front, name, "succeeded", 300)["attempt"], 1)
                out, local = self.folder / "unreliable.msh", self.folder / "reliable.msh"
                self.ask(front, "result", name, "--output", out)
                done = run("optimise", LARGER, *ENDLESS[:-1], str(150 + i), "--threads", "1", "--output", local)
                self.assertIn(done.returncode, (0, 4), done.stderr)
                self.assertEqual(out.read_bytes(), local.read_bytes())
                out.unlink()
        finally:
            type(self).meshes = direct
        print(f"{len(names)} jobs, all whole in their first attempts; connections: {proxy.counts}", file=sys.stderr)
        for kind in ("503", "cut request", "cut answer", "slow"):
            self.assertGreater(proxy.counts[kind], 0, kind)

    def test_4_a_wrong_bucket_is_refused(self):
        for meshes, status, words in (("s3://b?endpoint=nowhere", 2, "endpoint"),
                                      (self.meshes.replace("//varimesh/", "//other/"), 1, "NoSuchBucket")):
            done = subprocess.run([VARIMESHD, "--listen", "127.0.0.1:0", "--state", str(self.state()), "--store", self.store,
                                   "--meshes", meshes], capture_output=True, text=True, timeout=60)
            self.assertEqual(done.returncode, status, done.stderr)
            self.assertIn(words, done.stderr)


if __name__ == "__main__":
    away_seconds, many_jobs = take_number("--away", away_seconds), take_number("--jobs", many_jobs)
    unreliable_seconds = take_number("--unreliable", unreliable_seconds)
    skip_without(DATABASE_SERVER)
    skip_without(S3_SERVER)
    unittest.main(verbosity=2)
