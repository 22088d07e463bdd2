#!/usr/bin/env python3
"""The model of a farm, against what can be counted by hand. ctest runs it."""
import importlib.machinery
import importlib.util
import json
import subprocess
import sys
import unittest
from pathlib import Path

MODEL = Path(__file__).resolve().parent / "model"
loader = importlib.machinery.SourceFileLoader("model", str(MODEL))
model = importlib.util.module_from_spec(importlib.util.spec_from_loader("model", loader))
sys.dont_write_bytecode = True
loader.exec_module(model)
RATES = json.loads((MODEL.parent / "rates.json").read_text())


def simple(**changes):
    """Jobs of 100 s that only ask to be submitted, claimed and finished, at 10 ms each."""
    settings = {**RATES, "job_seconds": 100, "progress_per_second": 0, "lease_seconds": 1e12, "checkpoint_seconds": 1e12,
                "watchers": 0, "jobs_per_worker": 1, "database_processors": 1, "mesh_bytes": 1,
                "milliseconds": {**{call: 0 for call in RATES["milliseconds"]}, "submit": 10, "claim": 10, "finish": 10}}
    return {**settings, **changes}


class Model(unittest.TestCase):
    def test_adds_up_what_jobs_ask(self):
        database, store, rate = model.loads(simple(), 1000)
        self.assertAlmostEqual(database, 10 * 0.03)
        self.assertAlmostEqual(rate, 10)
        self.assertLess(store, 1e-3)
        most, what = model.limit(simple())
        self.assertAlmostEqual(most, 3333, delta=1)
        self.assertEqual(what, "the database")
        self.assertEqual(model.limit(simple(mesh_bytes=1e9))[1], "the store")

    def test_plays_no_faster_than_the_workers_are(self):
        for workers, jobs in ((10, 5000), (100, 50000)):
            last, share = model.play(simple(), workers, jobs)
            self.assertGreater(share, 0.8)
            self.assertLessEqual(share, 1)
            self.assertGreater(last, 0.8 * jobs * 100 / workers)

    def test_plays_as_slowly_as_the_database_is(self):
        # A claim takes a second: a thousand of them take a thousand seconds, however many workers there are.
        settings = simple()
        settings["milliseconds"]["claim"] = 1000
        self.assertGreater(model.play(settings, 10_000, 1000)[0], 1000)

    def test_prints_a_table(self):
        done = subprocess.run([MODEL, "--jobs", "2000", "--workers", "100"], capture_output=True, text=True, check=True)
        self.assertRegex(done.stdout, r"(?m)^    1000 +\d+ +\d+\.\d% +\d+\.\d%$")
        self.assertRegex(done.stdout, r"Up to \d+ workers nothing waits")
        self.assertRegex(done.stdout, r"2000 jobs on 100 workers take \d+\.\d\d h")


if __name__ == "__main__":
    unittest.main(verbosity=2)
