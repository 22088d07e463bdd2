"""A server that fetches the keys of an OpenID Connect issuer over HTTPS: from a server with the right certificate and from
others, keys that are replaced, and answers that cannot be used. The key of the issuer is made by openssl. ctest runs it
with VARIMESH and VARIMESHD in the environment."""
import base64
import http.server
import json
import os
import shutil
import ssl
import subprocess
import threading
import time
import unittest

from programs import VARIMESHD, Server, WithFolder, run


def encoded(data):
    return base64.urlsafe_b64encode(data).rstrip(b"=").decode()


class Key:
    """An RSA key of an issuer."""

    def __init__(self, folder, name):
        self.name, self.file = name, folder / f"{name}.pem"
        subprocess.run(["openssl", "genrsa", "-out", self.file, "2048"], check=True, capture_output=True)
        said = subprocess.run(["openssl", "rsa", "-in", self.file, "-noout", "-modulus"], check=True, capture_output=True)
        modulus = bytes.fromhex(said.stdout.decode().split("=")[1].strip())
        self.web = {"kty": "RSA", "kid": name, "n": encoded(modulus), "e": "AQAB"}

    def sign(self, **claims):
        parts = [encoded(json.dumps(part).encode()) for part in ({"alg": "RS256", "kid": self.name}, claims)]
        text = ".".join(parts)
        done = subprocess.run(["openssl", "dgst", "-sha256", "-sign", self.file], input=text.encode(), check=True,
                              capture_output=True)
        return f"{text}.{encoded(done.stdout)}"


class Issuer:
    """An HTTPS server with a certificate of the authority in a folder. `answers`: by path."""

    def __init__(self, certificates):
        self.answers, self.asked = {}, []
        issuer = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self):
                issuer.asked.append(self.path)
                status, body = issuer.answers.get(self.path, (404, b""))
                self.send_response(status)
                if status == 302:
                    self.send_header("Location", body.decode())
                self.end_headers()
                try:
                    self.wfile.write(body)
                except (ssl.SSLError, OSError):
                    pass  # who asked has gone

            def log_message(self, *_):
                pass

        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(certificates / "server.pem", certificates / "server-key.pem")
        self.server.socket = context.wrap_socket(self.server.socket, server_side=True)
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        self.url = f"https://127.0.0.1:{self.server.server_port}"

    def give_keys(self, *keys):
        self.answers["/keys"] = (200, json.dumps({"keys": [key.web for key in keys]}).encode())

    def stop(self):
        self.server.shutdown()
        self.server.server_close()


@unittest.skipUnless(shutil.which("openssl"), "the program openssl is missing")
class FetchedKeys(WithFolder):
    @classmethod
    def setUpClass(cls):
        flags = ["--jwt-issuer", "https://127.0.0.1:1", "--jwt-audience", "varimesh", "--port-file", "/nowhere/port"]
        done = subprocess.run([VARIMESHD, "--listen", "127.0.0.1:0", *flags], capture_output=True, text=True, timeout=20)
        if done.returncode == 2:  # otherwise it starts, and cannot write the file
            raise unittest.SkipTest(done.stderr.strip())

    def setUp(self):
        super().setUp()
        self.certificates = self.folder / "certificates"
        self.assertEqual(run("certificates", self.certificates, "--host", "127.0.0.1").returncode, 0)
        self.issuer = Issuer(self.certificates)
        self.addCleanup(self.issuer.stop)
        self.key = Key(self.folder, "first")
        self.issuer.give_keys(self.key)

    def serve(self, *flags, authority=None):
        server = Server("--log-level", "info", "--jwt-issuer", self.issuer.url, "--jwt-audience", "varimesh",
                        "--jwt-authority", str(authority or self.certificates / "authority.pem"), *flags)
        self.addCleanup(lambda: server.process.poll() is None and server.stop())
        return server

    def token(self, key=None, **other):
        claims = {"iss": self.issuer.url, "aud": "varimesh", "sub": "ann", "exp": time.time() + 600, "roles": ["read"]}
        return (key or self.key).sign(**{**claims, **other})

    def jobs(self, server, token):
        return run("jobs", "--server", server.address, env={**os.environ, "VARIMESH_TOKEN": token})

    def wait_for_log(self, server, words):
        deadline = time.monotonic() + 20
        while words not in "".join(server.log):
            self.assertLess(time.monotonic(), deadline, "".join(server.log))
            time.sleep(0.05)

    def test_the_tokens_of_the_issuer_let_in(self):
        server = self.serve("--jwt-keys", f"{self.issuer.url}/keys", "--log-level", "trace")
        right = self.token()
        done = self.jobs(server, right)
        self.assertEqual(done.returncode, 0, done.stderr)
        wrong = [self.token(exp=1), self.token(aud="other"), self.token(iss="https://other.example"),
                 self.token(Key(self.folder, "first"))]
        for each in wrong:
            self.assertIn("does not know this token", self.jobs(server, each).stderr)
        self.assertEqual(self.issuer.asked, ["/keys"])
        server.stop()
        self.assertIn("TOKEN_UNKNOWN", "".join(server.log))
        for token in (right, *wrong):
            for part in token.split("."):
                self.assertNotIn(part, "".join(server.log))

    def test_the_issuer_says_where_its_keys_are(self):
        self.issuer.answers["/.well-known/openid-configuration"] = (
            200, json.dumps({"issuer": self.issuer.url, "jwks_uri": f"{self.issuer.url}/keys"}).encode())
        server = self.serve()
        self.assertEqual(self.jobs(server, self.token()).returncode, 0)
        self.assertEqual(self.issuer.asked, ["/.well-known/openid-configuration", "/keys"])

    def test_what_cannot_be_trusted_is_not_fetched(self):
        self.assertEqual(run("certificates", self.folder / "other").returncode, 0)
        large = json.dumps({"keys": [self.key.web], "more": "x" * (2 << 20)}).encode()
        for why, answer, authority in (("cannot be fetched", None, self.folder / "other" / "authority.pem"),
                                       ("has the status 302", (302, f"{self.issuer.url}/elsewhere".encode()), None),
                                       ("has the status 500", (500, b""), None), ("cannot be fetched", (200, large), None),
                                       ("is no JSON Web Key Set", (200, b"<html>"), None)):
            if answer:
                self.issuer.answers["/keys"] = answer
            server = self.serve("--jwt-keys", f"{self.issuer.url}/keys", authority=authority)
            self.wait_for_log(server, why)
            self.assertNotIn("/elsewhere", self.issuer.asked)
            self.assertIn("does not know this token", self.jobs(server, "vm_nonsense").stderr)
            server.stop()

    def test_settings_that_cannot_be_used_are_refused(self):
        for flags in (["--jwt-keys", "https://issuer.example/keys", "--jwt-audience", "varimesh"],
                      ["--jwt-issuer", "https://issuer.example"], ["--jwt-issuer", "name", "--jwt-audience", "varimesh"],
                      ["--jwt-keys", "http://issuer.example/keys", "--jwt-issuer", "name", "--jwt-audience", "varimesh"]):
            done = subprocess.run([VARIMESHD, "--listen", "127.0.0.1:0", *flags], capture_output=True, text=True, timeout=20)
            self.assertEqual(done.returncode, 2, flags)


if __name__ == "__main__":
    unittest.main(verbosity=2)
