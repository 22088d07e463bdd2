"""deploy/nginx.conf, and the files of nginx in deploy/farm: nginx accepts them, and jobs go through it, with addresses and paths
changed to those of this test.

Under a flood every call must succeed. With VARIMESH_MEASURE=1, on a quiet machine, the slowest hundredth must also take less than
ten times what it takes without a flood.
"""
import contextlib
import http.client
import json
import os
import re
import shutil
import socket
import ssl
import subprocess
import sys
import textwrap
import time
import unittest
from pathlib import Path

try:
    import grpc
except ImportError:
    grpc = None

import http2_floods
from programs import MESH, Server, WithFolder, run

CONFIGURATION = os.environ["VARIMESH_SOURCE_DIR"] + "/deploy/nginx.conf"
COMPOSE_CONFIGURATION = Path(os.environ["VARIMESH_SOURCE_DIR"]) / "deploy" / "farm" / "nginx.conf"
HTTP_OF_PODS = COMPOSE_CONFIGURATION.parent / "kubernetes" / "overlays" / "ingress" / "http.yaml"
NGINX = shutil.which("nginx", path=os.environ["PATH"] + ":/usr/sbin")
MEASURES = bool(os.environ.get("VARIMESH_MEASURE"))


def warnings(text):
    """Those of nginx, but for one: from version 1.25 on it wants http2 as a directive, which the 1.22 of Debian 12 lacks."""
    return [line for line in text.splitlines() if "[warn]" in line and 'use the "http2" directive' not in line]


class WithNginx(WithFolder):
    def setUp(self):
        super().setUp()
        done = run("certificates", self.folder, "--client", "ann")
        self.assertEqual(done.returncode, 0, done.stderr)
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.port = free.getsockname()[1]
        self.http = "127.0.0.1:8080"

    def nginx(self, *arguments, **keywords):
        return [NGINX, "-e", "stderr", "-p", str(self.folder), *map(str, arguments)]

    def check_accepted(self):
        done = subprocess.run(self.nginx("-t", "-c", self.configuration()), capture_output=True, text=True, timeout=20)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(warnings(done.stderr), [])

    def serve(self, path):
        proxy = subprocess.Popen(self.nginx("-c", path, "-g", "daemon off;"), stderr=subprocess.DEVNULL)
        self.addCleanup(proxy.wait, 20)
        self.addCleanup(proxy.terminate)

    def ask(self, method, path, body=None, **headers):
        """A request with HTTP and JSON. Returns the code and the bytes of the answer."""
        connection = http.client.HTTPSConnection("localhost", self.port, timeout=60,
                                                 context=ssl.create_default_context(cafile=self.folder / "authority.pem"))
        self.addCleanup(connection.close)
        connection.request(method, path, body, headers)
        answer = connection.getresponse()
        return answer.status, answer.read()

    def check_http_and_json(self):
        """A job goes through nginx, and pages of other sites do not."""
        token = subprocess.run([os.environ["VARIMESHD"], "token", "ann", "--tokens", self.folder / "tokens"],
                               capture_output=True, text=True, timeout=20).stdout.strip()
        server = Server("--tokens", str(self.folder / "tokens"), "--http", "127.0.0.1:0", listen=f"unix:{self.folder}/socket")
        self.addCleanup(server.stop)
        deadline = time.monotonic() + 20
        while not (found := re.search(r"http://(127\.0\.0\.1:\d+)/v1/", "".join(server.log))):
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.01)
        self.http = found[1]
        self.serve(self.configuration())
        while socket.socket().connect_ex(("127.0.0.1", self.port)):
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.05)
        form = b"".join(b'--x\r\nContent-Disposition: form-data; name="%s"\r\n\r\n%s\r\n' % part
                        for part in ((b"spec", b"{}"), (b"mesh", MESH.read_bytes()))) + b"--x--\r\n"
        kind = {"Content-Type": "multipart/form-data; boundary=x"}
        self.assertEqual(self.ask("POST", "/v1/jobs", form, **kind)[0], 401)
        known = {"Authorization": f"Bearer {token}"}
        code, told = self.ask("POST", "/v1/jobs", form, **kind, **known)
        self.assertEqual(code, 200, told)
        job = json.loads(told)["job"]["name"]
        code, events = self.ask("GET", f"/v1/{job}/events", **known)
        self.assertEqual(code, 200, events)
        self.assertIn(b"JOB_STATE_SUCCEEDED", events)
        code, result = self.ask("GET", f"/v1/{job}/result", **known)
        self.assertEqual((code, self.ask("GET", f"/v1/{job}/result", **known, Range="bytes=-9")[1]), (200, result[-9:]))
        own = f"https://localhost:{self.port}"
        for origin, code in ((own, 200), ("https://evil.example", 403), ("null", 403), (own + ".evil.example", 403), (own.replace("https", "http"), 403),
                             ("http://127.0.0.1", 403)):
            self.assertEqual(self.ask("GET", "/v1/info", **known, Origin=origin)[0], code, origin)
        self.assertEqual(self.ask("POST", "/v1/jobs?validateOnly=true", "{}", **known, Origin=own, **{"Content-Type": "application/json"})[0], 400)
        self.assertEqual(self.ask("GET", "/v1/info", **known, **{"Sec-Fetch-Site": "cross-site"})[0], 403)
        for path in ("/", "/page.js", "/page.css", "/three.js"):
            self.assertEqual(self.ask("GET", path)[0], 200, path)
        self.assertIn(b"<title>VariMesh</title>", self.ask("GET", "/")[1])
        self.assertEqual(self.ask("GET", "/other")[0], 404)
        self.assertEqual(self.ask("GET", "/v1/jobs/%2e%2e%2fother")[0], 404)


class Nginx(WithNginx):
    def configuration(self, change=lambda text: text):
        """The file of this test, which must differ from the one in deploy/ only in what it has to."""
        with open(CONFIGURATION) as file:
            text = file.read()
        # Its workers must be able to use the socket of this user.
        user = "user root;\n" if os.geteuid() == 0 else ""
        for old, new in (("user www-data;\n", user), ("pid /run/nginx.pid", f"pid {self.folder}/pid"),
                         ("unix:/run/varimesh/socket", f"unix:{self.folder}/socket"),
                         ("http://127.0.0.1:8080", f"http://{self.http}"), ("/etc/varimesh/", f"{self.folder}/"), ("listen 443 ", f"listen 127.0.0.1:{self.port} ")):
            self.assertIn(old, text)
            text = text.replace(old, new)
        path = self.folder / "nginx.conf"
        folders = "".join(f"  {kind}_temp_path {self.folder}/{kind};\n"
                          for kind in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi"))
        path.write_text(change(text.replace("http {\n", "http {\n" + folders, 1)))
        return path

    def call(self, *arguments, token="", certificate=()):
        variables = {key: value for key, value in os.environ.items() if not re.match("VARIMESH_(TOKEN|TLS)", key)}
        return run(*arguments, "--server", f"localhost:{self.port}", "--tls-authority", self.folder / "authority.pem", *certificate,
                   env={**variables, "VARIMESH_TOKEN": token})

    def test_nginx_accepts_it(self):
        self.check_accepted()

    def test_http_and_json_go_through_it(self):
        self.check_http_and_json()

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

    @contextlib.contextmanager
    def channel(self):
        """A channel through nginx to a server."""
        server = Server("--log-level", "off", listen=f"unix:{self.folder}/socket")
        self.addCleanup(server.stop)
        self.serve(self.configuration())
        authority = grpc.ssl_channel_credentials((self.folder / "authority.pem").read_bytes())
        with grpc.secure_channel(f"localhost:{self.port}", authority) as channel:
            grpc.channel_ready_future(channel).result(timeout=20)
            yield channel

    def test_a_client_watches_as_many_jobs_as_the_page_says(self):
        with self.channel() as channel:
            # Those of the health, since they need no jobs.
            watch = channel.unary_stream("/grpc.health.v1.Health/Watch", request_serializer=bytes, response_deserializer=bytes)
            watches = [watch(b"", timeout=40) for _ in range(250)]
            for number, one in enumerate(watches):
                self.assertEqual(next(one), b"\x08\x01", f"watch {number}: SERVING")
            for one in watches:
                one.cancel()

    def test_only_meshes_and_jobs_may_be_large(self):
        with self.channel() as channel:
            def said(method, *sizes):
                """Calls a method with messages of these many bytes, which it cannot read. Returns what it is told."""
                call = channel.stream_stream(f"/varimesh.v1.{method}", request_serializer=bytes, response_deserializer=bytes)
                with self.assertRaises(grpc.RpcError) as failed:
                    # Field 15, which no message has, then bytes that are no field.
                    list(call(iter([b"\x07" * size for size in sizes]), timeout=20))
                return failed.exception.code(), failed.exception.details()

            too_large = (grpc.StatusCode.UNKNOWN, "Received http2 header with status: 413")
            small, large = 1 << 16, 4 << 20
            for method in ("JobService/GetJob", "JobService/ListJobs", "MeshService/QueryUpload", "JobService/GetServerInfo"):
                self.assertEqual(said(method, small)[0], grpc.StatusCode.INVALID_ARGUMENT, method)
                self.assertEqual(said(method, small + 1), too_large, method)
            self.assertEqual(said("JobService/SubmitJob", large)[0], grpc.StatusCode.INVALID_ARGUMENT)
            self.assertEqual(said("JobService/SubmitJob", large + 1), too_large)
            for method in ("MeshService/UploadMesh", "MeshService/SendMesh", "OptimiseService/Optimise"):
                self.assertNotEqual(said(method, large, large), too_large, method)

    def test_floods_stop_at_it(self):
        server = Server("--log-level", "off", listen=f"unix:{self.folder}/socket")
        self.addCleanup(server.stop)
        self.serve(self.configuration())

        def memory():
            status = Path(f"/proc/{server.process.pid}/status").read_text()
            return int(re.search(r"VmRSS:\s+(\d+)", status)[1]) / 1024

        def calls(until):
            """How long each of a working owner's calls takes, at least five of them."""
            took = []
            while len(took) < 5 or time.monotonic() < until:
                begun = time.monotonic()
                done = self.call("jobs")
                self.assertEqual(done.returncode, 0, done.stderr)
                took.append(time.monotonic() - begun)
            return took

        seconds = 10 if MEASURES else 2
        calls(time.monotonic() + 1)
        quiet, before = calls(time.monotonic() + seconds), memory()
        for kind in http2_floods.FLOODS:
            with self.subTest(kind):
                attackers = http2_floods.start(f"localhost:{self.port}", self.folder / "authority.pem", kind, seconds + 1)
                time.sleep(0.5)
                flooded = calls(time.monotonic() + seconds)
                sent, connections = http2_floods.totals(attackers)
                self.assertGreater(sent, 100, "it was a flood")
                more = memory() - before
                now, then = (sorted(took)[len(took) * 99 // 100] for took in (flooded, quiet))
                print(f"{kind}: {sent} messages, {connections} connections; p99 of {len(flooded)} calls {then * 1e3:.0f} -> "
                      f"{now * 1e3:.0f} ms, slowest {max(flooded) * 1e3:.0f} ms; {more:.0f} MiB more", file=sys.stderr)
                if MEASURES:
                    self.assertLess(now, 10 * then)
                self.assertLess(more, 64)

    def test_it_can_ask_for_certificates(self):
        server = Server(listen=f"unix:{self.folder}/socket")
        self.addCleanup(server.stop)
        self.serve(self.configuration(lambda text: re.sub(r"# (ssl_client_certificate|ssl_verify_client)", r"\1", text)))
        own = ("--tls-certificate", self.folder / "ann.pem", "--tls-key", self.folder / "ann-key.pem")
        self.assertEqual(self.call("jobs", certificate=own).returncode, 0)
        self.assertNotEqual(self.call("jobs").returncode, 0)


class ComposeNginx(WithFolder):
    """deploy/farm/nginx.conf, before a front end whose name needs no name server."""

    def test_jobs_go_through_it(self):
        server = Server("--http", "0.0.0.0:0", "--insecure", listen="127.0.0.1:0")
        self.addCleanup(server.stop)
        with socket.create_server(("127.0.0.1", 0)) as free, socket.create_server(("127.0.0.1", 0)) as also_free:
            port, port_of_http = free.getsockname()[1], also_free.getsockname()[1]
        behind = re.search(r"http://0\.0\.0\.0:(\d+)/v1/", self.log_of(server))[1]
        text = COMPOSE_CONFIGURATION.read_text()
        for old, new in (("listen 50051 ", f"listen 127.0.0.1:{port} "), ("frontend:50051", server.address),
                         ("listen 8080;", f"listen 127.0.0.1:{port_of_http};"), ("frontend:8080", f"127.0.0.1:{behind}"), ("/tmp/", f"{self.folder}/")):
            self.assertIn(old, text)
            text = text.replace(old, new)
        path = self.folder / "nginx.conf"
        path.write_text(("user root;\n" if os.geteuid() == 0 else "") + text)
        command = [NGINX, "-e", "stderr", "-p", str(self.folder), "-c", str(path)]
        done = subprocess.run([*command, "-t"], capture_output=True, text=True, timeout=20)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(warnings(done.stderr), [])
        proxy = subprocess.Popen([*command, "-g", "daemon off;"], stderr=subprocess.DEVNULL)
        self.addCleanup(proxy.wait, 20)
        self.addCleanup(proxy.terminate)
        out = self.folder / "out.msh"
        done = run("optimise", MESH, "-o", out, "--server", f"127.0.0.1:{port}")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue(out.exists())
        self.check_http(port_of_http)

    def log_of(self, server):
        """The log, once it has the address of the port for HTTP."""
        deadline = time.monotonic() + 20
        while "/v1/" not in (text := "".join(server.log)):
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.02)
        return text

    def check_http(self, port):
        """A job with its mesh, its events and its result, and what the front end refuses behind nginx as well."""
        def ask(method, path, body=None, **headers):
            connection = http.client.HTTPConnection("127.0.0.1", port, timeout=40)
            self.addCleanup(connection.close)
            connection.request(method, path, body, headers)
            answer = connection.getresponse()
            return answer.status, answer.read()

        form = (b'--x\r\nContent-Disposition: form-data; name="spec"\r\n\r\n{}\r\n--x\r\nContent-Disposition: form-data; name="mesh"\r\n\r\n' +
                MESH.read_bytes() + b"\r\n--x--\r\n")
        code, text = ask("POST", "/v1/jobs", form, **{"Content-Type": "multipart/form-data; boundary=x"})
        self.assertEqual(code, 200, text)
        name = json.loads(text)["job"]["name"]
        self.assertIn(b"JOB_STATE_SUCCEEDED", ask("GET", f"/v1/{name}/events")[1])
        code, result = ask("GET", f"/v1/{name}/result")
        self.assertEqual((code, len(result) > 100), (200, True))
        self.assertEqual(ask("GET", "/")[0], 200)
        self.assertEqual(ask("GET", "/v1/info", Origin="http://evil.example")[0], 403)
        self.assertEqual(ask("GET", "/v1/info", Host="evil.example")[0], 421)
        self.assertEqual(ask("GET", "/", Origin=f"http://127.0.0.1:{port}")[0], 200)
        self.assertEqual(ask("GET", "/metrics")[0], 404)


class InPods(WithNginx):
    """The nginx of the pods of front ends (deploy/farm/kubernetes/overlays/ingress/http.yaml)."""

    def configuration(self):
        text = textwrap.dedent(re.search(r"^  nginx\.conf: \|\n(.*?)^---$", HTTP_OF_PODS.read_text(), re.MULTILINE | re.DOTALL)[1])
        for old, new in (("/tmp/", f"{self.folder}/"), ("/tls/tls.crt", f"{self.folder}/server.pem"), ("/tls/tls.key", f"{self.folder}/server-key.pem"),
                         ("http://127.0.0.1:8080", f"http://{self.http}"), ("listen 8443 ", f"listen 127.0.0.1:{self.port} ")):
            self.assertIn(old, text)
            text = text.replace(old, new)
        path = self.folder / "nginx.conf"
        path.write_text(("user root;\n" if os.geteuid() == 0 else "") + text)
        return path

    def test_nginx_accepts_it(self):
        self.check_accepted()

    def test_http_and_json_go_through_it(self):
        self.check_http_and_json()


if __name__ == "__main__":
    if NGINX is None or grpc is None:
        print("SKIPPED: nginx or grpc for Python is missing (deploy/setup test)")
        sys.exit(77)
    unittest.main(verbosity=2)
