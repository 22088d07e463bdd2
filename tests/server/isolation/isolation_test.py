"""Jobs in processes of their own: what happens to a job whose process is killed, to the others, and to the server. ctest
runs it with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR. VARIMESH_KILLS is the number of kills (default 6)."""
import json
import os
import random
import re
import signal
import sys
import time
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "client"))
from programs import ENDLESS, LARGER, MESH, Server, WithFolder, run  # noqa: E402

LONG = ["--method", "sweeps", "--active-set", "off", "--tolerance", "1e-15", "--max-iterations", "1000", "--threads", "1"]
KILLS = int(os.environ.get("VARIMESH_KILLS", "6"))


def workers(server, waiting=False):
    """The processes of jobs that the server has, by number; or those that wait for a job, which have one thread."""
    found = []
    for folder in Path("/proc").iterdir():
        try:
            stat = (folder / "stat").read_text()
        except (OSError, ValueError):
            continue
        name, rest = re.match(r"\d+ \((.*)\) (.*)", stat).groups()
        parent, threads = (int(rest.split()[i]) for i in (1, 17))
        if name == "varimesh_worker" and parent == server.process.pid and (threads == 1) == waiting:
            found.append(int(folder.name))
    return sorted(found)


def wait_for(condition, seconds=60):
    deadline = time.monotonic() + seconds
    while not (value := condition()):
        if time.monotonic() > deadline:
            raise AssertionError("it did not happen in time")
        time.sleep(0.01)
    return value


class Isolation(WithFolder):
    def serve(self, *flags, listen="127.0.0.1:0"):
        server = Server("--isolation", "process", "--threads", "2", "--log-level", "info", *flags, listen=listen)
        self.addCleanup(lambda: server.process.poll() is None and server.stop())
        return server

    def submit(self, server, mesh, *options):
        done = run("submit", mesh, *options, "--server", server.address)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout.split()[0]

    def wait(self, server, mesh, *options):
        name = self.submit(server, mesh, *options)
        self.assertEqual(run("wait", name, "--server", server.address).returncode, 0, "".join(server.log))
        return name

    def job(self, server, name):
        jobs = json.loads(run("jobs", "--json", "--server", server.address).stdout)["jobs"]
        return next(job for job in jobs if job["job"] == name)

    def alone(self, mesh, *options):
        out = self.folder / "alone.msh"
        self.assertEqual(run("optimise", mesh, *options, "-o", out, "--quiet").returncode, 0)
        return out.read_bytes()

    def result(self, server, name):
        out = self.folder / "fetched.msh"
        done = run("result", name, "-o", out, "--server", server.address)
        self.assertEqual(done.returncode, 0, done.stderr)
        return out.read_bytes()


class Faults(Isolation):
    def test_kills_at_random_moments_harm_no_job(self):
        server = self.serve("--state", self.folder / "state", "--checkpoint-seconds", "0")
        expected = self.alone(LARGER, *LONG)
        jobs = [self.submit(server, LARGER, *LONG, "--label", f"number={i}") for i in range(4)]
        chance = random.Random(17)
        for _ in range(KILLS):
            time.sleep(chance.uniform(0.2, 0.8))
            running = workers(server)
            if running:
                os.kill(chance.choice(running), chance.choice([signal.SIGKILL, signal.SIGSEGV, signal.SIGBUS]))
        self.assertEqual(run("wait", *jobs, "--server", server.address).returncode, 0, "".join(server.log))
        for name in jobs:
            self.assertEqual(self.result(server, name), expected, name)
        self.assertIsNone(server.process.poll())
        self.assertEqual(workers(server), [])
        lost = [line for line in server.log if re.search("the process that ran it (was killed|crashed)", line)]
        self.assertGreater(len(lost), 0)
        self.assertLessEqual(len(lost), KILLS)

    def test_a_job_that_always_crashes_fails_while_another_goes_on(self):
        server = self.serve()
        other = self.submit(server, LARGER, *ENDLESS, "--threads", "1")
        kept = wait_for(lambda: workers(server))
        name = self.submit(server, LARGER, *ENDLESS, "--threads", "1")

        def failed():
            for process in set(workers(server)) - set(kept):
                os.kill(process, signal.SIGSEGV)
            return self.job(server, name)["state"] not in ("pending", "running")

        wait_for(failed)
        job = self.job(server, name)
        self.assertEqual(job["state"], "failed")
        self.assertIn("crashed (signal 11), 3 times without progress", json.dumps(job))
        self.assertEqual(self.job(server, other)["state"], "running")
        self.assertEqual(workers(server), kept)
        self.assertEqual(run("cancel", other, "--server", server.address).returncode, 0)
        run("wait", other, "--server", server.address)
        self.assertEqual(self.job(server, other)["state"], "cancelled")
        self.result(server, other)

    def test_a_server_that_is_killed_takes_its_processes_along(self):
        server = self.serve()
        self.submit(server, LARGER, *ENDLESS)
        process = wait_for(lambda: workers(server))[0]
        server.process.kill()
        wait_for(lambda: not Path(f"/proc/{process}").exists())
        server.stop()


    def test_a_process_that_ends_while_it_waits_harms_no_job(self):
        server = self.serve()
        self.result(server, self.wait(server, MESH))
        for process in wait_for(lambda: workers(server, waiting=True)):
            os.kill(process, signal.SIGKILL)
        self.result(server, self.wait(server, MESH))
        self.assertFalse([line for line in server.log if "the process that ran it" in line])


class Work(Isolation):
    def test_gives_the_same_bytes_as_without(self):
        server = self.serve()
        for mesh in (MESH, LARGER):
            self.assertEqual(self.result(server, self.wait(server, mesh)), self.alone(mesh))

    def test_a_stop_keeps_the_work_of_a_job(self):
        expected = self.alone(LARGER, *LONG)
        server = self.serve("--state", self.folder / "state")
        name = self.submit(server, LARGER, *LONG)
        wait_for(lambda: self.job(server, name).get("iterations", 0) > 20)
        # As systemd does it if it stops all processes of a service.
        for process in workers(server):
            os.kill(process, signal.SIGTERM)
        self.assertEqual(server.stop()[0], 0)
        server = self.serve("--state", self.folder / "state")
        run("wait", name, "--server", server.address)
        job = self.job(server, name)
        self.assertEqual(job["state"], "succeeded")
        self.assertTrue(any(f"{name} started, attempt 2" in line for line in server.log), "".join(server.log))
        self.assertEqual(self.result(server, name), expected)

    def test_a_time_limit_and_a_bad_mesh(self):
        server = self.serve()
        name = self.submit(server, LARGER, *ENDLESS, "--time-limit", "0.5")
        run("wait", name, "--server", server.address)
        self.assertEqual(self.job(server, name)["state"], "succeeded")
        self.result(server, name)
        bad = self.folder / "bad.msh"
        bad.write_text(MESH.read_text()[:500])
        done = run("optimise", bad, "-o", self.folder / "out.msh", "--server", server.address)
        self.assertEqual(done.returncode, 3, done.stderr)

    def test_a_file_that_asks_for_gigabytes_is_refused(self):
        """20,000 empty blocks of an entity with 20,000 groups: 200 KB that would take 3 GB."""
        count = 20_000
        bomb = self.folder / "bomb.msh"
        bomb.write_text(f"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 1 0\n1 0 0 0 1 1 1 {count} " +
                        " ".join(str(i + 1) for i in range(count)) + " 0\n$EndEntities\n$Nodes\n1 3 1 3\n2 1 0 3\n1\n2\n3\n"
                        "0 0 0\n1 0 0\n0 1 0\n$EndNodes\n" + f"$Elements\n{count + 1} 1 1 1\n2 1 2 1\n1 1 2 3\n" +
                        "2 1 2 0\n" * count + "$EndElements\n")
        server = self.serve()
        self.result(server, self.wait(server, MESH))

        def peak():
            return int(re.search(r"VmHWM:\s+(\d+)", Path(f"/proc/{server.process.pid}/status").read_text())[1]) * 1024

        before = peak()
        name = self.submit(server, bomb)
        run("wait", name, "--server", server.address)
        job = self.job(server, name)
        self.assertEqual(job["state"], "failed", job)
        self.assertIn("memory", json.dumps(job))
        self.assertLess(peak() - before, 64 << 20)
        self.result(server, self.wait(server, MESH))

    def test_hdf5_files(self):
        if not Path(os.environ.get("VARIMESH_HDF5", "") or Path(os.environ["VARIMESHD"]).parents[1] /
                    "lib/varimesh/varimesh_hdf5").is_file():
            self.skipTest("varimesh_hdf5 is not installed")
        server = self.serve()
        here, there = self.folder / "here.cgns", self.folder / "there.cgns"
        mesh = MESH.parent / "cylinder_p2.msh"
        self.assertEqual(run("optimise", mesh, "-o", here, "--quiet").returncode, 0)
        done = run("optimise", mesh, "-o", there, "--quiet", "--server", server.address)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(here.stat().st_size, there.stat().st_size)
        # Reading such a file takes another process.
        again = self.folder / "again.msh"
        done = run("optimise", there, "-o", again, "--max-iterations", "0", "--quiet", "--server", server.address)
        self.assertEqual(done.returncode, 0, done.stderr)
        here_again = self.folder / "here-again.msh"
        self.assertEqual(run("optimise", there, "-o", here_again, "--max-iterations", "0", "--quiet").returncode, 0)
        self.assertEqual(again.read_bytes(), here_again.read_bytes())


if __name__ == "__main__":
    unittest.main(verbosity=2)
