"""A farm in which one of two workers has a device: a library in the place of NVIDIA's driver. ctest runs it with VARIMESH, VARIMESHD,
VARIMESH_SOURCE_DIR and FAKE_DRIVER (the folder of the library) in the environment. It starts a PostgreSQL server of its own."""
import json
import os
import shutil
import signal
import sys
import time
import unittest
from pathlib import Path

from farm import DATABASE_SERVER, WithFarm, skip_without
from programs import LARGER, run

ON_DEVICE = ["--objective", "energy", "--device", "gpu"]
NO_DEVICE = "The job waits for a device, and no server that runs now has one for jobs."


class FarmDevices(WithFarm):
    def with_device(self):
        """A worker with one device."""
        self.driver = self.folder / "driver"
        self.driver.mkdir(exist_ok=True)
        shutil.copy(Path(os.environ["FAKE_DRIVER"]) / "libcuda.so.1", self.driver)
        (self.driver / "state").write_text("thread\n")
        return self.worker("--devices", "1", threads=2, environment={"LD_LIBRARY_PATH": str(self.driver)})

    def job(self, server, name):
        return next(job for job in json.loads(self.ask(server, "jobs", "--json"))["jobs"] if job["job"] == name)

    def end_of(self, server, name):
        self.assertEqual(run("wait", name, "--server", server.address).returncode, 0)
        metrics = self.job(server, name)["metrics"]
        if "has no kernels" in "".join(metrics["notes"]):
            self.skipTest("VariMesh was built without clang")
        return metrics

    def wait_for_devices(self, server, number, seconds):
        deadline = time.monotonic() + seconds
        while (info := json.loads(self.ask(server, "info", "--json")))["devices"] != number:
            self.assertLess(time.monotonic(), deadline, info)
            time.sleep(0.05)
        return info

    def test_jobs_that_need_a_device_go_where_one_is(self):
        front, plain = self.front_end(), self.worker(threads=2)
        needy = self.ask(front, "submit", LARGER, *ON_DEVICE).split()[0]
        self.assertIn(NO_DEVICE, self.ask(front, "logs", needy))
        easy = [self.ask(front, "submit", LARGER, "--objective", "energy", "--device", device).split()[0] for device in ("auto", "cpu")]
        for name in easy:
            self.assertNotIn("device", self.end_of(front, name), "the other worker takes them")
        self.assertEqual(self.job(front, needy)["state"], "pending")
        self.wait_for_devices(front, 0, 1)

        card = self.with_device()
        metrics = self.end_of(front, needy)
        self.assertEqual(metrics["device"], "Fake Card 1")
        self.assertEqual(self.wait_for_devices(front, 1, 10)["device"], "Fake Card 1", "the front end knows it")
        again = self.ask(front, "submit", LARGER, *ON_DEVICE).split()[0]
        self.assertEqual(self.end_of(front, again)["device"], "Fake Card 1")
        self.assertNotIn(NO_DEVICE, self.ask(front, "logs", again))
        outs = []
        for name in (needy, again):
            outs.append(self.folder / f"{name.removeprefix('jobs/')}.msh")
            self.ask(front, "result", name, "--output", outs[-1])
        self.assertEqual(outs[0].read_bytes(), outs[1].read_bytes(), "the same bytes")

        self.assertEqual(card.end(), 0, "".join(card.log))
        self.wait_for_devices(front, 0, 1)
        last = self.ask(front, "submit", LARGER, *ON_DEVICE).split()[0]
        self.assertIn(NO_DEVICE, self.ask(front, "logs", last))
        self.assertEqual(plain.process.poll(), None)
        self.assertEqual(self.job(front, last)["state"], "pending")
        self.ask(front, "cancel", last)
        self.assertEqual(self.job(front, last)["state"], "cancelled")

    def test_a_worker_that_is_killed_lends_no_devices_after_its_lease(self):
        front, card = self.front_end(), self.with_device()
        (self.driver / "state").write_text("busy_for=8000\n")  # as tests/core/device/fake_driver.cpp has it
        self.wait_for_devices(front, 1, 10)
        job = self.ask(front, "submit", LARGER, *ON_DEVICE).split()[0]
        self.wait_for(front, job, "running")
        card.end(signal.SIGKILL)
        self.wait_for_devices(front, 0, self.lease_seconds + 3)
        deadline = time.monotonic() + self.lease_seconds + 10
        while NO_DEVICE not in (told := self.ask(front, "logs", job)):
            self.assertLess(time.monotonic(), deadline, told)
            time.sleep(0.1)
        self.with_device()
        self.assertEqual(self.end_of(front, job)["device"], "Fake Card 1", "it goes on where another one is")


if __name__ == "__main__":
    skip_without(DATABASE_SERVER)
    unittest.main(verbosity=2)
