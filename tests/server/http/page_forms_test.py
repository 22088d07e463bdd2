"""The page of --http in a headless Chromium: the form of a run, with layers and CAD models, and the texts for a terminal and Python.
ctest runs it with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in the environment."""
import hashlib
import json
import os
import unittest

from with_page import WithModels, WithPage

from programs import CASES, FOLDED, MESH, run


class Form(WithPage):
    def test_names_of_files(self):
        for name, words in (("-x.msh", "./-x.msh -o ./-x-better.msh"), ("ä" * 100 + ".msh", "ä" * 62 + ".msh")):
            mesh = self.folder / name
            mesh.write_text(FOLDED)
            self.open()
            self.look_at(mesh)
            self.assertIn(words, self.text("#run pre"))
        self.open()
        self.page.drop_file(self.folder / "-x.msh", self.folder / ("ä" * 100 + ".msh"))
        self.assertIn("2 files", self.text("#told"))
        self.check_clean()

    def test_a_job_without_a_name_of_a_file(self):
        spec = self.ask("GET", f"/v1/jobs/{self.submit(MESH)}")[1]["job"]["spec"]
        code, answer = self.ask("POST", "/v1/jobs", {**spec, "labels": {}})
        self.assertEqual(code, 200, answer)
        self.open(f"/#/{answer['job']['name']}")
        self.page.wait("!!document.querySelector('#run pre')")
        self.assertIn("varimesh optimise mesh.msh -o mesh-better.msh", self.text("#run pre"))

    def test_another_run_keeps_what_the_form_does_not_show(self):
        job = self.submit(CASES / "sphere_p3.msh", "--slide-on", "boundary", "--slide", "surfaces", "--priority", "7", "--max-iterations", "1")
        self.open(f"/#/jobs/{job}")
        self.page.wait("!!document.querySelector('#run form')", 100)
        self.assertIn("keeps the priority, the sliding of boundary nodes of this job", self.text("#run"))
        self.page.click("#run button", "Run with these options")
        self.page.wait(f"!location.hash.includes('{job}')")
        spec = self.ask("GET", "/v1/" + self.page.value("location.hash.slice(2)"))[1]["job"]["spec"]
        old = self.ask("GET", f"/v1/jobs/{job}")[1]["job"]["spec"]
        self.assertEqual((spec["priority"], spec["geometry"]), (7, old["geometry"]))
        self.assertEqual({**spec, "outputs": []}, {**old, "outputs": []})

    def test_spacing_without_layers_is_an_option(self):
        self.open()
        self.look_at(MESH)
        self.set_field("option-layerSpacing", "LAYER_SPACING_EVEN")
        self.assertIn("-o nine_triangles-better.msh --layer-spacing even", self.text("#run pre"))
        self.assertIn('"nine_triangles-better.msh", layer_spacing="even")', self.text("#run .columns"))

    def test_offers_no_device_where_jobs_have_none(self):
        job = self.submit(MESH, "--device", "gpu", "--objective", "energy", "--max-iterations", "1")
        self.open(f"/#/jobs/{job}")
        self.page.wait("!!document.querySelector('#run form')", 100)
        self.assertTrue(self.page.value("!!document.getElementById('option-threads')"))
        self.assertFalse(self.page.value("!!document.getElementById('option-device')"))
        self.page.click("#run button", "Run with these options")
        self.page.wait(f"!location.hash.includes('{job}')")
        options = self.ask("GET", "/v1/" + self.page.value("location.hash.slice(2)"))[1]["job"]["spec"]["options"]
        self.assertEqual((options.get("objective"), options.get("device")), ("OBJECTIVE_ENERGY", None))

    def test_orders_are_kept(self):
        self.open()
        self.look_at(MESH)
        self.set_field("option-keepOrders", "on")
        self.assertIn("-o nine_triangles-better.msh --keep-orders", self.text("#run pre"))
        self.assertIn('"nine_triangles-better.msh", keep_orders=True)', self.text("#run .columns"))
        self.page.click("#run button", "Optimise")
        self.page.wait("document.querySelector('#state')?.textContent.startsWith('optimise') && document.querySelector('#option-keepOrders')?.value === 'on'", 100)
        self.assertIs(self.ask("GET", "/v1/" + self.page.value("location.hash.slice(2)"))[1]["job"]["spec"]["keepOrders"], True)

    def test_layers_are_what_the_command_makes(self):
        self.open()
        self.look_at(MESH)
        self.assertIn("The boundary of this mesh has boundary.", self.text("#run"))
        for id, value in (("layer-walls", "boundary"), ("layer-grow", "0.05"), ("layer-layers", "3"), ("layer-first", "0.005"), ("option-layerSpacing", "LAYER_SPACING_EVEN")):
            self.set_field(id, value)
        words = "--layer-spacing even --wall boundary --layers 3 --first 0.005 --grow 0.05"
        self.assertIn(f"varimesh optimise nine_triangles.msh -o nine_triangles-better.msh {words}", self.text("#run pre"))
        self.assertNotIn("layer_spacing", self.text("#run .columns"), "Python's layers have the spacing themselves")
        self.assertIn('layers=varimesh.Layers(["boundary"], layers=3, first=0.005, grow=0.05, spacing="even")', self.text("#run .columns"))
        self.optimise()
        expected = self.folder / "expected.msh"
        done = run("optimise", MESH, "-o", expected, *words.split())
        self.assertIn(done.returncode, (0, 4), done.stderr)
        self.page.click("#downloads button", "Download")
        self.assertEqual(self.downloaded("nine_triangles-better.msh"), expected.read_bytes())
        self.assertEqual(self.page.value("document.getElementById('layer-walls').value"), "boundary", "for the next run")
        self.assertEqual(self.page.value("document.getElementById('option-layerSpacing').value"), "LAYER_SPACING_EVEN")
        self.check_clean()


class Devices(WithPage):
    """A server that lends jobs a device; a library is in the place of NVIDIA's driver (FAKE_DRIVER)."""

    def flags(self):
        return "--devices", "1"

    def setUp(self):
        before = os.environ.get("LD_LIBRARY_PATH")
        os.environ["LD_LIBRARY_PATH"] = os.environ["FAKE_DRIVER"]
        self.addCleanup(lambda: os.environ.pop("LD_LIBRARY_PATH") if before is None else os.environ.update(LD_LIBRARY_PATH=before))
        super().setUp()

    def test_the_form_offers_one(self):
        self.open()
        self.look_at(MESH)
        self.set_field("option-device", "DEVICE_GPU")
        self.assertIn("--device gpu", self.text("#run pre"))
        self.set_field("option-objective", "OBJECTIVE_ENERGY")
        self.optimise()
        job = self.ask("GET", "/v1/" + self.page.value("location.hash.slice(2)"))[1]["job"]
        self.assertEqual(job["spec"]["options"]["device"], "DEVICE_GPU")
        if "has no kernels" not in str(job["metrics"].get("notes")):
            self.assertEqual(job["metrics"]["device"], "Fake Card 1")
            self.assertRegex(self.text("dl.tiles"), "Iterations.* in .*, on Fake Card 1")


class Models(WithModels):
    def test_a_model_dropped_beside_a_mesh_is_what_its_boundary_slides_on(self):
        self.open()
        self.look_at(CASES / "geometry" / "bracket_p3.msh")
        self.assertNotIn("--geometry", self.text("#run pre"))
        self.page.drop_file(CASES / "geometry" / "bracket.step")
        self.page.wait("document.querySelector('#run pre').textContent.includes('--geometry bracket.step')")
        self.optimise()
        self.assertIn("slid", self.text("#verdict"))
        job = self.ask("GET", "/v1/jobs?states=JOB_STATE_SUCCEEDED", headers={})[1]["jobs"][0]
        model = (CASES / "geometry" / "bracket.step").read_bytes()
        self.assertEqual(job["spec"]["geometry"]["digest"], hashlib.sha256(model).hexdigest())
        self.check_clean()

    def test_the_texts_say_how_nodes_slide(self):
        model = ("--geometry", CASES / "geometry" / "bracket.step", "--slide", "surfaces", "--snap", "--smooth-angle", "5")
        job = self.submit(CASES / "geometry" / "bracket_p3.msh", *model, "--max-iterations", "1")
        self.open(f"/#/jobs/{job}")
        self.page.wait("document.querySelectorAll('#run pre').length === 2", 100)
        self.assertIn("--geometry model.step --slide surfaces --snap --smooth-angle 5", self.text("#run pre"))
        self.assertIn('varimesh.Geometry("model.step", slide="surfaces", snap=True, smooth_angle=5)', self.text("#run .columns"))

    def test_a_straight_mesh_is_curved_in_a_later_run(self):
        straight = self.folder / "straight.msh"
        self.assertEqual(run("optimise", CASES / "geometry" / "bracket_p3.msh", "-o", straight, "--order", 1, "--max-iterations", 0).returncode, 0)
        self.open()
        self.look_at(straight)
        self.optimise()
        self.assertTrue(self.page.value("!!document.querySelector('#model-order')"))

    def test_a_straight_mesh_is_curved_with_a_model(self):
        straight = self.folder / "straight.msh"
        self.assertEqual(run("optimise", CASES / "geometry" / "bracket_p3.msh", "-o", straight, "--order", 1, "--max-iterations", 0).returncode, 0)
        self.open()
        self.look_at(straight)
        self.page.choose_file("#model", CASES / "geometry" / "bracket.step")
        self.page.value("(() => { const one = document.querySelector('#model-order'); one.value = 2; one.dispatchEvent(new Event('input', {bubbles: true})); })()")
        self.assertIn("varimesh curve straight.msh -o straight-better.msh --geometry bracket.step --order 2", self.text("#run pre"))
        self.optimise()
        self.assertIn("of order 2", self.text("#job .tiles"))
        self.check_clean()


if __name__ == "__main__":
    unittest.main()
