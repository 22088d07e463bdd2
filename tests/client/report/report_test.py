"""The page of --report in a headless Chromium: it opens without errors and without a network, and its numbers are those of
--json."""
import base64
import json
import os
import re
import sys
import unittest

import browser
from programs import CASES, FOLDED, Server, WithFolder, run

MARKUP = "<img src=x onerror=alert(1)>&amp;.msh"


def rounded(text):
    """The number in the text of a table cell."""
    text = text.replace(",", "").replace("−", "-")
    if match := re.fullmatch(r"(.*) × 10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", text):
        power = match[2].translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))
        return float(match[1]) * 10.0 ** int(power)
    return float(text)


def cube_of_tetrahedra(n):
    """A cube of n × n × n small cubes, each cut into six tetrahedra along its diagonal; elements are numbered from 1."""
    def node(i, j, k):
        return 1 + i + (n + 1) * (j + (n + 1) * k)

    nodes = [f"{node(i, j, k)} {i / n} {j / n} {k / n}" for k in range(n + 1) for j in range(n + 1) for i in range(n + 1)]
    steps = ((0, 1, 2), (1, 2, 0), (2, 0, 1), (1, 0, 2), (0, 2, 1), (2, 1, 0))  # the first three are even permutations
    elements = []
    for k in range(n):
        for j in range(n):
            for i in range(n):
                for number, axes in enumerate(steps):
                    at, path = [i, j, k], [node(i, j, k)]
                    for axis in axes:
                        at[axis] += 1
                        path.append(node(*at))
                    if number > 2:
                        path[1], path[2] = path[2], path[1]
                    elements.append(f"{len(elements) + 1} 4 2 1 1 " + " ".join(map(str, path)))
    return ("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n%d\n%s\n$EndNodes\n$Elements\n%d\n%s\n$EndElements\n"
            % (len(nodes), "\n".join(nodes), len(elements), "\n".join(elements)))


class Report(WithFolder):
    @classmethod
    def setUpClass(cls):
        if browser.find() is None:
            print("SKIPPED: there is no chromium to open reports with")
            sys.exit(77)
        cls.page = browser.Page()

    @classmethod
    def tearDownClass(cls):
        cls.page.close()

    def open(self, path):
        self.page.errors.clear()
        self.page.requests.clear()
        self.page.look(1280, 900)
        self.page.open(path)
        self.assertEqual(self.page.errors, [])
        asked = [one for one in self.page.requests if not one.startswith(("blob:", "data:")) and one != "about:blank"]
        self.assertEqual(len(asked), 1, asked)

    def cells(self, table):
        """For each row of a table: its name, and for each cell the value with all digits and the text."""
        return self.page.value(f"""[...document.querySelectorAll('#{table} tbody tr')].map((row) => [
            row.querySelector('th').textContent, [...row.querySelectorAll('td')].map((cell) =>
                [cell.dataset.value ?? null, cell.textContent])])""")

    def check_table(self, table, expected):
        """Checks that the cells have exactly these values, and that their texts are near them."""
        shown = dict(self.cells(table))
        for name, values in expected.items():
            self.assertEqual(len(shown[name]), len(values), name)
            for (exact, text), value in zip(shown[name], values):
                self.assertEqual(float(exact), value, name)
                self.assertAlmostEqual(rounded(text), value, delta=max(6e-5, 6e-3 * abs(value)), msg=name)

    def check_numbers(self, document):
        snapshots = [document["before"], document["after"]] if "before" in document else [document["quality"]]
        self.check_table("quality-table", {
            "Smallest scaled Jacobian": [one["min_scaled_jacobian"] for one in snapshots],
            "Mean scaled Jacobian": [one["mean_scaled_jacobian"] for one in snapshots],
            "Smallest distortion Jacobian": [one["min_distortion_jacobian"] for one in snapshots],
            "Invalid elements, sampled": [one["invalid_elements"] for one in snapshots],
            "Certified valid": [one["certified"]["valid"] for one in snapshots],
            "Certified invalid": [one["certified"]["invalid"] for one in snapshots],
            "Undecided": [one["certified"]["undecided"] for one in snapshots],
            "Proved lower bound of the smallest scaled Jacobian": [one["certified"]["min_scaled_jacobian_lower_bound"] for one in snapshots],
            "Loss of accuracy": [one["accuracy"]["loss"] for one in snapshots]})
        self.check_table("mesh-table", {key.replace("_", " ", 1): [value] for key, value in document["mesh"].items()})
        if "iterations" in document:
            self.check_table("mesh-table", {key: [document[key]] for key in ("iterations", "seconds", "residual")})

    def optimise(self, mesh, *arguments, **keywords):
        page = self.folder / "report.html"
        done = run("optimise", mesh, "-o", self.folder / "out.vtu", "--report", page, "--json", *arguments, **keywords)
        self.assertIn(done.returncode, (0, 4), done.stderr)
        self.open(page)
        return json.loads(done.stdout)

    def aims(self):
        """What the page says was done, and to what end."""
        return self.page.value("[...document.querySelectorAll('.aim')].map((one) => one.textContent).join(' ')")

    def check_bands(self):
        """Every phase has a shade of its own: a band without one would be black."""
        bands = self.page.value("[...document.querySelectorAll('#convergence .band')].map((one) => getComputedStyle(one).fill)")
        self.assertGreater(len(bands), 0)
        self.assertNotIn("rgb(0, 0, 0)", bands)
        shades = self.page.value("""['sweeps', 'newton', 'untangle', 'accuracy'].map(
            (name) => getComputedStyle(document.body).getPropertyValue(`--band-${name}`))""")
        self.assertEqual(len(set(shades) - {""}), 4, shades)

    def test_shows_a_mesh_in_two_dimensions_as_curves(self):
        document = self.optimise(CASES / "nine_triangles.msh", "--energy", "winslow")
        self.check_numbers(document)
        self.assertIn("Objective: energy, because --energy is given", self.aims())
        self.assertRegex(self.aims(), r"^\d+ of \d+ nodes were free to move, and the boundary stayed as it was; \d+ iterations, converged\.")
        self.assertEqual(self.page.value("document.querySelectorAll('#pictures svg.drawing').length"), 2)
        # Before the optimisation, only the two edges at the bottom are curved; after it, the inner edges are too.
        outline = self.page.value("document.querySelector('#pictures .outline').getAttribute('d')")
        self.assertEqual(outline.count("C"), 2 * 2)  # Two curves per edge of order 4.
        outline = self.page.value("document.querySelectorAll('#pictures .outline')[1].getAttribute('d')")
        self.assertGreater(outline.count("C"), 2 * 10)
        self.assertEqual(self.page.value("document.querySelectorAll('#pictures .view')[0].querySelectorAll('.flagged').length"), 2)
        self.assertEqual(self.page.value("document.querySelectorAll('#pictures .view')[1].querySelectorAll('.flagged').length"), 0)
        worst = self.page.value("[...document.querySelectorAll('#worst table')].map((one) => one.querySelectorAll('td')[2].dataset.value)")
        for value, snapshot in zip(worst, ("before", "after")):
            self.assertAlmostEqual(float(value), document[snapshot]["min_scaled_jacobian"], 12)
        self.assertIn("winslow", self.page.value("document.getElementById('origin').textContent"))
        self.assertEqual(self.page.value("document.querySelectorAll('#convergence .curve').length"), 3)
        self.assertIn("newton", self.page.value("document.querySelector('#convergence').textContent"))

    def test_shows_a_mesh_in_three_dimensions(self):
        self.check_numbers(self.optimise(CASES / "sphere_p3.msh"))
        self.check_bands()
        pictures = []
        for cut in ("2", "0"):  # across y, none
            self.page.value(f"""(() => {{ const cut = document.querySelectorAll('#pictures select')[1];
                cut.value = '{cut}'; cut.dispatchEvent(new Event('change')); }})()""")
            self.page.value("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
            pictures.append([self.page.picture(f"#pictures figure:nth-child({one}) .view") for one in (1, 2)])
        # The views before and after differ inside the mesh; without a cut, the boundary hides the inside.
        self.assertEqual(len(set(pictures[0])), 2)
        for with_cut, without in zip(*pictures):
            self.assertNotEqual(with_cut, without)
        self.assertEqual(self.page.errors, [])

    def saved_picture(self, path):
        """The width and height of a PNG file, how many colours it has, and whether all of it is opaque, as the browser reads
        it."""
        return self.page.value(f"""(async () => {{
            const picture = new Image();
            picture.src = 'data:image/png;base64,{base64.b64encode(path.read_bytes()).decode()}';
            await picture.decode();
            const canvas = new OffscreenCanvas(picture.width, picture.height).getContext('2d');
            canvas.drawImage(picture, 0, 0);
            const pixels = new Uint32Array(canvas.getImageData(0, 0, picture.width, picture.height).data.buffer);
            return [picture.width, picture.height, new Set(pixels).size, pixels.every((pixel) => pixel >>> 24 === 255)]; }})()""")

    def test_saves_the_pictures_of_both_views(self):
        self.optimise(CASES / "sphere_p3.msh")
        self.page.save_downloads(self.folder)
        self.page.click("#pictures button", "Save as PNG")
        files = [self.page.downloaded(f"sphere_p3-{snapshot}.png") for snapshot in ("before", "after")]
        for number, file in enumerate(files, 1):
            size = self.page.value(f"""(() => {{ const view = document.querySelector('#pictures figure:nth-child({number}) canvas');
                return [view.width, view.height]; }})()""")
            *saved, colours, opaque = self.saved_picture(file)
            self.assertEqual(saved, size)
            self.assertGreater(colours, 100)
            self.assertTrue(opaque)
        self.assertNotEqual(files[0].read_bytes(), files[1].read_bytes())
        self.assertEqual(self.page.errors, [])

    def test_a_cut_of_a_large_mesh_shows_the_elements_that_it_goes_through(self):
        """The page has curved faces of at most 4,000 elements, and of this mesh the corners of 6,000."""
        mesh, page = self.folder / "cube.msh", self.folder / "report.html"
        mesh.write_text(cube_of_tetrahedra(10))
        self.assertEqual(run("quality", mesh, "--report", page).returncode, 0)
        self.open(page)

        def frames():
            self.page.wait("document.documentElement.dataset.busy === undefined")
            self.page.value("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")

        def point_at_middle():
            self.page.value("""(() => { const view = document.querySelector('#pictures .view').getBoundingClientRect();
                document.querySelector('#pictures .view').dispatchEvent(new PointerEvent('pointermove', {
                    clientX: view.left + view.width / 2, clientY: view.top + view.height / 2, bubbles: true})); })()""")
            frames()
            return self.page.value("document.querySelector('#pictures .tip').textContent")

        self.assertRegex(point_at_middle(), r"^element \d+: scaled Jacobian about 1\.00$")
        half = self.page.picture("#pictures .view")
        self.page.value("""(() => { const cut = document.querySelector('#pictures input[type=range]');
            cut.value = 0.3; cut.dispatchEvent(new Event('input')); })()""")
        frames()
        self.assertNotEqual(self.page.picture("#pictures .view"), half)

        def only(number):
            self.page.value(f"""(() => {{ const field = document.querySelector('.element-number');
                field.value = {number}; field.dispatchEvent(new Event('change')); }})()""")
            frames()
            return self.page.value("document.querySelector('.element-number').validity.valid")

        self.assertTrue(only(3210))
        self.assertIn("element 3210:", point_at_middle())
        self.assertFalse(only(6001))
        self.assertEqual(self.page.errors, [])

    def test_a_constant_curve_has_readable_ticks(self):
        self.optimise(CASES / "nine_triangles.msh", "--max-iterations", "1")
        ticks = self.page.value("""[...document.querySelectorAll('#convergence text')].map((one) => one.textContent)""")
        self.assertLessEqual(max(len(tick) for tick in ticks if any(c.isdigit() for c in tick)), 8, ticks)

    def test_has_the_same_histograms_as_the_document(self):
        page = self.folder / "report.html"
        done = run("quality", CASES / "sphere_p3.msh", "--report", page, "--json")
        document = json.loads(done.stdout)
        self.open(page)
        self.check_numbers(document)
        bars = self.page.value("[...document.querySelectorAll('#histograms rect title')].map((one) => one.textContent)")
        counts = [int(bar.rsplit(": ", 1)[1].replace(",", "")) for bar in bars]
        self.assertEqual(counts[0], document["quality"]["invalid_elements"])
        self.assertEqual(counts[1:], [count for count in document["quality"]["histogram"] if count > 0])

    def test_marks_unrepairable_elements(self):
        mesh = self.folder / "folded.msh"
        mesh.write_text(FOLDED)
        document = self.optimise(mesh)
        self.assertTrue(document["unrepairable"])
        self.assertGreater(self.page.value("document.querySelectorAll('#pictures .never').length"), 0)
        self.assertIn(document["unrepairable"][0]["sentence"], self.page.value("document.getElementById('unrepairable').textContent"))
        self.assertIn("it is proved that moving interior nodes cannot repair it", self.page.value("document.querySelector('.verdict').textContent"))

    def test_shows_a_job_of_a_server_and_never_treats_names_as_markup(self):
        mesh = self.folder / MARKUP
        mesh.write_bytes((CASES / "nine_triangles.msh").read_bytes())
        page = self.folder / "report.html"
        server = Server()
        self.addCleanup(server.stop)
        run("optimise", mesh, "-o", self.folder / "out.msh", "--report", page, "--server", server.address)
        self.open(page)
        self.assertEqual(self.page.value("document.querySelector('h1').textContent"), MARKUP)
        job = run("submit", mesh, "--label", "run=<b>bold</b>", "--server", server.address).stdout.strip()
        run("watch", job, "--server", server.address)
        done = run("result", job, "--report", page, "--json", "--server", server.address)
        self.open(page)
        self.check_numbers(json.loads(done.stdout))
        self.assertIn("<b>bold</b>", self.page.value("document.getElementById('origin').textContent"))
        self.assertEqual(self.page.value("document.querySelectorAll('main b, main img, header img').length"), 0)

    def test_fits_narrow_screens_and_the_dark_theme(self):
        self.optimise(CASES / "aerofoil_p4.msh")
        for width, dark in ((390, False), (390, True), (1280, True)):
            self.page.look(width, 844, dark)
            self.page.value("new Promise((done) => setTimeout(done, 100))")
            self.assertLessEqual(self.page.value("document.documentElement.scrollWidth"), width)
            cut = "[...document.querySelectorAll('.scrolls')].filter((one) => one.scrollWidth > one.clientWidth)"
            self.assertEqual(self.page.value(cut + ".map((one) => one.textContent.slice(0, 40))"), [], width)
        tops = "[...columns.children].map((one) => Math.round(one.getBoundingClientRect().top))"
        level = self.page.value(f"[...document.querySelectorAll('.columns')].map((columns) => new Set({tops}).size)")
        self.assertEqual(set(level), {1}, "columns begin at the same height")
        self.assertEqual(self.page.value("""[...document.querySelectorAll('svg.chart')].flatMap((chart) => {
            const texts = [...chart.querySelectorAll('text')].map((one) => [one, one.getBoundingClientRect()]);
            const over = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
            return texts.filter(([one, box]) => one.getAttribute('transform') &&
                texts.some(([other, its]) => other !== one && over(box, its))).map(([one]) => one.textContent);
        })"""), [], "names of axes lie beside the numbers")
        self.assertEqual(self.page.errors, [])

    def test_names_the_device(self):
        on_device = {**os.environ, "LD_LIBRARY_PATH": os.environ["FAKE_DRIVER"]}
        document = self.optimise(CASES / "circle_p5.msh", "--objective", "energy", "--device", "gpu", env=on_device)
        if "has no kernels" in "".join(document["notes"]):
            self.skipTest("VariMesh was built without clang")
        self.assertEqual(dict(self.cells("mesh-table"))["device"], [[None, "Fake Card 1"]])
        self.optimise(CASES / "circle_p5.msh", "--objective", "energy")
        self.assertNotIn("device", dict(self.cells("mesh-table")))

    def test_never_breaks_a_line_inside_a_flag(self):
        self.optimise(CASES / "aerofoil_p4.msh", "--tolerance", "1e-4")  # the summary says why this is the energy's optimum
        self.assertIn("--objective accuracy", self.aims())
        flags = "[...document.querySelectorAll('.flag')]"
        self.page.value("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
        for width in range(320, 560, 20):
            self.page.look(width, 844)
            self.page.value("new Promise((done) => setTimeout(done, 50))")
            broken = flags + ".filter((one) => one.getClientRects().length > 1).map((one) => one.textContent)"
            self.assertEqual(self.page.value(broken), [], width)
        shown = re.findall("--[a-z][a-z-]+", self.page.value("document.body.innerText"))
        self.assertGreater(len(shown), 10)
        self.assertEqual(self.page.value(flags + ".length"), len(shown))

    def test_is_refused_if_it_cannot_be_written(self):
        done = run("quality", CASES / "nine_triangles.msh", "--report", self.folder / "none" / "report.html")
        self.assertEqual(done.returncode, 3)
        out = self.folder / "out.msh"
        done = run("optimise", CASES / "nine_triangles.msh", "-o", out, "--report", out)
        self.assertEqual(done.returncode, 2)
        self.assertFalse(out.exists())


if __name__ == "__main__":
    unittest.main()
