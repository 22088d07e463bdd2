#!/usr/bin/env python3
"""Faults of a farm: front ends, workers and clients that end at the wrong moment. ctest runs the short form with VARIMESH,
VARIMESHD and VARIMESH_SOURCE_DIR in the environment. It starts a PostgreSQL server of its own.

  farm_faults_test.py                                         the short form
  farm_faults_test.py --watches 50 --clients 100 --jobs 100   the long form, which needs a quiet machine
  farm_faults_test.py --quiet --jobs 40 Faults.test_3_a_poisonous_mesh_fails_alone
                                     on a machine that does nothing else: the throughput must be as documented
"""
import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from pathlib import Path

from farm import DATABASE_SERVER, TREE, WithFarm, skip_without, take_number
from programs import CASES, ENDLESS, LARGER, VARIMESH, Server

many_watches, many_clients, many_jobs = 8, 8, 8
is_quiet = False  # whether times say something


def stubs(folder):
    """Makes Python's modules of the contract, and returns the ones of the service. None if a package is missing."""
    plugin = shutil.which("grpc_python_plugin")
    files = sorted(str(file.relative_to(TREE / "proto")) for file in (TREE / "proto").rglob("*.proto"))
    try:
        import grpc
        subprocess.run(["protoc", f"--plugin=protoc-gen-grpc_python={plugin}", f"--python_out={folder}",
                        f"--grpc_python_out={folder}", *files], cwd=TREE / "proto", check=True, capture_output=True)
        sys.path.insert(0, str(folder))
        from varimesh.v1 import service_pb2, service_pb2_grpc
    except (ImportError, OSError, subprocess.CalledProcessError):
        return None
    return grpc, service_pb2, service_pb2_grpc


def children_of(process):
    """The processes that any thread of a process has started. A thread that ends meanwhile has none."""
    found = []
    for children in Path(f"/proc/{process}/task").glob("*/children"):
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):
            found += [int(child) for child in children.read_text().split()]
    return found


class Watch(threading.Thread):
    """Watches a job at one front end, and at the next one when that is lost."""

    def __init__(self, modules, job, servers):
        super().__init__()
        self.modules, self.job, self.servers = modules, job, servers
        self.events, self.resumed, self.error = [], 0, None
        self.start()

    def run(self):
        grpc, messages, services = self.modules
        after = 0
        for address in self.servers:
            with grpc.insecure_channel(address) as channel:
                try:
                    request = messages.WatchJobRequest(name=self.job, after_sequence=after)
                    for answer in services.JobServiceStub(channel).WatchJob(request, timeout=300):
                        event = answer.event
                        if event.WhichOneof("event") != "bookmark" and event.sequence:
                            self.events.append(event)
                            after = max(after, event.sequence)
                    return
                except grpc.RpcError as error:
                    if error.code() != grpc.StatusCode.UNAVAILABLE:
                        self.error = error
                        return
                    self.resumed += 1
        self.error = "all front ends were lost"


class Faults(WithFarm):
    def submit(self, server, iterations, *flags):
        return self.ask(server, "submit", LARGER, *ENDLESS[:-1], str(iterations), "--threads", "1", *flags)

    def finished(self, server, names, seconds=600):
        """Waits for the end of all jobs, and returns how long that took."""
        begun = time.monotonic()
        wanted = "', '".join(names)
        while int(self.query(f"SELECT count(*) FROM jobs WHERE name IN ('{wanted}') AND ended IS NULL")[0][0]):
            self.assertLess(time.monotonic() - begun, seconds, "".join(server.log)[-4000:])
            time.sleep(0.1)
        return time.monotonic() - begun

    def test_1_watches_go_on_when_their_front_end_is_killed(self):
        modules = stubs(self.folder)
        if modules is None:
            self.skipTest("python3-grpcio, python3-protobuf or protobuf-compiler-grpc is missing (deploy/setup build test)")
        first, second = self.front_end(), self.front_end()
        self.worker()
        self.worker()
        jobs = [self.submit(first, 100_000) for _ in range(2)]
        self.wait_for(second, jobs[0], "running")
        watches = [Watch(modules, jobs[i % 2], [first.address, second.address]) for i in range(many_watches)]
        time.sleep(3)
        first.process.kill()
        time.sleep(3)
        for job in jobs:
            self.ask(second, "cancel", job)
        for watch in watches:
            watch.join(300)
        whole = {job: Watch(modules, job, [second.address]) for job in jobs}
        for watch in whole.values():
            watch.join(100)
        for watch in watches:
            self.assertIsNone(watch.error)
            self.assertEqual(watch.resumed, 1, "it has been at both front ends")
            numbers = [event.sequence for event in watch.events]
            self.assertEqual(numbers, sorted(set(numbers)), "no duplicate")
            lasting = [event.sequence for event in watch.events if event.WhichOneof("event") in ("state_change", "quality")]
            wanted = [event.sequence for event in whole[watch.job].events
                      if event.WhichOneof("event") in ("state_change", "quality")]
            self.assertEqual(lasting, wanted, "no gap among the states and the reports")
            self.assertTrue(any(event.WhichOneof("event") == "iteration" for event in watch.events))
        print(f"{many_watches} watches resumed at the other front end, without gap or duplicate", file=sys.stderr)

    def test_2_a_rolling_restart_is_seen_by_no_client(self):
        sockets = [f"unix:{self.folder}/front{i}" for i in range(2)]
        states = [self.state() for _ in sockets]

        def serve(i):
            return Server("--role", "frontend", "--state", str(states[i]), "--admin", "127.0.0.1:0", *self.shared(),
                          listen=sockets[i])

        fronts = [serve(0), serve(1)]
        workers = [self.worker() for _ in range(2)]
        try:
            clients = [subprocess.Popen(
                [VARIMESH, "optimise", str(LARGER), *ENDLESS[:-1], str(100 + i), "--threads", "1", "--output",
                 str(self.folder / f"rolled{i}.msh"), "--server", sockets[i % 2]], stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE, text=True) for i in range(many_clients)]
            time.sleep(1)
            restarts = 0
            while restarts < 2 or any(client.poll() is None for client in clients):
                for i in range(2):
                    self.assertEqual(fronts[i].stop()[0], 0)
                    fronts[i] = serve(i)
                    self.assertEqual(workers[i].end(), 0)
                    workers[i].start()
                    time.sleep(1)
                restarts += 1
            for client in clients:
                _, errors = client.communicate(timeout=300)
                self.assertIn(client.returncode, (0, 4), errors)
            self.assertEqual(len(list(self.folder.glob("rolled*.msh"))), many_clients)
            print(f"{many_clients} clients, {restarts} restarts of everything: no error", file=sys.stderr)
        finally:
            for front in fronts:
                front.stop()

    def kill_whoever_runs(self, name, workers, ended):
        """Kills the process that runs a job as soon as it does, as a poisonous mesh would. Returns how many attempts it saw. An attempt
        that takes a process killed with the one before has ended before it is seen."""
        attempts = set()
        while not ended.is_set():
            rows = self.query(f"SELECT worker, state, token FROM jobs WHERE name = '{name}'")
            if rows and rows[0][1] in "456" and not rows[0][0]:
                break
            for worker in workers:
                if rows and rows[0][0] and rows[0][0].partition(":")[2].split(" ")[0] == str(worker.state.resolve()):
                    # One of its processes runs the job, and another one is ready for the next job. The worker has its row before
                    # it takes a process: if only the ready one was killed, the job runs in a new one, and the next turn kills that.
                    for child in children_of(worker.process.pid):
                        with contextlib.suppress(ProcessLookupError):  # it has just ended
                            os.kill(child, signal.SIGKILL)
                    attempts.add(rows[0][2])
            time.sleep(0.02)
        return len(attempts)

    def test_3_a_poisonous_mesh_fails_alone(self):
        front, workers = self.front_end(), [self.worker("--checkpoint-seconds", "0.1") for _ in range(4)]
        took = []
        for poisoned in (False, True):
            names = [self.submit(front, 150) for _ in range(many_jobs)]
            begun = time.monotonic()
            if poisoned:
                # It takes seconds to its first iteration, and is killed before.
                poison = self.ask(front, "submit", CASES / "solid_ball_p3.msh", "--order", "10", "--priority", "50",
                                  "--threads", "1")
                ended = threading.Event()
                counted = []
                killer = threading.Thread(target=lambda: counted.append(self.kill_whoever_runs(poison, workers, ended)))
                killer.start()
            self.finished(front, names)
            took.append(time.monotonic() - begun)
            if poisoned:
                killer.join(100)
                ended.set()
                job = self.job(front, poison)
                self.assertEqual((job["state"], job["attempt"]), ("failed", 3), job)
                self.assertIn(counted, ([1], [2], [3]))
            wanted = "', '".join(names)
            self.assertEqual(self.query(f"SELECT state, count(*) FROM jobs WHERE name IN ('{wanted}') GROUP BY state"),
                             [["4", str(many_jobs)]], "all SUCCEEDED")
        print(f"{many_jobs} jobs took {took[0]:.1f} s, and {took[1]:.1f} s beside a poisonous one: "
              f"{took[0] / took[1]:.2f} of the throughput", file=sys.stderr)
        if is_quiet:
            self.assertGreater(took[0] / took[1], 0.9)

    def test_4_four_workers_are_as_fast_as_one_with_two_threads(self):
        front = self.front_end()
        took = {}
        for workers, threads in ((1, 2), (4, 1)):
            names = [self.submit(front, 150) for _ in range(many_jobs)]
            there = [self.worker(threads=threads) for _ in range(workers)]
            took[workers] = self.finished(front, names)
            for worker in there:
                worker.end()
        print(f"{many_jobs} jobs: one worker with two threads {took[1]:.1f} s, four workers {took[4]:.1f} s: "
              f"{took[1] / took[4]:.3f} of the throughput", file=sys.stderr)
        self.assertGreater(took[1] / took[4], 0.95 if is_quiet else 0.5)

    def test_5_a_backup_of_a_running_farm_is_whole(self):
        front, worker = self.front_end(), self.worker("--checkpoint-seconds", "0.1")
        names = [self.submit(front, 150 + i) for i in range(many_jobs)]
        self.wait_for(front, names[0], "succeeded")
        # The database first: whatever it names is in the meshes, or was there shortly before.
        dump = self.folder / "farm.sql"
        with dump.open("w") as to:
            subprocess.run(["pg_dump", self.store], stdout=to, check=True, timeout=100)
        shutil.copytree(self.meshes, self.folder / "restored")
        rows = self.query("SELECT count(*) FROM jobs WHERE ended IS NULL")
        self.assertGreater(int(rows[0][0]), 0, "jobs ran")
        before = self.store, self.meshes
        elsewhere = self.folder / "elsewhere"
        subprocess.run([DATABASE_SERVER, "start", elsewhere], check=True, timeout=120)
        try:
            type(self).store, type(self).meshes = elsewhere.read_text().strip(), str(self.folder / "restored")
            with dump.open() as sql:
                subprocess.run(["psql", "--quiet", "--set", "ON_ERROR_STOP=1", self.store], stdin=sql, check=True, timeout=100,
                               stdout=subprocess.DEVNULL)
            other = self.front_end()
            self.worker()
            self.finished(other, names)
            jobs = self.jobs(other)
            for i, name in enumerate(names):
                self.assertEqual(jobs[name]["state"], "succeeded", jobs[name])
                self.ask(other, "result", name, "--output", self.folder / f"restored{i}.msh")
            # The first farm went on. What it has made meanwhile, the other has made too, byte for byte.
            there = self.jobs(front)
            both = [i for i, name in enumerate(names) if there[name]["state"] == "succeeded"]
            self.assertIn(0, both)
            for i in both:
                self.ask(front, "result", names[i], "--output", self.folder / f"first{i}.msh")
                self.assertEqual(*((self.folder / f"{farm}{i}.msh").read_bytes() for farm in ("first", "restored")))
        finally:
            subprocess.run([DATABASE_SERVER, "stop", elsewhere], check=True, timeout=60)
            type(self).store, type(self).meshes = before
        print(f"{many_jobs} jobs of a backup are there, all with results; {rows[0][0]} had not ended, and {len(both)} results are "
              "the same as those of the first farm", file=sys.stderr)


if __name__ == "__main__":
    many_watches, many_clients, many_jobs = (take_number("--watches", many_watches), take_number("--clients", many_clients),
                                             take_number("--jobs", many_jobs))
    if is_quiet := "--quiet" in sys.argv:
        sys.argv.remove("--quiet")
    skip_without(DATABASE_SERVER)
    unittest.main(verbosity=2)
