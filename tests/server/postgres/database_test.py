#!/usr/bin/env python3
"""varimeshd with its jobs in PostgreSQL, from outside: tables, refusals, a database that ends while jobs run, and servers
that are stopped and killed. ctest runs it with VARIMESH, VARIMESHD, KILL_SERVER and VARIMESH_SOURCE_DIR in the
environment. It starts a PostgreSQL server of its own.

  database_test.py                          the short form (one of the default tests): the database is away for 4
                                            seconds, and the server is killed 4 times
  database_test.py --away 60 --kills 100    the long form
"""
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.request
from pathlib import Path

HERE = Path(__file__).resolve().parent
TREE = HERE.parents[2]
for variable, path in {"VARIMESH": "build/release/client/varimesh", "VARIMESHD": "build/release/server/varimeshd",
                       "KILL_SERVER": "build/release/tests/faults/kill_server", "VARIMESH_SOURCE_DIR": "."}.items():
    os.environ.setdefault(variable, str(TREE / path))
sys.path[:0] = [str(HERE.parents[1] / "client")]
from programs import ENDLESS, LARGER, MESH, VARIMESH, VARIMESHD, Server, run

away_seconds, kills = 4, 4


def processor_seconds(server):
    """Of the server and of the processes of its jobs."""
    ticks = 0
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            fields = (folder / "stat").read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue
        if server.process.pid in (int(folder.name), int(fields[1])):
            ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")


class WithDatabase(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.file = Path(cls.place.name) / "database"
        cls.database("start")
        cls.store = cls.file.read_text().strip()

    @classmethod
    def tearDownClass(cls):
        cls.database("stop")
        cls.place.cleanup()

    @classmethod
    def database(cls, step):
        subprocess.run([HERE / "database_server", step, cls.file], check=True, timeout=120)

    def migrate(self):
        return subprocess.run([VARIMESHD, "migrate", "--store", self.store], capture_output=True, text=True, timeout=30)

    def serve(self, *flags):
        state = tempfile.TemporaryDirectory()
        self.addCleanup(state.cleanup)
        server = Server("--state", state.name, "--store", self.store, "--meshes", f"{self.place.name}/meshes", "--threads",
                        "2", "--admin", "127.0.0.1:0", *flags)
        self.addCleanup(server.stop)
        return server

    def ask(self, server, *arguments):
        done = run(*arguments, "--server", server.address)
        self.assertEqual(done.returncode, 0, done.stderr + "".join(server.log))
        return done.stdout.strip()

    def job(self, server, name):
        """What the admin port says about the job."""
        address = re.search(r"http://(127\.0\.0\.1:\d+)/", "".join(server.log))[1]
        with urllib.request.urlopen(f"http://{address}/api/status", timeout=20) as answer:
            return next(job for job in json.load(answer)["jobs"] if job["job"] == name)

    def wait_for(self, server, name, state):
        deadline = time.monotonic() + 60
        while self.job(server, name)["state"] != state:
            self.assertLess(time.monotonic(), deadline, "".join(server.log))
            time.sleep(0.1)


class Jobs(WithDatabase):
    def test_1_needs_tables_and_a_state_directory(self):
        with tempfile.TemporaryDirectory() as state:
            for flags, status, words in (
                    (["--store", self.store], 2, "--state"),
                    (["--store", "postgresql://farm:secret@host/jobs", "--state", state], 2, "PGPASSFILE"),
                    (["--store", "file.sqlite", "--state", state], 2, "postgresql://"),
                    (["--store", self.store, "--state", state], 1, "varimeshd migrate")):
                done = subprocess.run([VARIMESHD, "--listen", "127.0.0.1:0", *flags], capture_output=True, text=True,
                                      timeout=30)
                self.assertEqual(done.returncode, status, done.stderr)
                self.assertIn(words, done.stderr)
                self.assertNotIn("secret", done.stderr)

    def test_2_migrates_once(self):
        first, second = self.migrate(), self.migrate()
        self.assertEqual((first.returncode, second.returncode), (0, 0), first.stderr + second.stderr)
        self.assertIn("Made the tables", first.stdout)
        self.assertIn("already", second.stdout)

    def test_3_runs_a_job(self):
        self.migrate()
        server = self.serve()
        with tempfile.TemporaryDirectory() as folder:
            done = run("optimise", MESH, "--output", Path(folder) / "out.msh", "--server", server.address)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertTrue((Path(folder) / "out.msh").exists())
        self.assertIn("succeeded", self.ask(server, "jobs").lower())

    def test_4_jobs_go_on_while_the_database_is_away(self):
        self.migrate()
        server = self.serve()
        endless = self.ask(server, "submit", LARGER, *ENDLESS, "--threads", "1")
        self.wait_for(server, endless, "running")
        self.database("kill")
        begun, work = time.monotonic(), processor_seconds(server)
        waiting = subprocess.Popen([VARIMESH, "submit", str(MESH), "--server", server.address], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        try:
            time.sleep(begun + away_seconds - time.monotonic())
            self.assertIsNone(server.process.poll(), "".join(server.log))
            self.assertGreater(processor_seconds(server) - work, 0.1 * away_seconds, "the job went on")
        finally:
            self.database("again")
        back = time.monotonic()
        submitted = [self.ask(server, "submit", MESH)]
        self.assertLess(time.monotonic() - back, 5, "a submission after the return of the database")
        output, errors = waiting.communicate(timeout=100)
        self.assertIn(waiting.returncode, (0, 5), errors)  # it has waited, or failed in order
        if waiting.returncode == 0:
            submitted.append(output.strip())
        for name in submitted:
            self.wait_for(server, name, "succeeded")
        kept = self.job(server, endless)
        self.assertEqual((kept["state"], kept["attempt"]), ("running", 1), "".join(server.log))
        log = "".join(server.log)
        self.assertIn("the database cannot be reached", log)
        self.assertIn("the database is back", log)
        self.ask(server, "cancel", endless)
        self.wait_for(server, endless, "cancelled")

    def test_5_a_server_that_slept_too_long_loses_its_job(self):
        self.migrate()
        first, second = self.serve("--lease-seconds", "2"), self.serve("--lease-seconds", "2")
        for server in (first, second):
            self.addCleanup(os.kill, server.process.pid, signal.SIGCONT)
        os.kill(second.process.pid, signal.SIGSTOP)
        job = self.ask(first, "submit", LARGER, *ENDLESS[:-1], "1000", "--threads", "1", "--label", "case=slept")
        self.wait_for(first, job, "running")
        os.kill(first.process.pid, signal.SIGSTOP)
        os.kill(second.process.pid, signal.SIGCONT)
        begun = time.monotonic()
        while self.job(second, job)["attempt"] < 2:
            self.assertLess(time.monotonic(), begun + 2 + 10, "the lease, and the next look of the other server")
            time.sleep(0.05)
        os.kill(first.process.pid, signal.SIGCONT)
        self.wait_for(second, job, "succeeded")
        kept = self.job(second, job)
        self.assertEqual(kept["attempt"], 2)
        deadline = time.monotonic() + 30
        while not re.search(rf"{job} (lease cannot be renewed|cannot be finished): Another worker", "".join(first.log)):
            self.assertLess(time.monotonic(), deadline, "".join(first.log))
            time.sleep(0.1)
        with tempfile.TemporaryDirectory() as folder:
            run("result", job, "--server", second.address, "--output", Path(folder) / "out.msh")
            self.assertTrue((Path(folder) / "out.msh").exists())
        self.assertEqual(self.job(second, job), kept, "the late end has changed nothing")

    def test_6_a_server_with_other_meshes_is_refused(self):
        self.migrate()
        self.serve()
        with tempfile.TemporaryDirectory() as state:
            done = subprocess.run([VARIMESHD, "--listen", "127.0.0.1:0", "--state", state, "--store", self.store],
                                  capture_output=True, text=True, timeout=30)
            self.assertEqual(done.returncode, 1, done.stderr)
            self.assertIn("in another directory", done.stderr)

    def test_7_nothing_is_lost_when_the_server_is_killed(self):
        self.migrate()
        subprocess.run(["psql", "--quiet", self.store, "--command", "DELETE FROM meshes"], check=True, timeout=30)
        done = subprocess.run([os.environ["KILL_SERVER"], "--store", self.store, "--kills", str(kills), "--jobs", "4"],
                              capture_output=True, text=True, timeout=3000)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        print(done.stdout.strip().splitlines()[-1], file=sys.stderr)  # the summary


if __name__ == "__main__":
    if "--kills" in sys.argv:
        at = sys.argv.index("--kills")
        kills = int(sys.argv[at + 1])
        del sys.argv[at:at + 2]
    if "--away" in sys.argv:
        at = sys.argv.index("--away")
        away_seconds = float(sys.argv[at + 1])
        del sys.argv[at:at + 2]
    with tempfile.TemporaryDirectory() as tried:
        file = Path(tried) / "database"
        start = subprocess.run([HERE / "database_server", "start", file], capture_output=True, text=True, timeout=120)
        if start.returncode != 0:
            print(f"SKIPPED: {start.stdout.strip()}")
            sys.exit(77)
        subprocess.run([HERE / "database_server", "stop", file], check=True, timeout=60)
    unittest.main(verbosity=2)
