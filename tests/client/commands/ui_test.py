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
        self.process = subprocess.Popen([VARIMESH, "ui", *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
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
        address, _ = self.start("--only-print", TMPDIR=str(self.folder))
        self.process.kill()
        self.process.wait(20)
        deadline = time.monotonic() + 30
        while True:
            try:
                urllib.request.urlopen(address, timeout=20)
            except OSError:
                break
            self.assertLess(time.monotonic(), deadline, "the server is still there")
            time.sleep(0.1)

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
            self.assertEqual(run("ui", "--page", wrong).returncode, 2, wrong)


if __name__ == "__main__":
    unittest.main(verbosity=2)
