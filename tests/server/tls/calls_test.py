"""Calls of a server that encrypts: who gets in and who does not, with the command and the Python client, and certificates that are
replaced while the server runs. ctest runs it with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in the environment."""
import importlib.util
import json
import os
import re
import socket
import ssl
import time
import unittest
import urllib.error
import urllib.request

from certificates_test import VARIABLES, as_client, as_server, environment, make
from programs import ENDLESS, LARGER, MESH, Server, WithFolder, run, start


class WithCertificates(WithFolder):
    """A server with mutual TLS."""

    def setUp(self):
        super().setUp()
        self.certificates, self.other = self.folder / "certificates", self.folder / "other"
        make(self.certificates, "--client", "ann", "--client", "bob")
        make(self.other, "--client", "ann")
        self.server = Server("--log-level", "info", "--threads", "1", *as_server(self.certificates))
        self.addCleanup(self.server.stop)

    def jobs(self, *flags, address=None, **variables):
        return run("jobs", "--json", "--server", address or self.server.address, *flags, env=environment(**variables))


class Calling(WithCertificates):
    def test_the_right_certificates_work(self):
        done = run("optimise", MESH, "-o", self.folder / "out.msh", "--server", self.server.address,
                   *as_client(self.certificates, "ann"), env=environment())
        self.assertEqual(done.returncode, 0, done.stderr)
        flags = as_client(self.certificates, "ann")
        self.assertEqual(self.jobs(*flags, address=f"https://{self.server.address}/").returncode, 0)
        port = self.server.address.rsplit(":", 1)[1]
        self.assertEqual(self.jobs(*flags, address=f"localhost:{port}").returncode, 0)
        variables = dict(zip(("VARIMESH_TLS_AUTHORITY", "VARIMESH_TLS_CERTIFICATE", "VARIMESH_TLS_KEY"), map(str, flags[1::2])))
        self.assertEqual(self.jobs(**variables).returncode, 0)
        self.assertEqual(run("doctor", "--server", self.server.address, *flags, env=environment()).returncode, 0)

    def test_all_others_are_refused(self):
        make(self.folder / "expired", "--days", "0")
        mixed = [*as_client(self.certificates), *as_client(self.other, "ann")[2:]]
        (self.folder / "old").mkdir()
        for name in ("authority.pem", "authority-key.pem"):
            (self.folder / "old" / name).write_bytes((self.certificates / name).read_bytes())
        make(self.folder / "old", "--client", "ann", "--days", "0")
        theirs = f"The certificate of the server at {self.server.address} "
        ours = f"The server at {self.server.address} asks for a client's certificate that has not expired"
        for what, flags, says in (("no certificate", as_client(self.certificates), ours),
                                  ("wrong authority", as_client(self.other, "ann"), theirs),
                                  ("a certificate of another authority", mixed, ours),
                                  ("an expired certificate", as_client(self.folder / "old", "ann"), ours)):
            begin = time.monotonic()
            done = self.jobs(*flags)
            self.assertLess(time.monotonic() - begin, 5, what)
            self.assertEqual((done.returncode, done.stdout), (5, ""), what)
            self.assertIn(says, done.stderr, what)
            self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)  # nothing from gRPC itself

    def test_who_speaks_plainly_with_a_server_that_wants_tls_is_told_so_and_the_reverse(self):
        done = self.jobs()
        self.assertEqual((done.returncode, done.stdout), (5, ""))
        self.assertIn(f"The server at {self.server.address} wants TLS; name the authority", done.stderr)
        plain = Server()
        self.addCleanup(plain.stop)
        for flags, address in ((as_client(self.certificates, "ann"), plain.address), ([], f"https://{plain.address}")):
            done = self.jobs(*flags, address=address)
            self.assertEqual((done.returncode, done.stdout), (5, ""))
            self.assertIn(f"The server at {plain.address} speaks no TLS", done.stderr)
        with socket.create_server(("127.0.0.1", 0)) as silent:
            done = self.jobs(address=f"127.0.0.1:{silent.getsockname()[1]}")
            self.assertEqual(done.returncode, 5)
            self.assertIn("There is no server at", done.stderr)

    def test_a_certificate_for_another_host_is_refused(self):
        make(self.certificates, "--host", "example.org", "--host", "192.0.2.7")
        server = Server(*as_server(self.certificates))
        self.addCleanup(server.stop)
        done = self.jobs(*as_client(self.certificates, "client"), address=server.address)
        self.assertEqual((done.returncode, done.stdout), (5, ""))

    def test_only_new_versions_of_tls_are_spoken(self):
        host, port = self.server.address.rsplit(":", 1)

        def version(most):
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
            context.load_verify_locations(self.certificates / "authority.pem")
            context.load_cert_chain(self.certificates / "ann.pem", self.certificates / "ann-key.pem")
            context.set_ciphers("DEFAULT@SECLEVEL=0")
            context.minimum_version, context.maximum_version = ssl.TLSVersion.TLSv1, most
            context.set_alpn_protocols(["h2"])
            with socket.create_connection((host, int(port)), 10) as plain, context.wrap_socket(plain, server_hostname=host) as one:
                return one.version()

        self.assertEqual(version(ssl.TLSVersion.TLSv1_2), "TLSv1.2")
        self.assertEqual(version(ssl.TLSVersion.TLSv1_3), "TLSv1.3")
        with self.assertRaises((ssl.SSLError, ConnectionError)):
            version(ssl.TLSVersion.TLSv1_1)

    def test_the_owner_is_the_name_in_the_certificate(self):
        ann, bob = as_client(self.certificates, "ann"), as_client(self.certificates, "bob")
        done = run("submit", MESH, "--server", self.server.address, *ann, env=environment())
        self.assertEqual(done.returncode, 0, done.stderr)
        job = json.loads(self.jobs(*ann).stdout)["jobs"][0]
        self.assertEqual((job["job"], job["owner"]), (done.stdout.strip(), "ann"))
        self.assertEqual(json.loads(self.jobs(*bob).stdout), {"jobs": []})
        refused = run("cancel", job["job"], "--server", self.server.address, *bob, env=environment())
        self.assertEqual(refused.returncode, 2)
        self.assertIn("There is no job", refused.stderr)

    @unittest.skipUnless(importlib.util.find_spec("grpc"), "python3-grpcio is missing (deploy/setup test)")
    def test_reflection_answers_to_certificates(self):
        import grpc

        read = lambda name: (self.certificates / name).read_bytes()
        credentials = grpc.ssl_channel_credentials(read("authority.pem"), read("ann-key.pem"), read("ann.pem"))
        with grpc.secure_channel(self.server.address, credentials) as channel:
            call = channel.stream_stream("/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo")
            answers = list(call(iter([b"\x3a\x00"]), timeout=20))  # list_services
        self.assertIn(b"varimesh.v1.JobService", answers[0])

    def test_the_live_page_says_who_may_read_it(self):
        server = Server("--admin", "127.0.0.1:0", *as_server(self.certificates))
        self.addCleanup(server.stop)
        deadline = time.monotonic() + 20
        while not (found := re.search(r"http://(127\.0\.0\.1:\d+)/", "".join(server.log))):
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.01)
        with self.assertRaises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(f"http://{found[1]}/api/status", timeout=20)
        self.assertEqual(refused.exception.code, 403)
        self.assertIn("--tokens", refused.exception.read().decode())

    def wait_for_line(self, server, pattern):
        deadline = time.monotonic() + 30
        while not any(re.search(pattern, line) for line in server.log):
            self.assertLess(time.monotonic(), deadline, "".join(server.log))
            time.sleep(0.05)

    def test_a_file_that_is_broken_while_it_is_written_changes_nothing(self):
        server = Server("--log-level", "info", "--threads", "1", "--watchdog-seconds", "6", *as_server(self.certificates))
        self.addCleanup(lambda: server.process.poll() is None and server.stop())
        ann = as_client(self.certificates, "ann")
        for name in ("server.pem", "server-key.pem", "authority.pem"):
            path = self.certificates / name
            whole = path.read_bytes()
            path.write_bytes(whole[:len(whole) // 2])
            self.wait_for_line(server, f"{name}.*stay as they were")
            time.sleep(4)  # gRPC looks every two seconds
            if name != "authority.pem":  # which the client needs as well
                self.assertEqual(self.jobs(*ann, address=server.address).returncode, 0, name)
            path.write_bytes(whole)
            self.wait_for_line(server, "certificates were read again")
            server.log.clear()
        time.sleep(8)  # longer than the watchdog waits
        self.assertIsNone(server.process.poll(), "".join(server.log))
        self.assertEqual(self.jobs(*ann, address=server.address).returncode, 0)

    def test_certificates_are_replaced_while_watches_run(self):
        ann = as_client(self.certificates, "ann")
        name = run("submit", LARGER, *ENDLESS, "--active-set", "off", "--server", self.server.address, *ann,
                   env=environment()).stdout.strip()
        old = self.folder / "old"
        old.mkdir()
        for path in self.certificates.iterdir():
            (old / path.name).write_bytes(path.read_bytes())
        watches = [start("watch", name, "--server", self.server.address, *ann, env=environment())
                   for _ in range(50)]
        for watch in watches:
            self.addCleanup(watch.kill)
            self.assertTrue(watch.stderr.readline())
        for path in self.certificates.iterdir():
            path.unlink()
        make(self.certificates, "--client", "ann")
        deadline = time.monotonic() + 60
        while self.jobs(*as_client(self.certificates, "ann")).returncode != 0:
            self.assertLess(time.monotonic(), deadline)
        self.assertEqual(self.jobs(*as_client(old, "ann")).returncode, 5, "new connections see the new authority")
        for watch in watches:
            self.assertIsNone(watch.poll(), "open connections go on")
        new = as_client(self.certificates, "ann")
        self.assertEqual(run("cancel", name, "--server", self.server.address, *new, env=environment()).returncode, 0)
        for watch in watches:
            said = watch.communicate(timeout=60)[1]
            self.assertEqual(watch.returncode, 1, said)
            self.assertNotIn("not answering", said)


@unittest.skipUnless(importlib.util.find_spec("grpc"), "python3-grpcio is missing (deploy/setup test)")
class CallingFromPython(WithCertificates):
    def setUp(self):
        super().setUp()
        for name in VARIABLES:
            os.environ.pop("VARIMESH_" + name, None)
            self.addCleanup(os.environ.pop, "VARIMESH_" + name, None)

    def files(self, folder, name):
        return {"authority": folder / "authority.pem", "certificate": folder / f"{name}.pem", "key": folder / f"{name}-key.pem"}

    def works(self, **arguments):
        import varimesh

        with varimesh.Client(self.server.address, connect=1, **arguments) as client:
            return client.optimise(str(MESH)).valid

    def test_the_client_takes_files_variables_and_ready_channels(self):
        import grpc
        import varimesh

        files = self.files(self.certificates, "ann")
        self.assertTrue(self.works(**files))
        with varimesh.Client("https://" + self.server.address + "/", **files) as client:
            self.assertEqual({job.owner for job in client.jobs()}, {"ann"})
        credentials = grpc.ssl_channel_credentials(*(files[name].read_bytes() for name in ("authority", "key", "certificate")))
        self.assertTrue(self.works(credentials=credentials))
        with grpc.secure_channel(self.server.address, credentials) as channel:
            self.assertTrue(self.works(channel=channel))
            self.assertTrue(self.works(channel=channel), "the client has not closed it")
        for name, path in files.items():
            os.environ["VARIMESH_TLS_" + name.upper()] = str(path)
        self.assertTrue(self.works())

    def test_all_others_are_refused(self):
        import varimesh

        right = self.files(self.certificates, "ann")
        ours, theirs = "asks for a client's certificate", "The certificate of the server at"
        for arguments, says in (({"authority": right["authority"]}, ours), (self.files(self.other, "ann"), theirs),
                                ({**self.files(self.other, "ann"), "authority": right["authority"]}, ours)):
            begin = time.monotonic()
            with self.assertRaisesRegex(varimesh.ServerUnreachable, says), \
                 varimesh.Client(self.server.address, **arguments) as client:
                client.info()
            self.assertLess(time.monotonic() - begin, 5, says)
        with self.assertRaisesRegex(varimesh.ServerUnreachable, "wants TLS; name the authority"):
            self.works()
        for arguments in ({"authority": self.folder / "none"}, {"authority": MESH}, {"certificate": right["certificate"]}):
            with self.assertRaises(varimesh.BadOption):
                self.works(**arguments)


if __name__ == "__main__":
    unittest.main(verbosity=2)
