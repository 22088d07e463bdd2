"""The admin port: health checks, who may use it, and the live page, in a headless Chromium with a running server that has
50 jobs. ctest runs it with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in the environment."""
import http.client
import json
import os
import re
import socket
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

TESTS = Path(os.environ["VARIMESH_SOURCE_DIR"]) / "tests"
sys.path[:0] = [str(TESTS / "client"), str(TESTS / "pages")]
import browser
from programs import CASES, VARIMESHD, Server, run

MARKUP = '<img src=x onerror="document.title=1"><script>document.title=2</script>'
ENDLESS = ["--method", "sweeps", "--active-set", "off", "--tolerance", "1e-15", "--max-iterations", "100000"]


class WithAdminPort(unittest.TestCase):
    FLAGS = ()

    def setUp(self):
        self.server = Server("--admin", "127.0.0.1:0", "--threads", "1", *self.FLAGS)
        self.addCleanup(self.server.stop)
        deadline = time.monotonic() + 20
        while not (found := re.search(r"http://(127\.0\.0\.1:\d+)/", "".join(self.server.log))):
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.01)
        self.admin = found[1]

    def ask(self, path, method="GET", **headers):
        connection = http.client.HTTPConnection(self.admin, timeout=20)
        self.addCleanup(connection.close)
        connection.request(method, path, headers=headers)
        answer = connection.getresponse()
        return answer.status, answer.headers, answer.read().decode()

    def submit(self, mesh, *arguments):
        done = run("submit", CASES / mesh, "--server", self.server.address, *arguments)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout.strip()


class Port(WithAdminPort):
    def test_answers_health_checks(self):
        self.assertEqual(self.ask("/healthz/live")[0], 200)
        self.assertEqual(self.ask("/healthz/ready")[::2], (200, "ready\n"))

    def test_half_open_connections_do_not_silence_it(self):
        host, port = self.admin.rsplit(":", 1)
        silent = []
        self.addCleanup(lambda: [one.close() for one in silent])
        for i in range(40):
            silent.append(socket.create_connection((host, int(port)), 20))
            silent[-1].sendall(b"GET /healthz/live HTTP/1.1\r\nHost: 127.0.0.1\r\n" if i % 2 else b"")
        began = time.monotonic()
        for _ in range(3):
            self.assertEqual(self.ask("/healthz/live")[0], 200)
        self.assertLess(time.monotonic() - began, 8, "40 connections of a second round would take 100 s with 4 threads")

    def test_accepts_only_get_requests_from_this_machine(self):
        port = self.admin.rsplit(":", 1)[1]
        for host, status in ((f"localhost:{port}", 200), (f"[::1]:{port}", 200), ("127.0.0.1", 200),
                             ("evil.example", 421), (f"evil.example:{port}", 421), ("127.evil.example", 421),
                             ("localhost.evil.example", 421), ("[::1].evil.example", 421), ("", 421)):
            self.assertEqual(self.ask("/api/status", Host=host)[0], status, host)
        for method in ("POST", "PUT", "DELETE", "OPTIONS", "PATCH"):
            self.assertEqual(self.ask("/api/status", method)[0], 405, method)
        self.assertEqual(self.ask("/api/cancel?job=jobs/none")[0], 405)
        own = {"Origin": f"http://{self.admin}", "Authorization": "Bearer any"}
        status, _, why = self.ask("/api/cancel?job=jobs/none", "POST", **own)
        self.assertEqual(status, 403, "who has no token cancels nothing here")
        self.assertIn("varimesh cancel", why)
        status, headers, _ = self.ask("/")
        self.assertEqual(status, 200)
        self.assertIn("default-src 'none'", headers["Content-Security-Policy"])
        self.assertNotIn("unsafe", headers["Content-Security-Policy"])
        for path in ("/etc/passwd", "/../etc/passwd", "/api/", "/api/iterations?job=jobs/none"):
            self.assertEqual(self.ask(path)[0], 404, path)

    def test_refuses_other_addresses_than_loopback_and_a_taken_port(self):
        for address in ("0.0.0.0:0", "192.0.2.1:9464", "example.com:9464", "127.0.0.1", "127.0.0.1:70000", ":9464"):
            done = subprocess.run([VARIMESHD, "--listen", "127.0.0.1:0", "--admin", address], capture_output=True,
                                  text=True, timeout=20)
            self.assertEqual(done.returncode, 2, address)
            self.assertIn("loopback", done.stderr)
        taken = subprocess.run([VARIMESHD, "--listen", "127.0.0.1:0", "--admin", self.admin], capture_output=True,
                               text=True, timeout=20)
        self.assertEqual(taken.returncode, 1)
        self.assertIn("is taken", taken.stderr)

    def test_returns_the_iterations_after_a_given_event(self):
        job = self.submit("circle_p5.msh", *ENDLESS)
        rows, sequence = [], 0
        deadline = time.monotonic() + 30
        while len(rows) < 20:
            self.assertLess(time.monotonic(), deadline)
            answer = json.loads(self.ask(f"/api/iterations?job={job}&after={sequence}")[2])
            self.assertGreaterEqual(answer["sequence"], sequence)
            sequence = answer["sequence"]
            rows += answer["iterations"]
            time.sleep(0.05)
        numbers = [row[0] for row in rows]
        self.assertEqual(numbers, sorted(set(numbers)))
        self.assertEqual({row[1] for row in rows}, {"sweeps"})
        run("cancel", job, "--server", self.server.address)


class Tokens(WithAdminPort):
    """The same rules as for calls: who has no token gets nothing about jobs, and others' jobs are not there."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        file = Path(folder.name) / "tokens"

        def make(name, *roles):
            flags = [word for role in roles for word in ("--role", role)]
            return subprocess.run([VARIMESHD, "token", name, "--tokens", file, *flags], capture_output=True, text=True, timeout=20,
                                  check=True).stdout.strip()

        self.ann, self.bob, self.admin_token = make("ann"), make("bob"), make("operator", "admin")
        self.submitter = make("ann", "submit")
        self.FLAGS = ("--tokens", str(file))
        super().setUp()

    def ask_as(self, token, path):
        status, headers, body = self.ask(path, **({"Authorization": "Bearer " + token} if token else {}))
        return (status, json.loads(body)) if status == 200 else (status, headers)

    def test_callers_see_their_own_jobs(self):
        os.environ["VARIMESH_TOKEN"] = self.ann
        self.addCleanup(os.environ.pop, "VARIMESH_TOKEN")
        job = self.submit("circle_p5.msh", *ENDLESS)
        path = f"/api/iterations?job={job}&after=0"
        status, headers = self.ask_as("", "/api/status")
        self.assertEqual((status, headers["WWW-Authenticate"]), (401, "Bearer"))
        self.assertEqual(self.ask_as("wrong", "/api/status")[0], 401)
        self.assertEqual(self.ask_as("", path)[0], 401)
        self.assertEqual(self.ask_as(self.submitter, "/api/status")[0], 403)
        for token, jobs, code in ((self.ann, [(job, "ann")], 200), (self.admin_token, [(job, "ann")], 200), (self.bob, [], 404)):
            shown = self.ask_as(token, "/api/status")[1]
            self.assertEqual([(one["job"], one["owner"]) for one in shown["jobs"]], jobs)
            self.assertEqual(self.ask_as(token, path)[0], code)
        self.assertEqual(self.ask("/")[0], 200, "the page itself says nothing")
        self.assertEqual(self.ask("/healthz/ready")[0], 200)
        run("cancel", job, "--server", self.server.address)


    def test_only_this_page_cancels_for_tokens_that_allow_it(self):
        os.environ["VARIMESH_TOKEN"] = self.ann
        self.addCleanup(os.environ.pop, "VARIMESH_TOKEN")
        job = self.submit("circle_p5.msh", *ENDLESS)
        path, port = f"/api/cancel?job={job}", self.admin.rsplit(":", 1)[1]
        own = {"Authorization": f"Bearer {self.ann}", "Origin": f"http://{self.admin}"}
        for why, status, changed in (
                ("no token", 401, {"Authorization": ""}), ("a wrong token", 401, {"Authorization": "Bearer wrong"}),
                ("no right to cancel", 403, {"Authorization": f"Bearer {self.submitter}"}),
                ("another owner", 404, {"Authorization": f"Bearer {self.bob}"}),
                ("no origin", 403, {"Origin": None}), ("no page", 403, {"Origin": "null"}),
                ("another site", 403, {"Origin": "http://evil.example"}),
                ("another port", 403, {"Origin": "http://127.0.0.1:1"}),
                ("another name of this machine", 403, {"Origin": f"http://localhost:{port}"}),
                ("another scheme", 403, {"Origin": f"https://{self.admin}"}),
                ("the browser says that it is another site", 403, {"Sec-Fetch-Site": "cross-site"}),
                ("a name that points here", 421, {"Host": f"evil.example:{port}", "Origin": f"http://evil.example:{port}"})):
            headers = {key: value for key, value in {**own, **changed}.items() if value is not None}
            self.assertEqual(self.ask(path, "POST", **headers)[0], status, why)
        self.assertEqual(self.ask(path, "GET", **own)[0], 405)
        self.assertEqual(self.ask(path, "OPTIONS", **own)[0], 405, "no other site may send the header with the token")
        self.assertNotIn(self.ask_as(self.ann, "/api/status")[1]["jobs"][0]["state"], ("cancelling", "cancelled"))
        self.assertEqual(self.ask(path, "POST", **own)[0], 204)
        deadline = time.monotonic() + 20
        while self.ask_as(self.ann, "/api/status")[1]["jobs"][0]["state"] != "cancelled":
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.2)
        self.assertRegex("".join(self.server.log), f"audit: cancel {job} by ann at 127.0.0.1: ok")


class TokenPage(Tokens):
    test_only_this_page_cancels_for_tokens_that_allow_it = None

    @classmethod
    def setUpClass(cls):
        if browser.find() is None:
            print("SKIPPED: chromium is not installed")
            sys.exit(77)

    def test_callers_see_their_own_jobs(self):
        os.environ["VARIMESH_TOKEN"] = self.ann
        self.addCleanup(os.environ.pop, "VARIMESH_TOKEN")
        job = self.submit("circle_p5.msh", *ENDLESS)
        page = browser.Page()
        self.addCleanup(page.close)
        page.open(f"http://{self.admin}/")
        page.wait("document.querySelectorAll('#token input').length === 1")
        self.assertIn("asks who calls", page.value("document.querySelector('#state').textContent"))
        page.value(f"document.querySelector('#token input').value = {json.dumps(self.ann)}")
        page.value("document.querySelector('#token button').click()")
        page.wait("document.querySelectorAll('#running .curve').length === 3")
        self.assertIn(job, page.value("document.querySelector('#running h3').textContent"))
        self.assertEqual(page.value("document.querySelectorAll('#token input').length"), 0)
        page.value("document.querySelector('#running .cancel').click()")
        page.wait("document.querySelector('#running .cancel')?.textContent === 'Click again to cancel'")
        page.value("document.querySelector('#running .cancel').click()")
        page.wait("document.querySelector('#ended tbody td.when')?.textContent === 'cancelled'")


class Page(WithAdminPort):
    @classmethod
    def setUpClass(cls):
        if browser.find() is None:
            print("SKIPPED: chromium is not installed")
            sys.exit(77)

    def setUp(self):
        super().setUp()
        self.page = browser.Page()
        self.addCleanup(self.page.close)

    def text(self, selector):
        return self.page.value(f"document.querySelector({json.dumps(selector)})?.textContent ?? ''")

    def test_shows_fifty_jobs_and_the_curves_of_the_running_one(self):
        running = self.submit("circle_p5.msh", *ENDLESS, "--label", "name=" + MARKUP)
        first = self.submit("nine_triangles.msh", "--label", "file=" + MARKUP)
        for _ in range(48):
            last = self.submit("nine_triangles.msh")
        self.page.open(f"http://{self.admin}/")
        self.page.wait("document.querySelectorAll('#waiting tbody tr').length === 49")
        self.page.wait("document.querySelectorAll('#running .job').length === 1")
        rows = self.page.value("[...document.querySelectorAll('#waiting tbody tr')].map((row) => row.children[1].textContent)")
        # The name of the file is above that of the job.
        self.assertEqual((rows[0], rows[-1]), (MARKUP + first, "nine_triangles.msh" + last))
        self.page.wait("document.querySelectorAll('#running .curve').length === 3")
        self.assertEqual(self.text("#running h3"), "circle_p5.msh" + running)
        self.assertEqual(self.text("#running .label"), "name=" + MARKUP)
        self.assertEqual(self.text("#waiting .file"), MARKUP)
        drawn = self.page.value("document.querySelector('#running .curve').getAttribute('d')")
        self.page.wait(f"document.querySelector('#running .curve')?.getAttribute('d') !== {json.dumps(drawn)}")
        self.page.look(390, 844, dark=True)
        self.assertLessEqual(self.page.value("document.documentElement.scrollWidth"), 390)

        run("cancel", running, "--server", self.server.address)
        self.page.wait("document.querySelectorAll('#ended tbody tr').length === 50", 60)
        states = self.page.value("[...document.querySelectorAll('#ended tbody tr')].map((row) => row.children[2].textContent)")
        self.assertEqual((states.count("succeeded"), states.count("cancelled")), (49, 1))
        self.assertIn("all elements certified valid", self.text("#ended tbody"))
        self.assertIn("No job is running", self.text("#running"))
        self.assertEqual(self.page.value("document.querySelectorAll('button').length"), 0, "nobody has a token")
        self.assertEqual(self.page.value("document.title"), "varimeshd")
        self.assertEqual(self.page.value("document.querySelectorAll('main img, main script').length"), 0)
        self.assertEqual(self.page.errors, [])
        hosts = {re.sub(r"^(\w+://[^/]*)/.*", r"\1", one) for one in self.page.requests if one.startswith("http")}
        self.assertEqual(hosts, {f"http://{self.admin}"})


if __name__ == "__main__":
    unittest.main()
