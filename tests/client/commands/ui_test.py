"""varimesh ui: the page of a server of the user's own, and how the browser gets its token."""
import json
import os
import re
import signal
import subprocess
import time
import unittest
import urllib.error
import urllib.request

from programs import VARIMESH, VARIMESHD, WithFolder, run


class Ui(WithFolder):
    def start(self, *arguments, **environment):
        self.process = subprocess.Popen([VARIMESH, "ui", *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
                                        env={**os.environ, "VARIMESHD": VARIMESHD, "DISPLAY": "", "WAYLAND_DISPLAY": "", **environment})
        self.addCleanup(lambda: (self.process.poll() is None and self.process.kill(), self.process.communicate()))
        address = self.process.stdout.readline().strip()
        found = re.fullmatch(r"(http://127\.0\.0\.1:\d+/)#token=([\w-]+)", address)
        self.assertTrue(found, address)
        return found.groups()

    def ask(self, address, token=None):
        request = urllib.request.Request(address + "v1/info", headers={"Authorization": f"Bearer {token}"} if token else {})
        try:
            return json.load(urllib.request.urlopen(request, timeout=20)), 200
        except urllib.error.HTTPError as error:
            return None, error.code

    def test_serves_a_page_to_whoever_has_the_token(self):
        address, token = self.start("--only-print")
        self.assertIn("<title>VariMesh</title>", urllib.request.urlopen(address, timeout=20).read().decode())
        self.assertEqual(self.ask(address)[1], 401)
        self.assertEqual(self.ask(address, "x" * len(token))[1], 401)
        self.assertEqual(self.ask(address, token)[1], 200)
        children = subprocess.run(["ps", "-ww", "-eo", "args"], capture_output=True, text=True, timeout=20).stdout
        self.assertNotIn(token, children, "all users of the machine see arguments")
        self.process.send_signal(signal.SIGINT)
        self.assertEqual(self.process.wait(40), 0)
        with self.assertRaises(urllib.error.URLError):
            urllib.request.urlopen(address, timeout=20)

    def test_its_server_ends_with_it_even_if_it_is_killed(self):
        for number, kill in ((signal.SIGKILL, os.kill), (signal.SIGHUP, os.kill), (signal.SIGTERM, os.kill), (signal.SIGHUP, os.killpg), (signal.SIGINT, os.killpg)):
            with self.subTest(number=number, kill=kill):  # A terminal sends its signals to all processes.
                self.check_end(number, kill)

    def check_end(self, number, kill):
        address, _ = self.start("--only-print", TMPDIR=str(self.folder))
        self.assertNotEqual(os.listdir(self.folder), [])
        kill(self.process.pid, number)
        self.process.wait(20)
        deadline = time.monotonic() + 30
        while True:
            try:
                urllib.request.urlopen(address, timeout=20)
            except OSError:
                break
            self.assertLess(time.monotonic(), deadline, "the server is still there")
            time.sleep(0.1)
        while left := os.listdir(self.folder):
            self.assertLess(time.monotonic(), deadline, left)
            time.sleep(0.1)

    def test_says_whether_its_jobs_end_with_it(self):
        for flags, environment, ends in (([], {}, True), (["--state", str(self.folder / "one")], {}, False), ([], {"VARIMESH_STATE": str(self.folder / "two")}, False)):
            self.start("--only-print", *flags, **environment)
            self.assertEqual("its jobs with it" in self.process.stderr.readline(), ends, (flags, environment))
            self.process.send_signal(signal.SIGINT)
            self.process.wait(40)
        self.assertEqual(sorted(os.listdir(self.folder)), ["one", "two"])

    def test_gives_the_browser_the_token_in_a_file(self):
        opener = self.folder / "xdg-open"
        opener.write_text(f'#!/bin/sh\necho "$@" > {self.folder}/arguments\nstat -c %a "$1" > {self.folder}/mode\ncat "$1" > {self.folder}/opened.part\n'
                          f'mv {self.folder}/opened.part {self.folder}/opened\n')
        opener.chmod(0o755)
        address, token = self.start(DISPLAY=":99", PATH=f"{self.folder}:{os.environ['PATH']}")
        deadline = time.monotonic() + 20
        while not (self.folder / "opened").exists():
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.02)
        self.assertIn(f"url={address}#token={token}\"", (self.folder / "opened").read_text())
        self.assertEqual((self.folder / "mode").read_text(), "600\n")
        self.assertNotIn(token, (self.folder / "arguments").read_text())
        self.process.send_signal(signal.SIGTERM)
        self.assertEqual(self.process.wait(40), 0)

    def test_says_why_the_server_does_not_start(self):
        (self.folder / "state").write_text("a file")
        done = run("ui", "--only-print", "--state", self.folder / "state", env={**os.environ, "VARIMESHD": VARIMESHD})
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn(str(self.folder / "state"), done.stderr)

    def test_page_of_another_server(self):
        done = run("ui", "--page", "http://127.0.0.1:8080/", "--only-print", env={**os.environ, "VARIMESH_TOKEN": "secret"})
        self.assertEqual((done.returncode, done.stdout), (0, "http://127.0.0.1:8080/\n"))
        for wrong in ("127.0.0.1:8080", "javascript:alert(1)", 'http://x/"><script>', "http://x/#token=y", "file:///etc/passwd"):
            self.assertEqual(run("ui", "--page", wrong, "--only-print").returncode, 2, wrong)

    def test_sends_no_token_unencrypted(self):
        for page in ("http://127.0.0.1.example/", "http://10.0.0.1:8080/", "http://localhost.example", "http://example/127.0.0.1/"):
            done = run("ui", "--page", page, "--only-print", env={**os.environ, "VARIMESH_TOKEN": "secret"})
            self.assertEqual((done.returncode, done.stdout), (2, ""), page)
            self.assertIn("https://", done.stderr)
        for page in ("https://mesh.example/", "http://localhost:8080/", "http://127.0.0.1", "http://[::1]:8080/"):
            self.assertEqual(run("ui", "--page", page, "--only-print").returncode, 0, page)

    def test_names_a_file_of_a_token_that_it_cannot_read(self):
        missing = self.folder / "no-token"
        done = run("ui", "--page", "http://127.0.0.1:8080/", "--only-print", env={**os.environ, "VARIMESH_TOKEN": "", "VARIMESH_TOKEN_FILE": str(missing)})
        self.assertNotEqual(done.returncode, 0)
        self.assertIn(str(missing), done.stderr)
        done = run("ui", "--page", "http://127.0.0.1:8080/", "--only-print", env={**os.environ, "VARIMESH_TOKEN": 'a"><b'})
        self.assertEqual(done.returncode, 2, done.stderr)

    def test_keeps_the_file_of_the_token_until_a_slow_browser_has_read_it(self):
        opener = self.folder / "xdg-open"
        opener.write_text(f'#!/bin/sh\n(sleep 5; cat "$1" > {self.folder}/read) > {self.folder}/log 2>&1 &\n')
        opener.chmod(0o755)
        process = subprocess.Popen([VARIMESH, "ui", "--page", "http://127.0.0.1:8080/"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                   env={**os.environ, "VARIMESH_TOKEN": "secret", "DISPLAY": ":99", "PATH": f"{self.folder}:{os.environ['PATH']}"})
        self.addCleanup(lambda: (process.poll() is None and process.kill(), process.communicate()))
        self.assertIn("If no browser opens", process.stderr.readline())
        time.sleep(6)
        self.assertIn("#token=secret", (self.folder / "read").read_text())
        process.send_signal(signal.SIGINT)
        self.assertEqual(process.wait(20), 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
