"""What the tests of --http share: a server, and ways to ask it. ctest sets VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR."""
import http.client
import json
import os
import re
import socket
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(os.environ["VARIMESH_SOURCE_DIR"]) / "tests" / "client"))
from programs import MESH, Server, WithFolder, run

JSON = {"Content-Type": "application/json"}
UNKNOWN = "jobs/" + "0" * 32
# Every call, as a method and a path; JOB stands for the number of a job.
CALLS = [("GET", "/v1/info"), ("POST", "/v1/jobs"), ("GET", "/v1/jobs"), ("GET", "/v1/jobs/JOB"), ("POST", "/v1/jobs/JOB/cancel"),
         ("DELETE", "/v1/jobs/JOB"), ("GET", "/v1/jobs/JOB/result"), ("GET", "/v1/jobs/JOB/mesh"), ("GET", "/v1/jobs/JOB/events?after=99999999999"), ("POST", "/v1/meshes?digest=" + "0" * 64),
         ("GET", "/v1/uploads/one?digest=" + "0" * 64)]
DOCUMENT = ("GET", "/v1/openapi.json")
BYTES = {"Content-Type": "application/octet-stream"}


class WithHttp(WithFolder):
    def setUp(self):
        super().setUp()
        self.addCleanup(lambda: self.server.process.poll() is None and self.server.stop())
        self.start()

    def start(self, *more):
        """Starts a server."""
        self.server = Server("--http", "127.0.0.1:0", "--threads", "1", *self.flags(), *more)
        deadline = time.monotonic() + 20
        while not (found := re.search(r"http://(127\.0\.0\.1:\d+)/v1/", "".join(self.server.log))):
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.01)
        self.http = found[1]

    def flags(self):
        return ()

    def ask(self, method, path, body=None, headers=None, raw=False):
        """Returns the code, the JSON and, if wanted, the headers of an answer."""
        connection = http.client.HTTPConnection(self.http, timeout=30)
        self.addCleanup(connection.close)
        text = body if body is None or isinstance(body, (str, bytes)) else json.dumps(body)
        connection.request(method, path, text, (JSON if body is not None else {}) if headers is None else headers)
        answer = connection.getresponse()
        if answer.status != 204:
            self.assertEqual(answer.headers["Content-Type"], "application/json")
        document = json.loads(answer.read() or "{}")
        return (answer.status, document, answer.headers) if raw else (answer.status, document)

    def reason(self, method, path, *arguments, **keywords):
        """Returns the code of a refusal and its reason."""
        code, document = self.ask(method, path, *arguments, **keywords)
        self.assertGreaterEqual(code, 400, document)
        self.assertTrue(document["message"], document)
        return code, document.get("details", [{}])[0].get("reason")

    def send(self, text, seconds=20):
        """Sends bytes as they are, and returns what comes until the server closes."""
        host, port = self.http.rsplit(":", 1)
        with socket.create_connection((host, int(port)), seconds) as connection:
            connection.sendall(text)
            came = b""
            while piece := connection.recv(65536):
                came += piece
        return came

    def submit(self, mesh=MESH, *options, env=None):
        """Submits a job by the command and returns its number."""
        done = run("submit", mesh, *options, "--server", self.server.address, env=env)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout.split()[0].removeprefix("jobs/")

    def wait(self, job, *states, headers=None):
        deadline = time.monotonic() + 40
        while (found := self.ask("GET", f"/v1/jobs/{job}", headers=headers or {})[1]["job"])["state"] not in states:
            self.assertLess(time.monotonic(), deadline, found)
            time.sleep(0.02)
        return found

    def still_answers(self):
        self.assertEqual(self.ask("GET", "/v1/info")[0] in (200, 401), True)
