"""What is special to the port of --https: who gets a connection, and what slow ones cost others. The tests of --http run on it as
well (VARIMESH_TEST_TLS). ctest runs it with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in the environment."""
import contextlib
import http.client
import os
import re
import resource
import shutil
import socket
import ssl
import subprocess
import time
import unittest
from pathlib import Path

os.environ["VARIMESH_TEST_TLS"] = "1"
from over_http import CALLS, WithHttp
from programs import ENDLESS, LARGER, MESH, VARIMESHD, run


def listening_ports(process):
    """The ports of 127.0.0.1 at which a process listens."""
    inodes = set()
    for file in Path(f"/proc/{process}/fd").iterdir():
        with contextlib.suppress(OSError):
            inodes.add(os.readlink(file))
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    return {int(row[1].split(":")[1], 16) for row in rows if row[3] == "0A" and f"socket:[{row[9]}]" in inodes}


class Https(WithHttp):
    def trusting(self, **more):
        """A client's context. `more`: what is special to it."""
        made = ssl.create_default_context(cafile=self.folder / "certificates" / "authority.pem")
        for name, value in more.items():
            setattr(made, name, value)
        return made

    def shake(self, context, name="127.0.0.1"):
        """The version of TLS that a client of this context gets."""
        host, port = self.http.rsplit(":", 1)
        with socket.create_connection((host, int(port)), 10) as plain, context.wrap_socket(plain, server_hostname=name) as connection:
            return connection.version()

    def test_versions(self):
        old = self.trusting()
        old.set_ciphers("ALL:@SECLEVEL=0")
        self.assertEqual(self.shake(self.trusting(maximum_version=ssl.TLSVersion.TLSv1_2)), "TLSv1.2")
        self.assertEqual(self.shake(self.trusting()), "TLSv1.3")
        for version in (ssl.TLSVersion.TLSv1, ssl.TLSVersion.TLSv1_1):
            old.minimum_version = old.maximum_version = version
            with self.assertRaises((ssl.SSLError, ConnectionError), msg=version):
                self.shake(old)
        self.still_answers()

    def test_with_curl(self):
        if shutil.which("curl") is None:
            self.skipTest("there is no curl")
        other = self.folder / "other"
        self.assertEqual(run("certificates", other).returncode, 0)

        def curl(address, authority):
            done = subprocess.run(["curl", "-sS", "--fail-with-body", "--cacert", authority, address], capture_output=True, text=True, timeout=30)
            return done.returncode, done.stdout

        own = self.folder / "certificates" / "authority.pem"
        self.assertEqual(curl(f"{self.url}/v1/info", own)[0], 0)
        self.assertEqual(curl(f"https://localhost:{self.http.rsplit(':')[1]}/", own)[0], 0)
        code, answer = curl(f"{self.url}/v1/info", other / "authority.pem")  # of the same name, with another key
        self.assertIn(code, (35, 60))
        self.assertEqual(answer, "")
        self.assertEqual(curl(f"{self.url}/v1/info", "/etc/ssl/certs/ca-certificates.crt"), (60, ""))
        plain = curl(f"http://{self.http}/v1/info", own)
        self.assertIn(plain[0], (52, 56))  # no answer, or a reset
        self.assertEqual(plain[1], "")

    def test_slow_handshakes_hold_nobody_up(self):
        host, port = self.http.rsplit(":", 1)
        wrapped, out = ssl.MemoryBIO(), ssl.MemoryBIO()
        client = self.trusts.wrap_bio(wrapped, out, server_hostname=host)
        with contextlib.suppress(ssl.SSLWantReadError):
            client.do_handshake()
        hello, slow = out.read(), []
        for i in range(200):
            one = socket.create_connection((host, int(port)), 20)
            self.addCleanup(one.close)
            one.sendall((b"", hello[:-1], hello, b"\x16")[i % 4])
            slow.append(one)
        begun = time.monotonic()
        for _ in range(5):
            asked = time.monotonic()
            self.assertEqual(self.ask("GET", "/v1/info")[0], 200)
            self.assertLess(time.monotonic() - asked, 5, "it does not wait for the ten seconds of a handshake")
        for one in slow:  # each is closed after ten seconds
            one.settimeout(30)
            with contextlib.suppress(ConnectionError):
                while one.recv(65536):
                    pass
        self.assertLess(time.monotonic() - begun, 30, "all at once, not one after another")

    def test_one_address_does_not_take_all_connections(self):
        host, port = self.http.rsplit(":", 1)
        other = socket.socket()
        other.bind(("127.0.0.2", 0))
        kept = [socket.create_connection((host, int(port)), 20) for _ in range(300)]
        for one in kept:
            self.addCleanup(one.close)
        deadline = time.monotonic() + 20
        while (closed := sum(self.is_closed(one) for one in kept)) < 300 - 256:
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.02)
        self.assertEqual(closed, 300 - 256)
        other.settimeout(10)
        other.connect((host, int(port)))
        with self.trusts.wrap_socket(other, server_hostname=host) as connection:
            connection.sendall(b"GET /v1/info HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
            self.assertIn(b" 200 ", connection.recv(65536))

    def test_descriptors_behind_connections_leave_some_of_the_reserve(self):
        """A connection takes a second descriptor with its first byte, and the server behind a third."""
        process, descriptors = self.server.process.pid, Path(f"/proc/{self.server.process.pid}/fd")
        limit = (len(list(descriptors.iterdir())) + 60) * 4 // 3  # room for about 60 connections, and a reserve
        resource.prlimit(process, resource.RLIMIT_NOFILE, (limit, resource.prlimit(process, resource.RLIMIT_NOFILE)[1]))
        host, port = self.http.rsplit(":", 1)
        kept = []
        with contextlib.suppress(OSError):  # the last one is refused
            for i in range(60):  # an address may have half of the room
                plain = socket.create_connection((host, int(port)), 20, source_address=(f"127.0.0.{2 + i % 4}", 0))
                self.addCleanup(plain.close)
                kept.append(self.trusts.wrap_socket(plain, server_hostname=host))
        self.assertGreater(len(kept), 40)
        for one in kept:
            one.sendall(b"GET /v1/info HTTP/1.1\r\nHost: ")
        most, end = 0, time.monotonic() + 1
        while time.monotonic() < end:
            most = max(most, len(list(descriptors.iterdir())))
        self.assertLess(most, limit - max(32, limit // 4) // 8)
        for one in kept:
            one.close()
        deadline = time.monotonic() + 20
        while len(list(descriptors.iterdir())) > limit // 2:
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.02)
        self.still_answers()

    def is_closed(self, connection):
        connection.settimeout(0)
        try:
            return connection.recv(1) == b""
        except BlockingIOError:
            return False
        except ConnectionError:
            return True

    def test_whoever_reads_nothing_costs_little(self):
        """The server keeps little for each of them, and gives them up."""
        def memory():
            return int(re.search(r"VmRSS:\s+(\d+) kB", Path(f"/proc/{self.server.process.pid}/status").read_text())[1]) / 1024

        whole = len(self.send(b"GET /three.js HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"))
        before, slow = memory(), []
        for _ in range(100):
            one = self.dial(room=4096)
            one.sendall(b"GET /three.js HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
            slow.append(one)
        begun = time.monotonic()
        self.assertEqual(self.ask("GET", "/v1/info")[0], 200)
        self.assertLess(time.monotonic() - begun, 10)
        self.assertLess(memory() - before, 64)
        time.sleep(33)
        self.assertEqual(sum(self.rest(one) < whole for one in slow), 100)

    def rest(self, connection):
        """How many bytes come until a connection ends."""
        came = 0
        with contextlib.suppress(OSError):
            while piece := connection.recv(65536):
                came += len(piece)
        return came

    def test_pages_with_another_scheme_are_other_sites(self):
        self.assertEqual(self.ask("GET", "/v1/info", headers={"Origin": self.url})[0], 200)
        self.assertEqual(self.ask("GET", "/v1/info", headers={"Origin": f"http://{self.http}"})[0], 403)

    def test_the_port_behind_answers_nobody_else(self):
        host, port = self.http.rsplit(":", 1)
        behind = listening_ports(self.server.process.pid) - {int(port), int(self.server.address.rsplit(":", 1)[1])}
        self.assertEqual(len(behind), 1)
        watcher = self.dial()  # somebody is connected meanwhile
        watcher.sendall(b"GET /v1/info HTTP/1.1\r\n")
        for source in ("127.0.0.1", "127.1.0.0", "127.1.0.1", "127.1.0.2"):
            for method, path in (*CALLS, ("GET", "/")):
                connection = http.client.HTTPConnection("127.0.0.1", behind.copy().pop(), timeout=10, source_address=(source, 0))
                self.addCleanup(connection.close)
                connection.request(method, path.replace("JOB", "0" * 32))
                answer = connection.getresponse()
                self.assertEqual((answer.status, b"the server itself" in answer.read()), (503, True), (source, path))

    def test_certificates_that_change(self):
        job = self.submit(LARGER, *ENDLESS)
        watch = self.dial(60)
        watch.sendall(f"GET /v1/jobs/{job}/events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
        self.assertIn(b" 200 ", watch.recv(4096))

        def serial():
            host, port = self.http.rsplit(":", 1)
            with socket.create_connection((host, int(port)), 10) as plain, self.trusts.wrap_socket(plain, server_hostname=host) as connection:
                return connection.getpeercert()["serialNumber"]

        before = serial()
        self.assertEqual(run("certificates", self.folder / "certificates").returncode, 0)
        deadline = time.monotonic() + 20
        while serial() == before:
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.2)
        (self.folder / "certificates" / "server.pem").write_text("nothing")  # a broken file changes nothing
        now = serial()
        time.sleep(4)
        self.assertEqual(serial(), now)
        self.ask("POST", f"/v1/jobs/{job}/cancel")
        came = b""
        while piece := watch.recv(65536):
            came += piece
        self.assertIn(b"JOB_STATE_CANCELLED", came, "an open watch goes on")


class Names(WithHttp):
    """The names by which the server may be called: those in its certificate, and those of its machine."""

    def flags(self):
        self.assertEqual(run("certificates", self.folder / "certificates", "--host", "mesh.example.org", "--host", "10.1.2.3").returncode, 0)
        return ()

    def test_hosts(self):
        for host in ("mesh.example.org", "mesh.example.org:8443", "10.1.2.3", "127.0.0.1", "localhost:1"):
            self.assertEqual(self.code(host), 200, host)
        for host in ("evil.example", "x.mesh.example.org", "mesh.example.org.evil.example", "10.1.2.4", "mesh.example.org,evil.example", "", "[::2]", "*"):
            self.assertEqual(self.code(host), 421, host)

    def code(self, host):
        with self.dial() as connection:
            connection.sendall(f"GET /v1/info HTTP/1.1\r\nHost: {host}\r\n\r\n".encode())
            return int(connection.recv(65536).split()[1])

    def certificates(self):
        flags = super().certificates()
        self.trusts.check_hostname = False  # the test knows where it calls
        return flags


class Mutual(WithHttp):
    """A server whose callers have certificates."""

    def certificates(self):
        folder = self.folder / "certificates"
        if not folder.exists():
            self.assertEqual(run("certificates", folder, "--client", "ann", "--client", "bob").returncode, 0)
        flags = super().certificates()
        self.context = {}
        for name in ("ann", "bob", None):
            self.context[name] = ssl.create_default_context(cafile=folder / "authority.pem")
            if name:
                self.context[name].load_cert_chain(folder / f"{name}.pem", folder / f"{name}-key.pem")
        self.trusts = self.context["ann"]
        os.environ.update(VARIMESH_TLS_CERTIFICATE=str(folder / "ann.pem"), VARIMESH_TLS_KEY=str(folder / "ann-key.pem"))
        self.addCleanup(lambda: [os.environ.pop("VARIMESH_TLS_" + name, None) for name in ("CERTIFICATE", "KEY")])
        return (*flags, "--tls-authority", str(folder / "authority.pem"))

    def flags(self):
        return ("--http", "127.0.0.1:0")

    def as_(self, name):
        self.trusts = self.context[name]

    def test_owners(self):
        job = self.submit(LARGER, *ENDLESS)
        known = self.ask("GET", f"/v1/jobs/{job}")[1]["job"]
        self.as_("bob")
        for method, path in CALLS[3:9]:
            self.assertEqual(self.ask(method, path.replace("JOB", job))[0], 404, (method, path))
        self.assertEqual(self.ask("GET", "/v1/jobs")[1], {})
        self.assertEqual(self.reason("POST", "/v1/jobs", known["spec"]), (400, "MESH_NOT_FOUND"))
        self.as_("ann")
        self.assertEqual(self.ask("POST", f"/v1/jobs/{job}/cancel")[0], 200)
        self.wait(job, "JOB_STATE_CANCELLED")
        self.server.stop()
        lines = [line for line in self.server.log if f"cancel jobs/{job[:16]}" in line and "audit" in line]
        for name, outcome in (("bob", "JOB_NOT_FOUND"), ("ann", "ok")):
            self.assertEqual(len([line for line in lines if f"by {name} at 127.0.0.1: {outcome}" in line]), 1, lines)

    def test_nobody_without_a_certificate(self):
        self.as_(None)
        with self.assertRaises(OSError):
            self.ask("GET", "/v1/info")
        stranger = self.folder / "stranger"
        self.assertEqual(run("certificates", stranger, "--client", "ann").returncode, 0)
        self.context["stranger"] = ssl.create_default_context(cafile=self.folder / "certificates" / "authority.pem")
        self.context["stranger"].load_cert_chain(stranger / "ann.pem", stranger / "ann-key.pem")
        self.as_("stranger")
        with self.assertRaises(OSError):
            self.ask("GET", "/v1/info")
        self.as_("ann")
        self.assertEqual(self.ask("GET", "/v1/info")[0], 200)

    def test_the_plain_port_knows_nobody(self):
        deadline = time.monotonic() + 20
        while not (found := re.search(r"http://(127\.0\.0\.1:\d+)/v1/", "".join(self.server.log))):
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.01)
        for header in ({}, {"varimesh-certificate-bin": "YW5u"}, {"X-Client-Name": "ann"}):
            connection = http.client.HTTPConnection(found[1], timeout=10)
            self.addCleanup(connection.close)
            connection.request("GET", "/v1/jobs", headers=header)
            self.assertEqual(connection.getresponse().status, 401)


class Starting(WithHttp):
    def start(self, *more):
        self.flags_of_tls = self.certificates()

    def setUp(self):
        self.server = None
        super().setUp()

    def refuse(self, *flags):
        done = subprocess.run([VARIMESHD, "--listen", "127.0.0.1:0", *flags], capture_output=True, text=True, timeout=20)
        self.assertEqual(done.returncode, 2, done.stderr)
        return done.stderr

    def test_what_it_needs(self):
        self.assertIn("--tls-certificate", self.refuse("--https", "127.0.0.1:0"))
        self.assertIn("--tokens", self.refuse("--https", "0.0.0.0:0", *self.flags_of_tls))
        for address in ("8443", ":8443x", "127.0.0.1:99999", f"unix:{self.folder}/socket"):
            self.assertIn("HOST:PORT", self.refuse("--https", address, *self.flags_of_tls), address)
        with socket.create_server(("127.0.0.1", 0)) as taken:
            address = f"127.0.0.1:{taken.getsockname()[1]}"
            done = subprocess.run([VARIMESHD, "--listen", "127.0.0.1:0", "--https", address, *self.flags_of_tls], capture_output=True, text=True,
                                  timeout=20)
            self.assertEqual(done.returncode, 1)
            self.assertIn(address, done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
