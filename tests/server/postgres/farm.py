"""A farm for tests: front ends and workers on one PostgreSQL, with their meshes in a directory or in a bucket. It starts a
PostgreSQL server of its own, and an S3 server if the meshes are in a bucket."""
import json
import os
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
from programs import VARIMESHD, Server, run

DATABASE_SERVER, S3_SERVER = HERE / "database_server", HERE.parent / "meshes" / "s3" / "s3_server"


class Worker:
    """A varimeshd that only runs jobs, with a state directory of its own."""

    def __init__(self, state, *flags, threads=1, environment=None):
        self.state, self.environment = state, {**os.environ, **(environment or {})}
        self.arguments = [VARIMESHD, "--role", "worker", "--state", str(state), "--threads", str(threads), *flags]
        self.log = []
        self.start()

    def start(self):
        self.process = subprocess.Popen(self.arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                        env=self.environment)
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


class WithFarm(unittest.TestCase):
    """Tests with a database, and meshes in a directory, or in a bucket if `bucket` is set."""

    bucket = False
    lease_seconds = 3

    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.folder = Path(cls.place.name)
        cls.database("start")
        cls.store = (cls.folder / "database").read_text().strip()
        subprocess.run([VARIMESHD, "migrate", "--store", cls.store], check=True, stdout=subprocess.DEVNULL, timeout=30)
        cls.meshes = str(cls.folder / "meshes")
        if cls.bucket:
            cls.s3("start")
            address, _, query = cls.bucket_file().read_text().splitlines()[0].partition("?")
            cls.meshes = f"{address}/farm?{query}"
            os.environ.update(AWS_ACCESS_KEY_ID="S3RVER", AWS_SECRET_ACCESS_KEY="S3RVER")
        cls.count = 0

    @classmethod
    def tearDownClass(cls):
        cls.database("stop")
        if cls.bucket:
            cls.s3("stop")
        cls.place.cleanup()

    @classmethod
    def database(cls, step):
        subprocess.run([DATABASE_SERVER, step, cls.folder / "database"], check=True, timeout=120)

    @classmethod
    def bucket_file(cls):
        # Beside it lies the S3 server, which is installed once.
        folder = Path(os.environ.get("VARIMESH_S3_PLACE", cls.folder))
        return folder / f"bucket-{os.getpid()}"

    @classmethod
    def s3(cls, step):
        subprocess.run([S3_SERVER, step, cls.bucket_file()], check=True, timeout=150)

    @classmethod
    def shared(cls, *flags):
        return ["--store", cls.store, "--meshes", cls.meshes, "--lease-seconds", str(cls.lease_seconds), *flags]

    def state(self):
        type(self).count += 1
        return self.folder / f"state{self.count}"

    def front_end(self, *flags, **keywords):
        server = Server("--role", "frontend", "--state", str(self.state()), "--admin", "127.0.0.1:0", *self.shared(*flags),
                        **keywords)
        self.addCleanup(server.stop)
        return server

    def worker(self, *flags, **keywords):
        worker = Worker(self.state(), *self.shared(*flags), **keywords)
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

    def query(self, statement):
        """Asks the database, and returns the rows as lists of texts."""
        done = subprocess.run(["psql", self.store, "--no-align", "--tuples-only", "--command", statement], check=True,
                              capture_output=True, text=True, timeout=60)
        return [line.split("|") for line in done.stdout.splitlines()]

    def job(self, server, name, seconds=20):
        """What the page says of a job. The port gives the same answer for a moment, so a new job may not be there yet."""
        deadline = time.monotonic() + seconds
        while not (kept := self.jobs(server).get(name)):
            self.assertLess(time.monotonic(), deadline, f"{name} is not listed\n{''.join(server.log)}")
            time.sleep(0.05)
        return kept

    def wait_for(self, server, name, state, seconds=60):
        deadline = time.monotonic() + seconds
        while (kept := self.job(server, name))["state"] != state:
            self.assertNotEqual(kept["state"], "failed", kept)
            self.assertLess(time.monotonic(), deadline, f"{kept}\n{''.join(server.log)}")
            time.sleep(0.05)
        return kept


def skip_without(program):
    """Ends the process with status 77 and says why, if the program that starts a server cannot."""
    folder = os.environ.get("VARIMESH_S3_PLACE") if program == S3_SERVER else None
    with tempfile.TemporaryDirectory(dir=None) as tried:
        file = Path(folder or tried) / f"tried-{os.getpid()}"
        begun = subprocess.run([program, "start", file], capture_output=True, text=True, timeout=150)
        if begun.returncode != 0:
            file.unlink(missing_ok=True)
            print(f"SKIPPED: {begun.stdout.strip()}")
            sys.exit(77)
        subprocess.run([program, "stop", file], check=True, timeout=60)


def take_number(flag, default):
    """Removes a flag with a number from the command line."""
    if flag not in sys.argv:
        return default
    at = sys.argv.index(flag)
    value = float(sys.argv[at + 1])
    del sys.argv[at:at + 2]
    return int(value) if value == int(value) else value
