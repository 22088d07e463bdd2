"""What the port of --http refuses: bodies, addresses, and pages of other sites.
ctest runs it with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in the environment."""
import subprocess
import time
import unittest

from over_http import CALLS, DOCUMENT, JSON, UNKNOWN, WithHttp
from programs import VARIMESHD


class Refusals(WithHttp):
    def test_bodies_that_are_no_job(self):
        for what, body in (("no JSON", "{"), ("an unknown field", '{"mash": {}}'), ("a wrong type", '{"mesh": 5}'), ("a list", "[]"),
                           ("nothing", ""), ("text that is not UTF-8", b'{"labels": {"a": "\xff"}}'), ("deep nesting", "[" * 100000),
                           ("deep objects", '{"a":' * 100000), ("a large number", '{"options": {"maxIterations": 1e400}}'),
                           ("NaN", '{"options": {"tolerance": NaN}}'), ("NUL", b'{"labels": {"a\0": "b"}}')):
            with self.subTest(what):
                self.assertEqual(self.ask("POST", "/v1/jobs", body)[0], 400, what)
        for type in ("text/plain", "application/x-www-form-urlencoded", "multipart/form-data", "", "application/jsonx"):
            self.assertIn("Content-Type", self.ask("POST", "/v1/jobs", "{}", {"Content-Type": type})[1]["message"])
        self.assertEqual(self.ask("POST", "/v1/jobs", "{}", {"Content-Type": "application/json; charset=utf-8"})[1]["code"], 3)
        self.still_answers()

    def test_a_body_that_is_too_large_is_not_read(self):
        head = b"POST /v1/jobs HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\nContent-Length: %d\r\n\r\n"
        begun = time.monotonic()
        for size in ((4 << 20) + 1, 1 << 40, (1 << 63) - 1):
            self.assertIn(b"400 Bad Request", self.send(head % size), size)
        self.assertLess(time.monotonic() - begun, 10)
        self.assertNotIn(b" 200 ", self.send(head.replace(b"%d", b"-1")))
        self.assertNotIn(b" 200 ", self.send(head.replace(b"%d", b"99999999999999999999999")))
        self.assertNotIn(b" 200 ", self.send(head.replace(b"Content-Length: %d", b"Transfer-Encoding: chunked") + b"2\r\n{}\r\n0\r\n\r\n"))
        self.still_answers()

    def test_other_methods(self):
        for method in ("PUT", "PATCH", "DELETE", "OPTIONS"):
            code, document, headers = self.ask(method, "/v1/jobs", raw=True)
            self.assertEqual((code, headers["Allow"]), (405, "GET, POST"), method)
            self.assertIn("GET, POST", document["message"])
        self.assertEqual(self.ask("GET", f"/v1/{UNKNOWN}/cancel")[0], 405)
        self.assertEqual(self.ask("POST", "/v1/info", {})[0], 405)

    def test_tricks_with_the_path(self):
        for path in ("/v1", "/v1/", "/v1/jobsx", "/v2/jobs", "/etc/passwd", "/v1/jobs/../../../etc/passwd",
                     "/v1/jobs/%2e%2e%2f%2e%2e%2fetc/passwd", "/v1/jobs/", "/v1/jobs//", "/v1/jobs/%00", "/v1/jobs/a%0d%0ab", "//etc/passwd",
                     "/v1/jobs/" + "a" * 10000, "/v1/jobs/%ff%fe", f"/v1/{UNKNOWN}/cancel/more"):
            with self.subTest(path):
                came = self.send(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
                self.assertRegex(came, rb"^HTTP/1.1 40[04] ", came[:100])
                self.assertNotIn(b"root:", came)
        self.assertEqual(self.ask("GET", "/v1/jobs?" + "&".join(["states=JOB_STATE_RUNNING"] * 200))[0], 400)
        self.assertEqual(self.ask("GET", "/v1/jobs?pageSize=12x")[0], 400)
        self.assertEqual(self.ask("GET", "/v1/jobs?states=RUN")[0], 400)
        self.assertEqual(self.ask("GET", "/v1/jobs?owner=bob")[0], 400)
        self.assertEqual(self.ask("POST", "/v1/jobs?validateOnly=maybe", {})[0], 400)
        self.still_answers()

    def test_pages_of_other_sites(self):
        for method, path in (*CALLS, DOCUMENT):
            path = path.replace("JOB", "0" * 32)
            for headers in ({"Origin": "http://evil.example"}, {"Origin": "null"}, {"Origin": "http://127.0.0.1:1"},
                            {"Sec-Fetch-Site": "cross-site"}, {"Sec-Fetch-Site": "same-site"}):
                self.assertEqual(self.ask(method, path, "{}", {**JSON, **headers})[0], 403, (method, path, headers))
            for host in ("evil.example", "evil.example:80", "127.0.0.1.evil.example", "10.0.0.1", "localhost.evil.example", ""):
                self.assertEqual(self.ask(method, path, "{}", {**JSON, "Host": host})[0], 421, (method, path, host))
        self.assertIn(b" 421 ", self.send(b"GET /v1/info HTTP/1.0\r\n\r\n"))
        for headers in ("Origin: http://127.0.0.1\r\nOrigin: http://evil.example", "Origin:", "Origin: http://\xff", "Sec-Fetch-Site: x\xff",
                        "Sec-Fetch-Site: none\r\nSec-Fetch-Site: cross-site"):
            came = self.send(f"GET /v1/info HTTP/1.1\r\nHost: 127.0.0.1\r\n{headers}\r\n\r\n".encode("latin-1"))
            self.assertIn(b" 403 ", came, headers)
        self.assertIn(b" 421 ", self.send(b"GET /v1/info HTTP/1.1\r\nHost: 127.0.0.1\r\nHost: evil.example\r\n\r\n"))
        own = {"Origin": self.url, "Sec-Fetch-Site": "same-origin"}
        self.assertEqual(self.ask("GET", "/v1/info", headers=own)[0], 200)

    def test_slow_clients_do_not_hold_others_up(self):
        slow = []
        self.addCleanup(lambda: [one.close() for one in slow])
        for i in range(40):
            slow.append(self.dial(20))
            slow[-1].sendall((b"", b"POST /v1/jobs HTTP/1.1\r\nHost: ", b"POST /v1/jobs HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: "
                              b"application/json\r\nContent-Length: 1000\r\n\r\n{")[i % 3])
        for _ in range(5):
            begun = time.monotonic()
            self.assertEqual(self.ask("GET", "/v1/info")[0], 200)
            self.assertLess(time.monotonic() - begun, 5)
        codes = [one.recv(4096).split(b" ")[1] for one in slow[2::3]]
        self.assertEqual((codes.count(b"400"), codes.count(b"429")), (4, 9), "four bodies were waited for, and given up")

    def test_addresses_that_others_reach(self):
        for address in ("0.0.0.0:0", "10.0.0.1:80", "8080", ":8080", "example.org:80"):
            done = subprocess.run([VARIMESHD, "--listen", "127.0.0.1:0", "--http", address], capture_output=True, text=True, timeout=20)
            self.assertEqual(done.returncode, 2, address)
            self.assertIn("--http 127.0.0.1:8080", done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
