"""deploy/nginx.conf: nginx accepts it, and jobs go through it, with its addresses and paths changed to those of this test."""
import os
import re
import shutil
import socket
import subprocess
import sys
import unittest

from programs import MESH, Server, WithFolder, run

CONFIGURATION = os.environ["VARIMESH_SOURCE_DIR"] + "/deploy/nginx.conf"
NGINX = shutil.which("nginx", path=os.environ["PATH"] + ":/usr/sbin")


class Nginx(WithFolder):
    def setUp(self):
        super().setUp()
        done = run("certificates", self.folder, "--client", "ann")
        self.assertEqual(done.returncode, 0, done.stderr)
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.port = free.getsockname()[1]

    def configuration(self, change=lambda text: text):
        """The file of this test, which must differ from the one in deploy/ only in what it has to."""
        with open(CONFIGURATION) as file:
            text = file.read()
        # Its workers must be able to use the socket of this user.
        user = "user root;\n" if os.geteuid() == 0 else ""
        for old, new in (("user www-data;\n", user), ("pid /run/nginx.pid", f"pid {self.folder}/pid"),
                         ("unix:/run/varimesh/socket", f"unix:{self.folder}/socket"),
                         ("/etc/varimesh/", f"{self.folder}/"), ("listen 443 ", f"listen 127.0.0.1:{self.port} ")):
            self.assertIn(old, text)
            text = text.replace(old, new)
        path = self.folder / "nginx.conf"
        folders = "".join(f"  {kind}_temp_path {self.folder}/{kind};\n"
                          for kind in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi"))
        path.write_text(change(text.replace("http {\n", "http {\n" + folders, 1)))
        return path

    def nginx(self, *arguments, **keywords):
        return [NGINX, "-e", "stderr", "-p", str(self.folder), *map(str, arguments)]

    def test_nginx_accepts_it(self):
        done = subprocess.run(self.nginx("-t", "-c", self.configuration()), capture_output=True, text=True, timeout=20)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertNotIn("[warn]", done.stderr)

    def serve(self, path):
        proxy = subprocess.Popen(self.nginx("-c", path, "-g", "daemon off;"), stderr=subprocess.DEVNULL)
        self.addCleanup(proxy.wait, 20)
        self.addCleanup(proxy.terminate)

    def call(self, *arguments, token="", certificate=()):
        variables = {key: value for key, value in os.environ.items() if not re.match("VARIMESH_(TOKEN|TLS)", key)}
        return run(*arguments, "--server", f"localhost:{self.port}", "--tls-authority", self.folder / "authority.pem", *certificate,
                   env={**variables, "VARIMESH_TOKEN": token})

    def test_jobs_go_through_it(self):
        token = subprocess.run([os.environ["VARIMESHD"], "token", "ann", "--tokens", self.folder / "tokens"],
                               capture_output=True, text=True, timeout=20).stdout.strip()
        server = Server("--tokens", str(self.folder / "tokens"), listen=f"unix:{self.folder}/socket")
        self.addCleanup(server.stop)
        self.serve(self.configuration())
        done = self.call("optimise", MESH, "-o", self.folder / "out.msh", token=token)
        self.assertEqual(done.returncode, 0, done.stderr)
        local = run("optimise", MESH, "-o", self.folder / "local.msh")
        self.assertEqual(local.returncode, 0, local.stderr)
        self.assertEqual((self.folder / "out.msh").read_bytes(), (self.folder / "local.msh").read_bytes())
        self.assertIn("asks who calls", self.call("jobs").stderr)

    def test_it_can_ask_for_certificates(self):
        server = Server(listen=f"unix:{self.folder}/socket")
        self.addCleanup(server.stop)
        self.serve(self.configuration(lambda text: re.sub(r"# (ssl_client_certificate|ssl_verify_client)", r"\1", text)))
        own = ("--tls-certificate", self.folder / "ann.pem", "--tls-key", self.folder / "ann-key.pem")
        self.assertEqual(self.call("jobs", certificate=own).returncode, 0)
        self.assertNotEqual(self.call("jobs").returncode, 0)


if __name__ == "__main__":
    if NGINX is None:
        print("SKIPPED: nginx is missing (deploy/setup test)")
        sys.exit(77)
    unittest.main(verbosity=2)
