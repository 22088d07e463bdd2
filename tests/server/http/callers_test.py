"""Who may call what over HTTP (--http): the same callers as by gRPC.
ctest runs it with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in the environment."""
import json
import os
import subprocess
import time
import unittest

from over_http import CALLS, DOCUMENT, JSON, WithHttp
from programs import ENDLESS, LARGER, MESH, VARIMESHD


class WithCallers(WithHttp):
    """A server with tokens of several callers."""

    def flags(self):
        self.tokens = self.folder / "tokens"
        self.token = {}
        for name, owner, *roles in (("ann", "ann"), ("bob", "bob"), ("reader", "ann", "--role", "read"),
                                    ("submitter", "ann", "--role", "submit"), ("operator", "operator", "--role", "admin")):
            self.token[name] = subprocess.run([VARIMESHD, "token", owner, "--tokens", self.tokens, *roles], capture_output=True, text=True,
                                              timeout=20).stdout.strip()
        return ("--tokens", str(self.tokens))

    def of(self, name):
        return {**JSON, "Authorization": "Bearer " + self.token[name]}


class Callers(WithCallers):
    def submit_as(self, name):
        return self.submit(LARGER, *ENDLESS, env={**os.environ, "VARIMESH_TOKEN": self.token[name]})

    def test_nobody_without_a_token(self):
        for method, path in (*CALLS, DOCUMENT):
            for headers in ({}, {"Authorization": "Bearer x"}, {"Authorization": "Basic YTpi"}, {"Authorization": b"Bearer \xff\xfe"},
                            {"Authorization": "Bearer " + "a" * 9000}, {"Cookie": "token=" + self.token["ann"]}):
                code, reason = self.reason(method, path.replace("JOB", "0" * 32), "{}", {**JSON, **headers})
                self.assertEqual(code, 401, (method, path, headers))
                self.assertIn(reason, ("TOKEN_MISSING", "TOKEN_UNKNOWN"))
        self.assertEqual(self.ask("GET", "/v1/info", raw=True)[2]["WWW-Authenticate"], "Bearer")
        self.assertEqual(self.ask("GET", "/v1/info", headers=self.of("ann"))[0], 200)

    def test_a_body_is_not_read_before_its_caller_is_known(self):
        head = b"POST /v1/jobs HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\nContent-Length: 4000000\r\n\r\n"
        begun = time.monotonic()
        with self.dial(20) as connection:
            connection.sendall(head)
            self.assertIn(b" 401 ", connection.recv(65536), "no byte of the body has come")
        self.assertLess(time.monotonic() - begun, 5)

    def test_roles(self):
        job = self.submit_as("ann")
        sends = {CALLS[1], *CALLS[9:]}
        reads = {(method, path) for method, path in CALLS if method == "GET"} - sends
        for name, allowed in (("reader", reads), ("submitter", sends)):
            for method, path in CALLS[1:]:
                code, reason = self.ask(method, path.replace("JOB", job), "{}" if method == "POST" else None, self.of(name))
                if (method, path) in allowed:
                    self.assertNotIn(code, (401, 403), (name, method, path))
                else:
                    self.assertEqual(code, 403, (name, method, path, reason))

    def test_a_form_needs_the_rights_to_submit_and_to_read(self):
        form = b'--x\r\nContent-Disposition: form-data; name="spec"\r\n\r\n{}\r\n--x\r\nContent-Disposition: form-data; name="mesh"\r\n\r\n'
        form += MESH.read_bytes() + b"\r\n--x--\r\n"
        for name, expected in (("reader", 403), ("submitter", 403), ("ann", 200)):
            headers = {**self.of(name), "Content-Type": "multipart/form-data; boundary=x"}
            self.assertEqual(self.ask("POST", "/v1/jobs", form, headers)[0], expected, name)
        self.assertEqual(len(self.ask("GET", "/v1/jobs", headers=self.of("ann"))[1]["jobs"]), 1)

    def test_the_jobs_of_others_are_not_there(self):
        job = self.submit_as("ann")
        known = self.ask("GET", f"/v1/jobs/{job}", headers=self.of("ann"))[1]["job"]
        for method, path in CALLS[3:9]:
            others = self.ask(method, path.replace("JOB", job), headers=self.of("bob"))
            nobodys = self.ask(method, path.replace("JOB", "0" * 32), headers=self.of("bob"))
            self.assertEqual(others[0], 404, (method, path))
            self.assertEqual(json.dumps(others[1]).replace(job, "JOB"), json.dumps(nobodys[1]).replace("0" * 32, "JOB"))
        self.assertEqual(self.ask("GET", "/v1/jobs", headers=self.of("bob"))[1], {})
        self.assertEqual(self.reason("POST", "/v1/jobs", known["spec"], self.of("bob")), (400, "MESH_NOT_FOUND"), "a digest is no right")
        self.assertEqual(len(self.ask("GET", "/v1/jobs", headers=self.of("operator"))[1]["jobs"]), 1)
        self.assertEqual(self.ask("POST", f"/v1/jobs/{job}/cancel", headers=self.of("operator"))[0], 200)

    def test_the_log_says_who_did_what(self):
        job = self.submit_as("ann")
        trace = "0af7651916cd43dd8448eb211c80319c"
        self.ask("POST", f"/v1/jobs/{job}/cancel", headers={**self.of("ann"), "traceparent": f"00-{trace}-b7ad6b7169203331-01"})
        self.wait(job, "JOB_STATE_CANCELLED", headers=self.of("ann"))
        self.server.stop()
        lines = [line for line in self.server.log if "audit" in line and "cancel" in line.lower()]
        self.assertEqual(len(lines), 1, self.server.log)
        for part in ("ann", "127.0.0.1", job):
            self.assertIn(part, lines[0])


if __name__ == "__main__":
    unittest.main(verbosity=2)
