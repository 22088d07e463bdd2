"""What the tests of the page of --http share: a server and a headless Chromium."""
import json
import os
import sys
from pathlib import Path

SOURCE = Path(os.environ["VARIMESH_SOURCE_DIR"])
PLUGIN = Path(os.environ["VARIMESH"]).resolve().parent / "libvarimesh_opencascade.so"
sys.path.insert(0, str(SOURCE / "tests" / "pages"))
import browser
from over_http import TLS, WithHttp

if TLS:
    browser.FLAGS.append("--ignore-certificate-errors")  # of an authority that no browser knows


class WithPage(WithHttp):
    @classmethod
    def setUpClass(cls):
        if missing := "there is no chromium to open the page with" if browser.find() is None else cls.missing():
            print("SKIPPED: " + missing)
            sys.exit(77)

    @classmethod
    def missing(cls):
        """What else the tests need and is not there."""

    def setUp(self):
        super().setUp()
        self.page = browser.Page()
        self.addCleanup(self.page.close)
        self.page.save_downloads(self.folder)

    def open(self, path="/"):
        self.page.open(self.url + path)

    def look_at(self, mesh):
        """Drops a mesh on the page and waits for its picture and the form."""
        self.page.drop_file(mesh)
        self.page.wait("!!document.querySelector('#pictures table') && !!document.querySelector('#run form')")

    def text(self, selector):
        return self.page.value(f"document.querySelector({json.dumps(selector)})?.textContent ?? ''")

    def set_field(self, id, value):
        self.page.value(f"(() => {{ const one = document.getElementById({json.dumps(id)}); one.value = {json.dumps(value)}; "
                        "one.dispatchEvent(new Event('input', {bubbles: true})); })()")

    def optimise(self):
        """Starts the run that the form describes and waits for its whole page."""
        self.page.click("#run button", "Optimise")
        self.wait_for_run()

    def wait_for_run(self):
        self.page.wait("document.querySelector('#state')?.textContent.startsWith('optimise · succeeded') && !!document.querySelector('#run form')", 100)

    def wait_for_state(self, state):
        self.page.wait(f"document.querySelector('#state')?.dataset.state === '{state}'")

    def downloaded(self, name):
        return self.page.downloaded(name).read_bytes()

    def faults_that_axe_finds(self):
        """What is hard to use for some people. VARIMESH_AXE names the file axe.min.js of axe-core."""
        self.page.value(Path(os.environ["VARIMESH_AXE"]).read_text() + "; 1")
        return self.page.value("axe.run().then((found) => found.violations.map((one) => [one.impact, one.help, one.nodes.map((node) => node.html)]))")

    def check_clean(self):
        self.assertEqual(self.page.errors, [])
        asked = {one for one in self.page.requests if not one.startswith((self.url + "/", "blob:", "data:", "about:"))}
        self.assertEqual(asked, set(), "everything comes from this server")


class WithModels(WithPage):
    """A page on a server that reads CAD models."""

    @classmethod
    def missing(cls):
        return "" if PLUGIN.exists() else "there is no plugin that reads CAD files"

    def setUp(self):
        os.environ["VARIMESH_OPENCASCADE"] = str(PLUGIN)
        self.addCleanup(os.environ.pop, "VARIMESH_OPENCASCADE")
        super().setUp()

    def drop(self, *files):
        self.open()
        self.page.drop_file(*files)
