"""The page of --http in a headless Chromium: a mesh is dropped, looked at, optimised and downloaded there.
ctest runs it with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in the environment."""
import hashlib
import http.client
import json
import os
import re
import subprocess
import time
import unittest
from pathlib import Path

from over_http import WithHttp
from programs import CASES, ENDLESS, FOLDED, LARGER, MESH, VARIMESHD, run
from with_page import WithPage

PLUGIN = Path(os.environ["VARIMESH"]).parent / "libvarimesh_opencascade.so"
FILES = {"/": "text/html", "/page.css": "text/css", "/page.js": "text/javascript", "/three.js": "text/javascript"}


class Files(WithHttp):
    """What the port sends of the page, without a browser."""

    def fetch(self, path, method="GET", **headers):
        connection = http.client.HTTPConnection(self.http, timeout=20)
        self.addCleanup(connection.close)
        connection.request(method, path, headers=headers)
        answer = connection.getresponse()
        return answer.status, answer.headers, answer.read()

    def test_come_with_a_strict_policy(self):
        for path, type in FILES.items():
            code, headers, body = self.fetch(path)
            self.assertEqual((code, headers["Content-Type"]), (200, type + "; charset=utf-8"), path)
            policy = dict(part.split(" ", 1) for part in headers["Content-Security-Policy"].split("; "))
            self.assertEqual((policy["default-src"], policy["script-src"], policy["frame-ancestors"]), ("'none'", "'self'", "'none'"))
            self.assertEqual(headers["X-Content-Type-Options"], "nosniff")
            self.assertEqual(headers["Cross-Origin-Resource-Policy"], "same-origin")
            self.assertEqual(self.fetch(path, "HEAD")[2], b"")
            self.assertNotIn(self.fetch(path, "POST")[0], (200, 204), path)

    def test_have_no_scripts_and_styles_within(self):
        text = self.fetch("/")[2].decode()
        for found in re.findall(r"<script[^>]*>", text):
            self.assertIn(" src=", found)
        self.assertNotRegex(text, r"<style| style=| on[a-z]+=|https?://")

    def test_can_be_linked_to_but_not_by_another_name(self):
        self.assertEqual(self.fetch("/", **{"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate"})[0], 200)
        for host in ("evil.example", "127.0.0.1.evil.example", "10.0.0.1"):
            self.assertEqual(self.fetch("/", Host=host)[0], 421, host)


class Page(WithPage):
    def test_a_mesh_is_dropped_looked_at_optimised_and_downloaded(self):
        self.open()
        self.look_at(MESH)
        document = json.loads(run("quality", MESH, "--json").stdout)
        self.assertEqual(self.page.value("document.querySelectorAll('#pictures .flagged').length"), document["quality"]["invalid_elements"])
        self.assertIn(str(document["quality"]["invalid_elements"]), self.text("#job .tiles"))
        self.assertIn("boundary", self.text("#pictures > .scrolls"))
        self.assertIn("not certified valid", self.text("#verdict"))

        self.optimise()
        views = "document.querySelectorAll('#pictures .view')"
        self.assertEqual(self.page.value(f"[0, 1].map((i) => {views}[i].querySelectorAll('.flagged').length)"), [2, 0])
        self.page.wait("document.querySelectorAll('#job .curve').length === 3")
        self.assertIn("varimesh optimise nine_triangles.msh -o nine_triangles-better.msh", self.text("#run pre"))

        expected = self.folder / "expected.msh"
        self.assertEqual(run("optimise", MESH, "-o", expected).returncode, 0)
        self.page.click("#downloads button", "Download")
        self.assertEqual(self.downloaded("nine_triangles-better.msh"), expected.read_bytes())
        # Another format is written from the result by the server.
        self.assertEqual(run("convert", expected, self.folder / "expected.mesh").returncode, 0)
        self.page.value("""(() => { const select = document.querySelector('#downloads select');
            select.value = [...select.options].findIndex((one) => one.textContent === 'mfem'); select.dispatchEvent(new Event('change')); })()""")
        self.page.click("#downloads button", "Download")
        self.assertEqual(self.downloaded("nine_triangles-better.mesh"), (self.folder / "expected.mesh").read_bytes())
        self.check_clean()

    def test_invalid_elements_have_their_colour_in_three_dimensions(self):
        mesh = CASES / "sphere_p3.msh"
        self.assertGreater(json.loads(run("quality", mesh, "--json").stdout)["quality"]["invalid_elements"], 0)
        self.open()
        self.look_at(mesh)
        choose = "(() => { const one = document.querySelectorAll('#pictures %s')[%d]; one.value = %s; one.dispatchEvent(new Event('%s')); })()"
        self.page.value(choose % ("select", 1, "0", "change"))  # no cut
        self.page.value(choose % ("select", 0, "2", "change"))  # no boundary
        counts = []
        for threshold in ("1", "1e-9"):  # all elements, and those that are invalid
            self.page.value(choose % ("input[type=range]", 1, threshold, "input"))
            time.sleep(0.3)
            counts.append(self.page.value("""new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => {
                const canvas = document.querySelector('#pictures .view canvas');
                const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext('2d', {willReadFrequently: true});
                copy.drawImage(canvas, 0, 0);
                const {data} = copy.getImageData(0, 0, canvas.width, canvas.height);
                let [all, red] = [0, 0];
                for (let i = 0; i < data.length; i += 4) {
                  if (data[i + 3] === 0) continue;
                  ++all;
                  if (data[i] > 1.6 * data[i + 2] && data[i] > 1.4 * data[i + 1]) ++red;
                }
                done([all, red]);
              })))"""))
        (all_drawn, _), (drawn, red) = counts
        self.assertGreater(all_drawn, 1000)
        self.assertLess(drawn, all_drawn, counts)
        self.assertGreater(red, drawn / 4, counts)  # the rest is edges and shadow
        self.check_clean()

    def test_a_job_is_watched_and_cancelled(self):
        job = self.submit(LARGER, *ENDLESS)
        self.open(f"/#/jobs/{job}")
        self.page.wait("/ [0-9]+: .*not certified/.test(document.querySelector('#job .readout')?.textContent)")
        self.page.click("button", "Cancel")
        self.page.click("button", "Cancel: click again")
        self.wait_for_state("cancelled")
        self.assertEqual(self.wait(job, "JOB_STATE_CANCELLED")["state"], "JOB_STATE_CANCELLED")
        self.page.wait("document.querySelectorAll('#pictures .view').length === 2 || document.querySelectorAll('#pictures .view').length === 4")
        self.check_clean()

    def test_the_list_of_jobs(self):
        for _ in range(22):
            self.submit(MESH, "--time-limit", "5")
        job = self.submit(LARGER, *ENDLESS)
        self.open("/#/jobs")
        rows = "document.querySelectorAll('#jobs tbody tr').length"
        self.page.wait(f"{rows} === 20")
        self.page.value("[1, 2].forEach(() => [...document.querySelectorAll('button')].find((one) => one.textContent === 'Older').click())")
        self.page.wait(f"{rows} === 3")
        self.page.click("button", "Newer")  # Two clicks at once are one.
        self.page.wait(f"{rows} === 20")
        self.page.value("(() => { const one = document.querySelector('#jobs select'); one.value = 2; one.dispatchEvent(new Event('change')); })()")
        self.page.wait(f"{rows} === 1")
        self.assertIn("iteration", self.text("#jobs tbody tr"))
        self.page.click("#jobs button", "Cancel")
        self.page.click("#jobs button", "Cancel: click again")
        self.assertEqual(self.wait(job, "JOB_STATE_CANCELLED")["state"], "JOB_STATE_CANCELLED")
        self.check_clean()

    def test_the_list_keeps_the_focus(self):
        job = self.submit(LARGER, *ENDLESS)
        self.open("/#/jobs")
        self.page.wait("document.querySelector('#jobs tbody tr')?.textContent.includes('iteration')")
        self.page.value("document.querySelector('#jobs tbody a').focus()")
        text = self.text("#jobs tbody tr")
        self.page.wait(f"document.querySelector('#jobs tbody tr').textContent !== {json.dumps(text)}")
        self.assertEqual(self.page.value("document.activeElement.hash ?? ''"), f"#/jobs/{job}")
        self.submit(MESH, "--time-limit", "5")
        self.page.wait("document.querySelectorAll('#jobs tbody tr').length === 2")
        self.assertEqual(self.page.value("document.activeElement.hash ?? ''"), f"#/jobs/{job}")
        self.assertNotIn(job, self.page.value("document.querySelector('#jobs tbody a').hash"), "the newest comes first")
        self.page.click("#jobs tbody tr:last-child button", "Cancel")
        self.page.click("#jobs tbody tr:last-child button", "Cancel: click again")
        self.page.wait("[...document.querySelectorAll('#jobs button')].filter((one) => one.textContent === 'Delete').length === 2")
        self.check_clean()

    def test_one_job_at_a_time(self):
        jobs = [self.submit(LARGER, *ENDLESS) for _ in range(2)]
        self.open(f"/#/jobs/{jobs[0]}")
        for i in (1, 0, 1):
            self.page.value(f"location.hash = '#/jobs/{jobs[i]}'")
        self.page.wait("!!document.querySelector('#state')")
        time.sleep(2)
        self.assertEqual(self.page.value("document.querySelectorAll('#job').length"), 1)
        self.assertIn(jobs[1], self.text("#state"))
        self.check_clean()

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

    def test_views_that_are_left_are_forgotten(self):
        self.open()
        for _ in range(3):
            self.look_at(CASES / "sphere_p3.msh")
            self.page.value("location.hash = '#/'")
            self.page.wait("!!document.querySelector('#start')")
        time.sleep(1)
        self.page.ask("HeapProfiler.collectGarbage")
        kind = self.page.ask("Runtime.evaluate", expression="THREE.Scene.prototype")["result"]["objectId"]
        found = self.page.ask("Runtime.queryObjects", prototypeObjectId=kind)["objects"]["objectId"]
        count = self.page.ask("Runtime.callFunctionOn", objectId=found, functionDeclaration="function() { return this.length; }", returnByValue=True)
        self.assertEqual(count["result"]["value"], 0)
        self.check_clean()

    def tab_to(self, wanted):
        """Presses Tab until the element with this text or id has the focus. Returns the texts and ids of all on the way."""
        reached = []
        while len(reached) < 80 and wanted not in reached:
            self.page.press("Tab", 9)
            reached.append(self.page.value("(() => { const one = document.activeElement; return one.textContent.trim().slice(0, 30) || one.id; })()"))
        self.assertIn(wanted, reached)
        return reached

    def test_only_by_keyboard(self):
        self.open()
        self.assertIn("Jobs", self.tab_to("file"))
        self.look_at(MESH)
        self.assertIn("option-timeLimit", self.tab_to("Optimise"))
        self.page.press("Enter", 13, "\r")
        self.wait_for_run()
        self.tab_to("Download")
        self.check_clean()

    def test_a_cad_model_gets_the_commands_for_it(self):
        self.open()
        self.page.drop_file(CASES / "geometry" / "bracket.step")
        self.page.wait("!!document.querySelector('#advice pre')")
        self.assertIn("varimesh mesh bracket.step", self.text("#advice"))

    def test_markup_in_a_name_stays_text(self):
        mesh = self.folder / "<img src=x onerror=alert(1)>.msh"
        mesh.write_text(FOLDED)
        self.open()
        self.look_at(mesh)
        self.assertEqual(self.page.value("document.querySelectorAll('img').length"), 0)
        self.assertIn("<img", self.text("#job h2"))
        self.check_clean()

    def test_what_is_no_mesh_is_refused_with_the_servers_sentence(self):
        mesh = self.folder / "no.msh"
        mesh.write_text("hello")
        self.open()
        self.page.drop_file(mesh)
        self.wait_for_state("failed")
        self.assertRegex(self.text("#state"), "[Mm]esh")

    def test_fits_narrow_and_dark(self):
        self.open()
        self.look_at(MESH)
        self.page.look(390, 844, dark=True)
        self.assertEqual(self.page.value("document.documentElement.scrollWidth"), 390)
        self.assertNotEqual(self.page.value("getComputedStyle(document.body).backgroundColor"), "rgb(246, 247, 248)")
        self.open("/#/jobs")
        self.page.wait("!!document.querySelector('#jobs tbody tr')")
        self.assertEqual(self.page.value("document.documentElement.scrollWidth"), 390)
        self.check_clean()


class Models(WithPage):
    """CAD models, on a server that takes them."""

    @classmethod
    def missing(cls):
        return "" if PLUGIN.exists() else "there is no plugin that reads CAD files"

    def setUp(self):
        os.environ["VARIMESH_OPENCASCADE"] = str(PLUGIN)
        self.addCleanup(os.environ.pop, "VARIMESH_OPENCASCADE")
        super().setUp()

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


class Tokens(WithPage):
    def flags(self):
        tokens = self.folder / "tokens"
        self.token = subprocess.run([VARIMESHD, "token", "ann", "--tokens", tokens], capture_output=True, text=True, timeout=20).stdout.strip()
        return ("--tokens", str(tokens))

    def test_come_with_the_address_and_leave_it(self):
        self.open(f"/#token={self.token}")
        self.assertIsNone(self.page.value("sessionStorage.getItem('token')"), "anybody can link to the page")
        self.page.click("#token button", "Use this token")
        self.look_at(MESH)
        self.assertNotIn(self.token, self.page.value("location.href"))
        self.assertNotIn(self.token, "".join(self.page.requests).replace(f"#token={self.token}", ""))
        self.assertEqual(self.page.value("localStorage.length + document.cookie.length"), 0)
        self.open("/#token=another")  # does not take the place of the one that the tab has
        self.assertEqual(self.page.value("sessionStorage.getItem('token')"), self.token)
        self.check_clean()

    def test_of_a_link_need_not_be_used(self):
        self.open("/#token=of-somebody-else")
        self.page.click("#token button", "Do not use it")
        self.assertIsNone(self.page.value("sessionStorage.getItem('token')"))
        self.assertEqual(self.text("#token"), "")

    def test_that_no_header_can_have(self):
        self.open("/#/jobs")
        self.page.wait("!!document.querySelector('#token input')")
        self.page.value("document.querySelector('#token input').value = '\u65e5\u672c'")
        self.page.click("#token button", "Use this token")
        self.assertIn("letters, digits", self.text("#told"))

    def test_are_asked_for(self):
        self.open("/#/jobs")
        self.page.wait("!!document.querySelector('#token input')")
        self.page.value(f"document.querySelector('#token input').value = {json.dumps(self.token)}")
        self.page.click("#token button", "Use this token")
        self.page.wait("document.querySelector('#jobs')?.textContent.includes('no such jobs')")


class Accessibility(WithPage):
    """axe-core finds no fault. It is not here: VARIMESH_AXE names its axe.min.js (npm pack axe-core)."""

    @classmethod
    def missing(cls):
        return "" if os.environ.get("VARIMESH_AXE") else "VARIMESH_AXE does not name the file axe.min.js of axe-core (npm pack axe-core)"

    def setUp(self):
        super().setUp()
        self.axe = Path(os.environ["VARIMESH_AXE"]).read_text()

    def check(self):
        self.page.value(self.axe + "; 1")
        faults = self.page.value("axe.run().then((found) => found.violations.map((one) => [one.impact, one.help, one.nodes.map((node) => node.html)]))")
        self.assertEqual(faults, [])

    def test_of_all_views(self):
        self.open("/#token=x")  # which the page asks about
        self.check()
        for mesh in (MESH, CASES / "sphere_p3.msh"):
            self.open()
            self.look_at(mesh)
            self.page.value("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
            self.check()
            self.optimise()
            for dark in (True, False):
                self.page.look(1280, 900, dark)
                self.check()
        self.open("/#/jobs")
        self.page.wait("!!document.querySelector('#jobs tbody tr')")
        for width in (1280, 390):
            self.page.look(width, 900)
            self.check()


if __name__ == "__main__":
    unittest.main()
