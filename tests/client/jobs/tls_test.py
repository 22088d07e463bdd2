"""A server that encrypts: who gets in and who does not, with the command and the Python client, and certificates that are
replaced while the server runs. ctest runs it with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in the environment."""
import contextlib
import importlib.util
import json
import os
import re
import signal
import socket
import ssl
import stat
import subprocess
import tempfile
import time
import unittest
import urllib.error
import urllib.request
from pathlib import Path

from programs import ENDLESS, LARGER, MESH, VARIMESHD, Server, WithFolder, run, start

VARIABLES = ("TOKEN", "TOKEN_FILE", "TLS_AUTHORITY", "TLS_CERTIFICATE", "TLS_KEY")


def make(folder, *arguments):
    done = run("certificates", folder, *arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def as_client(folder, name=None):
    """The flags of a client with the certificates of a folder; without a name, it has none of its own."""
    flags = ["--tls-authority", folder / "authority.pem"]
    return flags + (["--tls-certificate", folder / f"{name}.pem", "--tls-key", folder / f"{name}-key.pem"] if name else [])


def as_server(folder, mutual=True):
    flags = ["--tls-certificate", str(folder / "server.pem"), "--tls-key", str(folder / "server-key.pem")]
    return flags + (["--tls-authority", str(folder / "authority.pem")] if mutual else [])


def environment(**variables):
    kept = {key: value for key, value in os.environ.items() if key not in ["VARIMESH_" + name for name in VARIABLES]}
    return {**kept, **variables}


class MakingCertificates(WithFolder):
    def test_only_the_owner_can_read_the_keys(self):
        made = make(self.folder / "new", "--client", "ann", "--client", "bob")
        names = {Path(path).name for path in made}
        self.assertEqual(names, {f"{name}{key}.pem" for name in ("authority", "server", "ann", "bob") for key in ("", "-key")})
        for path in made:
            self.assertEqual(stat.S_IMODE(os.stat(path).st_mode), 0o600 if path.endswith("-key.pem") else 0o644, path)

    def test_the_authority_of_the_folder_is_used_again(self):
        make(self.folder)
        before = {name: (self.folder / name).read_text() for name in ("authority.pem", "server.pem")}
        make(self.folder)
        self.assertEqual((self.folder / "authority.pem").read_text(), before["authority.pem"])
        self.assertNotEqual((self.folder / "server.pem").read_text(), before["server.pem"])
        (self.folder / "authority.pem").write_text("nothing")
        self.assertEqual(run("certificates", self.folder).returncode, 3)

    def test_another_client_leaves_the_certificates_of_the_others(self):
        make(self.folder, "--host", "mesh.example.org", "--client", "ann")
        before = {path.name: path.read_bytes() for path in self.folder.iterdir()}
        made = {Path(path).name for path in make(self.folder, "--client", "bob")}
        self.assertEqual(made, {"bob.pem", "bob-key.pem"})
        self.assertEqual({name: (self.folder / name).read_bytes() for name in before}, before)
        made = {Path(path).name for path in make(self.folder, "--host", "other.example.org", "--client", "bob")}
        self.assertEqual(made, {"server.pem", "server-key.pem", "bob.pem", "bob-key.pem"})

    def test_those_who_check_strictly_accept_them(self):
        """As Python 3.13 does unless it is told otherwise."""
        make(self.folder, "--client", "ann")
        inside, outside, parties = ssl.MemoryBIO(), ssl.MemoryBIO(), []
        for name, purpose in (("server", ssl.Purpose.CLIENT_AUTH), ("ann", ssl.Purpose.SERVER_AUTH)):
            context = ssl.create_default_context(purpose, cafile=self.folder / "authority.pem")
            context.load_cert_chain(self.folder / f"{name}.pem", self.folder / f"{name}-key.pem")
            context.verify_mode = ssl.CERT_REQUIRED
            context.verify_flags |= ssl.VERIFY_X509_STRICT
            is_server = name == "server"
            streams = (inside, outside) if is_server else (outside, inside)
            parties.append(context.wrap_bio(*streams, server_side=is_server, server_hostname=None if is_server else "localhost"))
        for _ in range(4):
            for party in parties:
                with contextlib.suppress(ssl.SSLWantReadError):
                    party.do_handshake()
        names = [dict(fields for (fields,) in party.getpeercert()["subject"])["commonName"] for party in parties]
        self.assertEqual(names, ["ann", "VariMesh server"])

    def test_names_that_cannot_be_are_refused(self):
        for flags in (["--client", "../ann"], ["--client", "server"], ["--client", "a-key"], ["--host", "a/b"], ["--host", ""],
                      ["--host", "a,DNS:b"], ["--days", "-1"]):
            self.assertEqual(run("certificates", self.folder, *flags).returncode, 2, flags)
        self.assertEqual(list(self.folder.iterdir()), [])


class Starting(WithFolder):
    """What a server may listen on."""

    def setUp(self):
        super().setUp()
        self.certificates = self.folder / "certificates"
        make(self.certificates)
        (self.folder / "tokens").write_text("")

    def refuse(self, *flags):
        done = subprocess.run([VARIMESHD, *flags], capture_output=True, text=True, timeout=20, env=environment())
        self.assertEqual(done.returncode, 2, done.stderr)
        return done.stderr

    def test_beyond_loopback_it_needs_tls_and_callers_that_it_knows(self):
        beyond, tokens = ["--listen", "0.0.0.0:0"], ["--tokens", str(self.folder / "tokens")]
        for flags in ([], tokens, as_server(self.certificates, mutual=False)):
            self.assertIn("--insecure", self.refuse(*beyond, *flags))
        for flags in (as_server(self.certificates), [*as_server(self.certificates, mutual=False), *tokens]):
            server = Server("--log-level", "off", *flags, listen="0.0.0.0:0")
            self.assertEqual(server.stop()[0], 0)
            self.assertEqual("".join(server.log), "")
        for flags, words in (([], "use this server, and read"), (tokens, "their tokens too"),
                             (as_server(self.certificates, mutual=False), "can use this server")):
            server = Server("--log-level", "off", "--insecure", *flags, listen="0.0.0.0:0")
            server.stop()
            self.assertIn("WARNING", "".join(server.log))
            self.assertIn(words, "".join(server.log))

    def test_files_that_do_not_fit_are_refused(self):
        make(self.folder / "expired", "--days", "0")
        other = self.folder / "other"
        make(other)
        listen = ["--listen", "127.0.0.1:0"]
        good = as_server(self.certificates)
        self.assertIn("expired", self.refuse(*listen, *as_server(self.folder / "expired")))
        self.assertIn("--tls-key", self.refuse(*listen, *good[:2]))
        self.assertIn("--tls-certificate", self.refuse(*listen, *good[2:4]))
        self.assertIn("values mismatch", self.refuse(*listen, *good[:2], "--tls-key", str(other / "server-key.pem")))
        self.assertIn("--tls-authority", self.refuse(*listen, *good[:4], "--tls-authority", str(self.folder / "none")))
        for name, modes in (("server-key.pem", (0o644, 0o620, 0o602, 0o604)), ("authority.pem", (0o664, 0o646))):
            for mode in modes:
                (other / name).chmod(mode)
                said = self.refuse(*listen, *as_server(other))
                self.assertIn("chmod", said, (name, oct(mode)))
                self.assertIn(name, said)
            (other / name).chmod(0o600)
        self.assertIn("unix socket", self.refuse("--listen", f"unix:{self.folder}/socket", *good))

    @unittest.skipIf(os.geteuid() != 0, "only root can give files to others")
    def test_keys_of_others_are_refused(self):
        for name in ("server-key.pem", "authority.pem"):
            os.chown(self.certificates / name, 65534, 65534)
            said = self.refuse("--listen", "127.0.0.1:0", *as_server(self.certificates))
            self.assertIn("belongs to another user", said)
            self.assertIn(name, said)
            os.chown(self.certificates / name, 0, 0)

    def test_by_default_only_its_owner_can_use_it(self):
        state = self.folder / "state"
        with tempfile.TemporaryDirectory() as runtime:
            os.chmod(runtime, 0o700)
            for flags, path in ((["--state", str(state)], state / "socket"), ([], Path(runtime) / "varimeshd.socket")):
                server = subprocess.Popen([VARIMESHD, *flags], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
                                          env=environment(XDG_RUNTIME_DIR=runtime))
                try:
                    self.assertEqual(server.stdout.readline().strip(), f"varimeshd listens on unix:{path}")
                    self.assertEqual(stat.S_IMODE(path.stat().st_mode), 0o600)
                    self.assertEqual(stat.S_IMODE(path.parent.stat().st_mode), 0o700)
                    done = run("jobs", "--server", f"unix:{path}", env=environment(VARIMESH_TLS_AUTHORITY="nowhere"))
                    self.assertEqual(done.returncode, 0, done.stderr)
                    self.without_an_address(path, state if flags else "", runtime)
                finally:
                    server.send_signal(signal.SIGTERM)
                    server.communicate(timeout=40)

    def without_an_address(self, path, state, runtime):
        """Commands without --server find a server of their user, but not in a folder that others can write into."""
        own = environment(XDG_RUNTIME_DIR=runtime, VARIMESH_STATE=str(state))
        done = run("jobs", env=own)
        self.assertEqual((done.returncode, done.stdout), (0, ""), done.stderr)
        self.assertIn("There are no such jobs", done.stderr)
        path.parent.chmod(0o770)
        done = run("jobs", env=own)
        path.parent.chmod(0o700)
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertIn(f"no varimeshd of yours listens on {path}; start one, or name a server with --server", done.stderr)


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
        ours = f"The server at {self.server.address} wants a certificate of yours that comes from an authority that it knows"
        for what, flags, says in (("no certificate", as_client(self.certificates), ours),
                                  ("wrong authority", as_client(self.other, "ann"), theirs),
                                  ("a certificate of another authority", mixed, ours),
                                  ("an expired certificate", as_client(self.folder / "old", "ann"), ours)):
            begin = time.monotonic()
            done = self.jobs(*flags)
            self.assertLess(time.monotonic() - begin, 3, what)
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
        ours, theirs = "wants a certificate of yours", "The certificate of the server at"
        for arguments, says in (({"authority": right["authority"]}, ours), (self.files(self.other, "ann"), theirs),
                                ({**self.files(self.other, "ann"), "authority": right["authority"]}, ours)):
            begin = time.monotonic()
            with self.assertRaisesRegex(varimesh.ServerUnreachable, says), \
                 varimesh.Client(self.server.address, **arguments) as client:
                client.info()
            self.assertLess(time.monotonic() - begin, 3, says)
        with self.assertRaisesRegex(varimesh.ServerUnreachable, "wants TLS; name the authority"):
            self.works()
        for arguments in ({"authority": self.folder / "none"}, {"authority": MESH}, {"certificate": right["certificate"]}):
            with self.assertRaises(varimesh.BadOption):
                self.works(**arguments)


if __name__ == "__main__":
    unittest.main(verbosity=2)
