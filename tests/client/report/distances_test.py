"""The page of --report for a mesh whose nodes slid on a CAD model: the boundary can be coloured by its distance from the model,
and the surfaces have the names of the STEP file. Skipped, with a word, without the plugin that reads CAD files or Chromium."""
import json
import sys
import unittest
from pathlib import Path

import browser
from programs import CASES, VARIMESH, Server, WithFolder, run

BRACKET, MODEL = CASES / "geometry" / "bracket_p3.msh", CASES / "geometry" / "bracket.step"
PLUGIN = Path(VARIMESH).parent / "libvarimesh_opencascade.so"
TWO_FRAMES = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


def called(surface):
    return f"surface {surface['surface']}" + (f" ‘{surface['name']}’" if surface["name"] else "")


class Distances(WithFolder):
    @classmethod
    def setUpClass(cls):
        for there, what in ((PLUGIN.exists(), "plugin that reads CAD files"), (browser.find(), "chromium to open reports with")):
            if not there:
                print(f"SKIPPED: there is no {what}")
                sys.exit(77)
        cls.page = browser.Page()

    @classmethod
    def tearDownClass(cls):
        cls.page.close()

    def optimise(self, *flags):
        file = self.folder / "report.html"
        done = run("optimise", BRACKET, "--geometry", MODEL, "-o", self.folder / "out.msh", "--threads", 1, "--report", file, "--json",
                   *flags)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.page.errors.clear()
        self.page.look(1280, 900)
        self.page.open(file)
        self.assertEqual(self.page.errors, [])
        return json.loads(done.stdout)["geometry"]

    def pictures(self):
        return [self.page.picture(f"#pictures figure:nth-child({one}) .view") for one in (1, 2)]

    def text(self, selector):
        return self.page.value(f"document.querySelector({json.dumps(selector)}).textContent")

    def colour_by(self, value):
        self.page.value(f"""(() => {{ const choice = document.getElementById('colouring'); choice.value = '{value}';
            choice.dispatchEvent(new Event('change')); }})()""")

    def check_table(self, geometry):
        rows = self.page.value("""[...document.querySelectorAll('#surfaces-table tbody tr')].map((row) => [
            row.querySelector('th').textContent, [...row.querySelectorAll('td[data-value]')].map((cell) => Number(cell.dataset.value))])""")
        expected = [[called(one), [one["elements"], *(one["distance"][when][what] for what in ("largest", "rms") for when in ("before", "after")),
                                   one["folded"]["before"], one["folded"]["after"]]] for one in geometry["surfaces"]]
        self.assertEqual(rows, expected)

    def check_views(self, geometry):
        by_jacobian = self.pictures()
        self.assertIn("scaled Jacobian", self.text(".legend"))
        self.colour_by(1)
        by_distance = self.pictures()
        for one, other in zip(by_jacobian, by_distance):
            self.assertNotEqual(one, other)
        self.assertNotEqual(*by_distance)
        for words in ("from the CAD model", "mesh’s unit of length"):
            self.assertIn(words, self.text(".legend"))
        self.assertEqual(self.text("#pictures h2"), "The mesh, coloured by distance from the CAD model")
        self.colour_by(0)
        self.assertEqual(self.pictures(), by_jacobian)
        # The button of a row shows its surface, in the middle of the views.
        for row in range(3):
            self.page.value(f"document.querySelectorAll('#surfaces-table button')[{row}].click()")
            self.page.value(TWO_FRAMES)
            self.page.value("""(() => { const view = document.querySelector('#pictures figure:nth-child(2) .view');
                const {left, top, width, height} = view.getBoundingClientRect();
                view.dispatchEvent(new PointerEvent('pointermove', {clientX: left + width / 2, clientY: top + height / 2})); })()""")
            self.page.value(TWO_FRAMES)
            tip = self.text("#pictures figure:nth-child(2) .tip")
            self.assertIn(f"on {called(geometry['surfaces'][row])}, up to ", tip)
        self.assertEqual(self.text("#pictures h2"), "The mesh, coloured by distance from the CAD model")
        self.assertEqual(self.page.errors, [])

    def test_shows_the_distance_before_and_after_of_a_local_run(self):
        geometry = self.optimise()
        names = {one["surface"]: one["name"] for one in geometry["surfaces"]}
        self.assertEqual((len(names), names[4], names[11]), (13, "Fillet", ""))
        self.check_table(geometry)
        self.check_views(geometry)

    def test_shows_the_same_for_a_job_of_a_server(self):
        alone = self.optimise()
        server = Server(VARIMESH_OPENCASCADE=str(PLUGIN))
        self.addCleanup(server.stop)
        geometry = self.optimise("--server", server.address)
        self.assertEqual(geometry, alone)
        self.check_table(geometry)
        self.check_views(geometry)

    def test_fits_narrow_screens_and_the_dark_theme(self):
        self.optimise()
        self.colour_by(1)
        for width, dark in ((390, False), (390, True), (1280, True)):
            self.page.look(width, 844, dark)
            self.page.value("new Promise((done) => setTimeout(done, 100))")
            self.assertLessEqual(self.page.value("document.documentElement.scrollWidth"), width)
        self.assertEqual(self.page.errors, [])


if __name__ == "__main__":
    unittest.main()
