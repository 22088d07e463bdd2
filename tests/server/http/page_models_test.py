"""A CAD model that is dropped on the page of --http, without a mesh or together with one, on a server that reads CAD models.
ctest runs it with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in the environment."""
import os
import re
import time
import unittest

from callers_test import WithCallers
from programs import CASES
from with_page import PLUGIN, WithModels

STEP = CASES / "geometry" / "bracket.step"
SIZES = [3, 1.5, 2]  # of the bracket, whose plane sides are its outermost (tests/cases/coarse_cad.py)

# Counts the pixels of the picture by their hue, in 36 steps, as far as they have one: edges and the ground are grey.
HUES = """new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => {
  const canvas = document.querySelector('#pictures .view canvas');
  const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext('2d', {willReadFrequently: true});
  copy.drawImage(canvas, 0, 0);
  const {data} = copy.getImageData(0, 0, canvas.width, canvas.height);
  const counts = {};
  for (let i = 0; i < data.length; i += 4) {
    const [r, g, b] = [data[i], data[i + 1], data[i + 2]];
    const most = Math.max(r, g, b);
    const span = most - Math.min(r, g, b);
    if (data[i + 3] === 0 || span < 0.12 * most) continue;
    const hue = 60 * (most === r ? ((g - b) / span + 6) % 6 : most === g ? (b - r) / span + 2 : (r - g) / span + 4);
    const bin = Math.floor(hue / 10);
    counts[bin] = (counts[bin] ?? 0) + 1;
  }
  done(counts);
})))"""


class Pictures(WithModels):
    def look(self, model):
        self.drop(model)
        self.page.wait("!!document.querySelector('#advice pre') && !!document.querySelector('#pictures canvas')")

    def hues(self):
        """The hues of at least two per cent of the coloured pixels, and the number of these pixels."""
        counts = self.page.value(HUES)
        pixels = sum(counts.values())
        return {int(hue) for hue, count in counts.items() if count > 0.02 * pixels}, pixels

    def show_only(self, face):
        self.page.value(f"[...document.querySelectorAll('#pictures tbody tr')].find((row) => row.cells[0].textContent === '{face}').querySelector('button').click()")
        return self.hues()

    def test_a_model_without_a_mesh_is_shown_with_all_its_faces(self):
        self.look(STEP)
        self.assertIn("The model has 1 body, 13 faces and ", self.text("#pictures p"))
        self.assertIn("Lengths are in millimetres.", self.text("#pictures p"))
        self.assertEqual(self.page.value("document.querySelectorAll('#pictures tbody tr').length"), 13)
        self.assertEqual([float(text) for text in re.findall(r"[\d.]+", self.text("#pictures .tile:last-child dd"))], SIZES)
        whole, pixels = self.hues()
        self.assertGreaterEqual(len(whole), 4, "faces in different colours")
        self.assertGreater(pixels, 20000)
        seen = set()
        for face in range(1, 14):  # a face that is shown without the others has its own colour
            shown, own = self.show_only(face)
            self.assertGreater(own, 100, face)
            self.assertLessEqual(len(shown), 3, f"face {face} has the hues {shown}")
            seen |= shown
        self.assertLessEqual(whole, {hue + step for hue in seen for step in (-1, 0, 1)}, "the colours of the picture are those of its faces")
        self.page.click("#pictures button", "All faces")
        self.assertEqual(self.hues()[0], whole)
        self.check_clean()

    def test_its_commands_name_the_file_and_a_size_that_fits(self):
        self.look(STEP)
        self.assertRegex(self.text("#advice pre"), r"^varimesh mesh bracket\.step --size [\d.]+ --order 3 -o bracket\.msh$")
        size = float(re.search(r"--size ([\d.]+)", self.text("#advice pre"))[1])
        sizes = [float(text) for text in re.findall(r"[\d.]+", self.text("#pictures .tile:last-child dd"))]
        self.assertTrue(max(sizes) / 40 < size < max(sizes) / 5, (size, sizes))
        self.assertEqual(self.page.value("document.querySelectorAll('#run').length"), 0, "nothing to optimise")

    def test_a_damaged_model_is_refused_with_the_servers_sentence(self):
        damaged = self.folder / "cut.step"
        damaged.write_bytes(STEP.read_bytes()[:5000])
        self.drop(damaged)
        self.wait_for_state("failed")
        self.assertIn("The model cannot be used: the STEP file is cut off", self.text("#state"))
        self.page.wait("!!document.querySelector('#advice pre')")
        self.assertEqual(self.page.value("document.querySelectorAll('canvas').length"), 0)

    def test_a_mesh_and_its_model_can_be_dropped_together(self):
        self.drop(CASES / "geometry" / "bracket_p3.msh", STEP)
        self.page.wait("document.querySelector('#run pre')?.textContent.includes('--geometry bracket.step')")
        self.assertIn("bracket_p3.msh", self.text("#job h2"))
        self.drop(CASES / "geometry" / "bracket_p3.msh", STEP, CASES / "sphere_p3.msh")
        self.page.wait("document.querySelector('#told').textContent.includes('3 files')")

    def test_a_model_waits_only_for_the_form_of_its_own_mesh(self):
        mesh = CASES / "geometry" / "bracket_p3.msh"
        self.drop(mesh)
        self.page.wait("!!document.querySelector('#run form')")
        shown, other = self.page.value("location.hash"), "jobs/" + "0" * 32
        self.page.value("""(() => { const old = window.fetch;
            window.fetch = (to, how) => window.sent && how?.body instanceof FormData ? Promise.resolve(window.sent()) : old(to, how); })()""")
        # The server refuses the mesh; then the mesh is sent, but somebody looks at another job before its form is there.
        for answer, told in (("{message: 'The server is full.'}, {status: 429}", "The server is full."), (f"{{job: {{name: '{other}'}}}}", "jobs/0000")):
            self.page.value("location.hash = '#/'")
            self.page.wait("!!document.querySelector('#start')")
            self.page.value(f"window.sent = () => Response.json({answer}); 1")
            self.page.drop_file(mesh, STEP)
            self.page.wait(f"document.querySelector('#told').textContent.includes('{told}')")
            self.page.value(f"location.hash = '{shown}'")
            self.page.wait("!!document.querySelector('#run pre')")
            self.assertNotIn("bracket.step", self.text("#run"), told)
        self.page.value("window.sent = null")
        self.page.drop_file(mesh, STEP)
        self.page.wait("document.querySelector('#run pre')?.textContent.includes('--geometry bracket.step')")

    @unittest.skipUnless(os.environ.get("VARIMESH_AXE"), "VARIMESH_AXE does not name axe-core's axe.min.js")
    def test_axe_finds_no_fault(self):
        self.look(STEP)
        for width, dark in ((1280, False), (390, True)):
            self.page.look(width, 900, dark)
            self.assertEqual(self.faults_that_axe_finds(), [])

    def test_the_list_and_the_keyboard_know_it(self):
        self.look(STEP)
        self.page.value("document.querySelector('#pictures .view').focus()")
        before = self.page.picture("#pictures .view")
        self.page.press("ArrowLeft", 37)
        self.page.wait("document.activeElement.classList.contains('active')")
        deadline = time.monotonic() + 20
        while self.page.picture("#pictures .view") == before:
            self.assertLess(time.monotonic(), deadline, "it has not turned")
        self.page.look(390, 844, dark=True)
        self.assertLessEqual(self.page.value("document.documentElement.scrollWidth"), 390)
        self.page.value("location.hash = '#/jobs'")
        self.page.wait("!!document.querySelector('#jobs tbody tr')")
        self.assertIn("CAD model", self.text("#jobs tbody tr"))
        self.assertIn("13 faces", self.text("#jobs tbody tr"))
        self.check_clean()

    def test_a_job_for_a_mesh_is_none_for_a_model_whatever_came_of_it(self):
        form = (b'--x\r\nContent-Disposition: form-data; name="spec"\r\n\r\n{"quality": {}, "outputs": ["MESH_FORMAT_PARTS"], "labels": {"file": "cut.msh"}}\r\n'
                b'--x\r\nContent-Disposition: form-data; name="mesh"\r\n\r\n$MeshFormat\r\n--x--\r\n')
        code, told = self.ask("POST", "/v1/jobs", form, {"Content-Type": "multipart/form-data; boundary=x"})[:2]
        self.assertEqual(code, 200, told)
        self.open("/#/jobs")
        self.page.wait("document.querySelector('#jobs tbody tr')?.textContent.includes('failed')")
        self.assertIn("quality", self.text("#jobs tbody tr"))
        self.assertNotIn("CAD model", self.text("#jobs tbody tr"))
        self.page.value(f"location.hash = '#/{told['job']['name']}'")
        self.wait_for_state("failed")
        self.assertTrue(self.text("#state").startswith("quality · failed"), self.text("#state"))


class PictureOwners(WithCallers):
    """Who may see the picture of a model: the requests that the page makes, without a browser."""

    def setUp(self):
        if not PLUGIN.exists():
            self.skipTest("there is no plugin that reads CAD files")
        os.environ["VARIMESH_OPENCASCADE"] = str(PLUGIN)
        self.addCleanup(os.environ.pop, "VARIMESH_OPENCASCADE")
        super().setUp()

    def post(self, name):
        form = (b'--x\r\nContent-Disposition: form-data; name="spec"\r\n\r\n{"quality": {}, "outputs": ["MESH_FORMAT_PARTS"]}\r\n'
                b'--x\r\nContent-Disposition: form-data; name="mesh"\r\n\r\n' + STEP.read_bytes() + b"\r\n--x--\r\n")
        return self.ask("POST", "/v1/jobs", form, {**(self.of(name) if name else {}), "Content-Type": "multipart/form-data; boundary=x"})

    def test_a_picture_belongs_to_who_sent_the_model(self):
        self.assertEqual(self.post(None)[0], 401)
        self.assertEqual(self.post("reader")[0], 403)
        code, told = self.post("ann")
        self.assertEqual(code, 200, told)
        job = told["job"]["name"].removeprefix("jobs/")
        done = self.wait(job, "JOB_STATE_SUCCEEDED", "JOB_STATE_FAILED", headers=self.of("ann"))
        self.assertEqual(done["state"], "JOB_STATE_SUCCEEDED", done)
        self.assertIn("13 faces", done["metrics"]["notes"][0])
        for path in (f"/v1/jobs/{job}", f"/v1/jobs/{job}/result"):
            self.assertEqual(self.ask("GET", path, headers=self.of("bob"))[0], 404, path)
            self.assertEqual(self.ask("GET", path, headers={})[0], 401, path)
        connection = self.connection()
        connection.request("GET", f"/v1/jobs/{job}/result?format=MESH_FORMAT_PARTS", headers=self.of("ann"))
        self.assertEqual(len(connection.getresponse().read()), int(done["results"][0]["size"]))


if __name__ == "__main__":
    unittest.main(verbosity=2)
