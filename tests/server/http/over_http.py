"""What the tests of --http share: a server, and ways to ask it. ctest sets VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR. With
VARIMESH_TEST_TLS, all of it goes to the port of --https."""
import http.client
import json
import os
import re
import socket
import ssl
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(os.environ["VARIMESH_SOURCE_DIR"]) / "tests" / "client"))
from programs import MESH, Server, WithFolder, run

TLS = "VARIMESH_TEST_TLS" in os.environ
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
        self.addCleanup(lambda: self.server is not None and self.server.process.poll() is None and self.server.stop())
        self.start()

    def start(self, *more):
        """Starts a server."""
        self.server = Server("--https" if TLS else "--http", "127.0.0.1:0", "--threads", "1", *self.certificates(), *self.flags(), *more)
        deadline = time.monotonic() + 20
        scheme = "https" if TLS else "http"
        while not (found := re.search(scheme + r"://(127\.0\.0\.1:\d+)/v1/", "".join(self.server.log))):
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.01)
        self.http, self.url = found[1], f"{scheme}://{found[1]}"

    def certificates(self):
        """The flags of a server that encrypts. The command and curl trust its authority then."""
        if not TLS:
            return ()
        folder = self.folder / "certificates"
        if not folder.exists():
            done = run("certificates", folder)
            self.assertEqual(done.returncode, 0, done.stderr)
        os.environ["VARIMESH_TLS_AUTHORITY"] = os.environ["CURL_CA_BUNDLE"] = str(folder / "authority.pem")
        self.trusts = ssl.create_default_context(cafile=folder / "authority.pem")
        return "--tls-certificate", str(folder / "server.pem"), "--tls-key", str(folder / "server-key.pem")

    def connection(self, seconds=30):
        """A connection that speaks HTTP."""
        made = (http.client.HTTPSConnection(self.http, timeout=seconds, context=self.trusts) if TLS else
                http.client.HTTPConnection(self.http, timeout=seconds))
        self.addCleanup(made.close)
        return made

    def dial(self, seconds=20, room=None):
        """A connection for bytes as they are. `room`: how many the system may keep for it until they are read."""
        host, port = self.http.rsplit(":", 1)
        made = socket.socket()
        if room:
            made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, room)
        made.settimeout(seconds)
        made.connect((host, int(port)))
        made = self.trusts.wrap_socket(made, server_hostname=host) if TLS else made
        self.addCleanup(made.close)
        return made

    def flags(self):
        return ()

    def ask(self, method, path, body=None, headers=None, raw=False):
        """Returns the code, the JSON and, if wanted, the headers of an answer."""
        connection = self.connection()
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
        with self.dial(seconds) as connection:
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
