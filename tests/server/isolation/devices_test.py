"""Devices for the jobs of a server (--devices), with a library in the place of NVIDIA's driver. ctest runs it with VARIMESH,
VARIMESHD, VARIMESH_SOURCE_DIR, FAKE_DRIVER (the folder of the library), and CAPTURED as captured_test.py has it."""
import csv
import json
import os
import re
import shutil
import subprocess
import sys
import time
import unittest
import urllib.request
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "client"))
from programs import CASES, ENDLESS, VARIMESHD, Server, WithFolder, run  # noqa: E402

MESH = CASES / "circle_p5.msh"
FAKE = Path(os.environ["FAKE_DRIVER"]) / "libcuda.so.1"
ON_DEVICE = ["--objective", "energy", "--device", "gpu"]
# What code in the process of a job with a device may do beyond the others (docs/security.md): see which files there are,
# reserve addresses, and open its own mesh once more, which is sealed.
MORE = {"stat", "fstatat-with-a-path", "access", "readlink", "memory", "open-again-to-write", "open-of-a-library", "pipe", "pipe2"}


def wait_for(condition, seconds=60):
    deadline = time.monotonic() + seconds
    while not (value := condition()):
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(0.01)
    return value


def workers(server):
    """The processes of jobs that the server has, by number."""
    found = []
    for folder in Path("/proc").iterdir():
        try:
            name, _, rest = (folder / "stat").read_text().partition(") ")
        except (OSError, ValueError):
            continue
        if name.endswith("(varimesh_worker") and int(rest.split()[1]) == server.process.pid:
            found.append(int(folder.name))
    return found


def has_driver(process):
    return "libcuda" in Path(f"/proc/{process}/maps").read_text()


class WithDevices(WithFolder):
    def setUp(self):
        super().setUp()
        shutil.copy(FAKE, self.folder)

    def serve(self, *flags, state="thread", **environment):
        """A server with this driver, whose state is as FAKE_CUDA says (tests/core/device/fake_driver.cpp)."""
        (self.folder / "state").write_text(state + "\n")
        server = Server("--threads", "2", "--log-level", "info", *flags, LD_LIBRARY_PATH=str(self.folder), **environment)
        self.addCleanup(lambda: server.process.poll() is None and server.stop())
        return server

    def optimise(self, server, *flags, mesh=MESH):
        """The result's bytes and the document. self.rows is the history."""
        out, history = self.folder / "out.msh", self.folder / "history.csv"
        done = run("optimise", mesh, "-o", out, "--json", "--history", history, "--server", server.address, *flags)
        self.assertEqual(done.returncode, 0, done.stderr + "".join(server.log))
        self.rows = list(csv.DictReader(history.read_text().splitlines()))
        document = json.loads(done.stdout)
        if "has no kernels" in "".join(document["notes"]):
            self.skipTest("VariMesh was built without clang")
        return out.read_bytes(), document

    def info(self, server):
        return json.loads(run("info", "--json", "--server", server.address).stdout)

    def job(self, server, name):
        jobs = json.loads(run("jobs", "--json", "--server", server.address).stdout)["jobs"]
        return next(job for job in jobs if job["job"] == name)

    def submit(self, server, *options):
        done = run("submit", MESH, *options, "--server", server.address)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout.split()[0]


class Jobs(WithDevices):
    def test_have_their_steps_made_by_a_device(self):
        server = self.serve("--devices", "1")
        made, document = self.optimise(server, *ON_DEVICE)
        self.assertEqual(document["device"], "Fake Card 1")
        self.assertEqual({row["device"] for row in self.rows if row["phase"] == "newton"}, {"gpu"})
        self.assertEqual({row["device"] for row in self.rows if row["phase"] != "newton"} - {"cpu"}, set())
        # The command with the same card makes the same bytes.
        here = self.folder / "here.msh"
        done = run("optimise", MESH, *ON_DEVICE, "-o", here, "--quiet", env={**os.environ, "LD_LIBRARY_PATH": str(self.folder)})
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(made, here.read_bytes())
        usual, document = self.optimise(server, "--objective", "energy")
        self.assertNotIn("device", document)
        self.assertNotEqual(made, usual)

    def test_take_turns_on_one_device(self):
        server = self.serve("--devices", "1", state="busy_for=2000")
        jobs = [self.submit(server, *ON_DEVICE) for _ in range(2)]
        self.assertEqual(run("wait", *jobs, "--server", server.address).returncode, 0, "".join(server.log))
        notes = [self.job(server, job)["metrics"]["notes"] for job in jobs]
        self.assertEqual([any("waited" in note for note in some) for some in notes].count(True), 1, notes)
        for job in jobs:
            self.assertEqual(self.job(server, job)["metrics"]["device"], "Fake Card 1")

    def test_have_a_device_each_or_share_one(self):
        for flags, cards in ((["--devices", "2"], ["Fake Card 1", "Fake Card 2"]),
                             (["--devices", "1", "--jobs-per-device", "2"], ["Fake Card 1"] * 2)):
            with self.subTest(flags):
                server = self.serve(*flags, state="busy_for=2000")
                jobs = [self.submit(server, *ON_DEVICE) for _ in range(2)]
                info = wait_for(lambda: (info := self.info(server))["jobs_on_devices"] == 2 and info)
                self.assertEqual((info["devices"], info["busy_devices"]), (len(set(cards)),) * 2)
                self.assertEqual(info["device"], ", ".join(dict.fromkeys(cards)))
                run("wait", *jobs, "--server", server.address)
                found = [self.job(server, job)["metrics"] for job in jobs]
                self.assertEqual(sorted(metrics["device"] for metrics in found), cards)
                self.assertFalse([note for metrics in found for note in metrics["notes"] if "waited" in note])
                self.assertEqual(self.info(server)["jobs_on_devices"], 0)
                server.stop()

    def test_take_what_there_is_if_they_may(self):
        server = self.serve("--devices", "1")
        _, document = self.optimise(server, "--objective", "energy", "--device", "auto")
        self.assertNotIn("device", document)
        self.assertFalse([note for note in document["notes"] if "processor" in note], "the mesh is too small for one")

    def test_end_on_the_processor_if_the_card_is_lost(self):
        server = self.serve("--devices", "1", state="lost=700")
        _, document = self.optimise(server, *ON_DEVICE)
        self.assertRegex(document["notes"][-1], "processor.* The device Fake Card 1 failed when")

    def test_end_on_the_processor_if_the_driver_ends_their_process(self):
        server = self.serve("--devices", "1", state="crash=700")
        made, document = self.optimise(server, *ON_DEVICE)
        self.assertNotIn("device", document)
        self.assertRegex(document["notes"][-1], "^The run was on the processor. The process that ran this job before")
        self.assertTrue([line for line in server.log if "the process that ran it crashed (signal 6)" in line])
        self.assertEqual(made, self.optimise(server, "--objective", "energy")[0])

    def test_give_a_device_back_that_they_do_not_use(self):
        server = self.serve("--devices", "1", "--http", "127.0.0.1:0", state="busy_for=500")
        address = wait_for(lambda: re.search(r"http://(\S+)/v1/", "".join(server.log)))[1]
        self.submit(server, "--device", "auto", "--objective", "worst", "--threads", "1")  # on a mesh that is too small
        seen = []
        while not any(running for running, _ in seen) or seen[-1][0]:
            with urllib.request.urlopen(f"http://{address}/v1/info", timeout=10) as answer:
                info = json.loads(answer.read())
            now = info.get("runningJobs", 0), info.get("busyDevices", 0)
            if seen[-1:] != [now]:
                seen.append(now)
        self.assertEqual(seen[-3:], [(1, 1), (1, 0), (0, 0)], "while the job runs")

    def test_are_counted(self):
        server = self.serve("--devices", "1", "--metrics", "127.0.0.1:0", state="")
        self.optimise(server, *ON_DEVICE)
        self.optimise(server, "--objective", "energy")
        address = next(line for line in server.log if "/metrics" in line).split("http://")[1].split("/")[0]
        with urllib.request.urlopen(f"http://{address}/metrics", timeout=10) as answer:
            text = answer.read().decode()
        for line in ('varimesh_devices{state="free"} 1', 'varimesh_devices{state="busy"} 0', "varimesh_jobs_on_devices 0",
                     "varimesh_device_jobs_total 1"):
            self.assertIn(line + "\n", text.replace(".000000", ""))


class Choice(WithDevices):
    def test_a_server_that_was_not_asked_never_opens_the_driver(self):
        server = self.serve()
        self.assertEqual((self.info(server)["device"], self.info(server)["devices"]), ("", 0))
        name = self.submit(server, *ENDLESS, "--device", "gpu")
        wait_for(lambda: self.job(server, name).get("iterations", 0) > 0)
        for process in (server.process.pid, *workers(server)):
            self.assertFalse(has_driver(process))
        run("cancel", name, "--server", server.address)
        _, document = self.optimise(server, *ON_DEVICE)
        self.assertEqual(document["notes"][-1], "The run was on the processor. This server gives its jobs no device.")

    def test_only_processes_of_jobs_with_a_device_open_the_driver(self):
        server = self.serve("--devices", "1", state="busy_for=500")
        other = self.submit(server, *ENDLESS, "--threads", "1")
        wait_for(lambda: self.job(server, other).get("iterations", 0) > 0)
        self.assertFalse(any(map(has_driver, workers(server))))
        name = self.submit(server, *ON_DEVICE)
        wait_for(lambda: any(map(has_driver, workers(server))))
        self.assertFalse(has_driver(server.process.pid))
        run("wait", name, "--server", server.address)
        run("cancel", other, "--server", server.address)

    def test_a_server_whose_devices_cannot_be_used_does_not_start(self):
        for flags, state, words in ((["--devices", "1"], "cards=0", "device 0 (--devices). The NVIDIA driver finds no device"),
                                    (["--devices", "1"], "capability=60", "is too old"),
                                    (["--devices", "1", "--isolation", "none"], "", "leave out --isolation none")):
            (self.folder / "state").write_text(state + "\n")
            done = subprocess.run([VARIMESHD, "--listen", "127.0.0.1:0", *flags], capture_output=True, text=True, timeout=60,
                                  env={**os.environ, "LD_LIBRARY_PATH": str(self.folder)})
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn(words, done.stderr)
        done = subprocess.run([VARIMESHD, "--listen", "127.0.0.1:0", "--devices", "2"], capture_output=True, text=True, timeout=60,
                              env={**os.environ, "LD_LIBRARY_PATH": str(self.folder), "CUDA_VISIBLE_DEVICES": "5"})
        self.assertEqual(done.returncode, 2)
        self.assertIn("CUDA_VISIBLE_DEVICES names 1", done.stderr)

    def test_the_devices_are_those_that_the_server_sees(self):
        server = self.serve("--devices", "1", CUDA_VISIBLE_DEVICES="4,2")
        _, document = self.optimise(server, *ON_DEVICE)
        self.assertEqual(document["device"], "Fake Card 5")


class Captured(WithDevices):
    def test_hostile_code_beside_a_device(self):
        library, program = os.environ["CAPTURED"].split(":")
        real = Path(VARIMESHD).parents[1] / "lib/varimesh/varimesh_worker"
        (self.folder / "real").mkdir()
        shutil.copy(real, self.folder / "real")
        shutil.copy(library, self.folder / "captured.so")
        shutil.copy(program, self.folder / "varimesh_worker")
        server = self.serve("--devices", "1", VARIMESH_WORKER=str(self.folder / "varimesh_worker"))
        self.optimise(server, *ON_DEVICE)
        told = [[line.split() for line in file.read_bytes().rstrip(b"\0").decode().splitlines()]
                for file in self.folder.glob("varimesh_worker.report.*")]
        told = [lines for lines in told if lines]
        self.assertGreaterEqual(len(told), 2, "one opened the device, and one ran the job")
        for lines in told:
            self.assertEqual(lines[-1], ["end", "refused"])
            self.assertGreater(len(lines), 45)
            through = {what for what, how in lines if how == "THROUGH"}
            self.assertEqual(through - MORE, set())
            self.assertIn("open-of-a-library", through, "it is the sandbox of a process with a device")
        print(f"{sum(map(len, told))} tries of {len(told)} processes with a device; through: {', '.join(sorted(through))}")


if __name__ == "__main__":
    unittest.main(verbosity=2)
