"""varimesh optimise --device: with a library in the place of NVIDIA's driver, and without one."""
import csv
import json
import os
import unittest

from programs import CASES, VARIMESH, WithServer, run

MESH = CASES / "circle_p5.msh"


class Device(WithServer):
    def optimise(self, *flags, driver="", state="", objective="energy", **options):
        """The result's bytes and the document. self.rows is the history of the run."""
        out, history = self.folder / "out.msh", self.folder / "history.csv"
        done = run("optimise", MESH, "-o", out, "--objective", objective, "--json", "--history", history, *flags,
                   env={**os.environ, "LD_LIBRARY_PATH": driver, "FAKE_CUDA": state}, **options)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.rows = list(csv.DictReader(history.read_text().splitlines()))
        return out.read_bytes(), json.loads(done.stdout)

    def test_changes_no_byte_without_a_card(self):
        expected, usual = self.optimise()
        self.assertNotIn("device", usual)
        for flags, notes in ((("--device", "cpu"), 0), (("--device", "auto"), 0), (("--device", "gpu"), 1)):
            made, document = self.optimise(*flags, driver=os.environ["FAKE_DRIVER"], state="cards=0")
            self.assertEqual(made, expected, flags)
            self.assertNotIn("device", document)
            self.assertEqual({row["device"] for row in self.rows}, {"cpu"})
            self.assertEqual(len(document["notes"]), len(usual["notes"]) + notes)
        self.assertRegex(document["notes"][-1], "^The run was on the processor. The NVIDIA driver finds no device")

    def test_makes_the_steps_on_the_card(self):
        expected, usual = self.optimise()
        made, document = self.optimise("--device", "gpu", driver=os.environ["FAKE_DRIVER"])
        if "has no kernels" in "".join(document["notes"]):
            self.skipTest("VariMesh was built without clang")
        self.assertEqual(document["device"], "Fake Card 1")
        self.assertIn("newton", {row["phase"] for row in self.rows})
        for row in self.rows:
            self.assertEqual(row["device"], "gpu" if row["phase"] == "newton" else "cpu", row)
        self.assertNotEqual(made, expected)
        self.assertAlmostEqual(document["after"]["min_scaled_jacobian"], usual["after"]["min_scaled_jacobian"], 3)
        small, document = self.optimise("--device", "auto", driver=os.environ["FAKE_DRIVER"])
        self.assertEqual(small, expected, "the mesh is too small for auto")
        lost, document = self.optimise("--device", "gpu", driver=os.environ["FAKE_DRIVER"], state="lost=700")
        self.assertRegex(document["notes"][-1], "processor.* The device Fake Card 1 failed when")

    def test_makes_the_steps_of_the_default_objective(self):
        expected, usual = self.optimise(objective="accuracy")
        made, document = self.optimise("--device", "gpu", driver=os.environ["FAKE_DRIVER"], objective="accuracy")
        if "has no kernels" in "".join(document["notes"]):
            self.skipTest("VariMesh was built without clang")
        self.assertEqual(document["device"], "Fake Card 1")
        self.assertEqual(document["notes"], usual["notes"])
        self.assertIn("accuracy", {row["phase"] for row in self.rows})
        for row in self.rows:
            self.assertEqual(row["device"], "gpu" if row["phase"] in ("newton", "accuracy") else "cpu", row)
        self.assertNotEqual(made, expected)
        self.assertAlmostEqual(document["after"]["accuracy"]["loss"] / usual["after"]["accuracy"]["loss"], 1, 2)

    def test_is_named_by_info(self):
        def device(*flags, state=""):
            done = run("info", "--json", *flags,
                       env={**os.environ, "LD_LIBRARY_PATH": os.environ["FAKE_DRIVER"], "FAKE_CUDA": state})
            return json.loads(done.stdout)["device"]

        self.assertEqual(device("--server", ""), "Fake Card 1")
        self.assertEqual(device("--server", "", state="cards=0"), "")
        self.assertEqual(device("--server", "", state="capability=61"), "", "no run can use it")
        self.assertEqual(device("--server", "", state="version=9020"), "", "no run can use it")
        self.assertEqual(device("--server", self.server.address), "")

    def test_is_not_for_jobs_of_a_server(self):
        expected, _ = self.optimise()
        made, document = self.optimise("--device", "gpu", "--server", self.server.address, driver=os.environ["FAKE_DRIVER"])
        self.assertEqual(made, expected)
        self.assertEqual(document["notes"][-1], "The run was on the processor. This server gives its jobs no device.")


if __name__ == "__main__":
    unittest.main(verbosity=2)
