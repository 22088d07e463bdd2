"""The page of --http in a headless Chromium: a mesh is dropped, looked at, optimised and downloaded there.
ctest runs it with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in the environment."""
import http.client
import json
import os
import re
import subprocess
import time
import unittest

from over_http import WithHttp
from programs import CASES, ENDLESS, FOLDED, LARGER, MESH, VARIMESHD, run
from with_page import WithPage

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
    def show_jobs(self, jobs):
        """Lets the page show these jobs in place of the server's."""
        self.open()
        self.page.value("""(() => { const old = window.fetch, jobs = %s;
            window.fetch = async (to, how) => {
              if (to.startsWith('/v1/jobs?')) return Response.json({jobs});
              if (to.includes('/events')) return new Response(null, {status: 204});
              const job = jobs.find(({name}) => to === `/v1/${name}`);
              return job ? Response.json({job}) : old(to, how);
            }; })()""" % json.dumps(jobs))

    def test_outcomes_in_the_list_and_on_the_pages_of_jobs(self):
        some = {"state": "JOB_STATE_CANCELLED", "createTime": "2026-01-01T00:00:00Z", "startTime": "2026-01-01T00:00:00Z", "endTime": "2026-01-01T00:00:01Z"}
        spec = {"quality": {}, "outputs": ["MESH_FORMAT_PARTS"], "mesh": {"digest": "0" * 64}}
        cases = [("a.msh", {"mesh": {"dimension": 2, "order": 1, "elements": str(elements)}, "after": {"certified": {"valid": str(valid)}}}, "quality", f"{elements - valid} of {said} not")
                 for valid, elements, said in ((0, 1, "1 element is"), (9, 10, "10 elements is"), (8, 10, "10 elements are"))]
        cases += [("a.msh", {}, "quality", ""), ("a.STEP", {}, "CAD model", "")]  # which ended before anything was read
        jobs = [{**some, "name": f"jobs/{number:032x}", "spec": {**spec, "labels": {"file": file}}, "metrics": metrics} for number, (file, metrics, _, _) in enumerate(cases)]
        self.show_jobs(jobs)
        self.page.value("location.hash = '#/jobs'")
        self.page.wait(f"document.querySelectorAll('#jobs tbody tr').length === {len(jobs)}")
        listed = self.page.value("[...document.querySelectorAll('#jobs tbody tr')].map((row) => [row.cells[1].textContent, row.cells[4].textContent])")
        self.assertEqual(listed, [[work, re.sub(" (is|are) not", " not certified valid", said)] for _, _, work, said in cases])
        for job, (_, metrics, work, said) in zip(jobs, cases):
            self.page.value(f"location.hash = '#/{job['name']}'")
            self.page.wait(f"document.querySelector('#state')?.textContent.endsWith('{job['name']}') && !!document.querySelector('{'#advice pre' if work == 'CAD model' else '#run form'}')")
            self.assertTrue(self.text("#state").startswith(f"{work} · cancelled"), self.text("#state"))
            if metrics:
                self.assertEqual(self.text("#verdict .verdict"), said + " certified valid.")

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

    def test_a_cad_model_gets_the_commands_for_it_where_the_server_reads_none(self):
        self.open()
        self.page.drop_file(CASES / "geometry" / "bracket.step")
        self.page.wait("!!document.querySelector('#advice pre')")
        self.assertIn("varimesh mesh bracket.step", self.text("#advice"))
        self.assertIn("no picture of bracket.step", self.text("#told"))

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

    def check(self):
        self.assertEqual(self.faults_that_axe_finds(), [])

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
        self.open(f"/#/jobs/{self.submit(LARGER, *ENDLESS)}")
        self.page.wait("!!document.querySelector('#moving .view .drawing')")
        self.check()


if __name__ == "__main__":
    unittest.main()
