"""Calls at the end of jobs, with receivers that answer, fail, hang, redirect and are not there.
ctest runs it with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in the environment, as Webhooks, Restarts, Names or Rebinding."""
import base64
import hashlib
import hmac
import http.server
import json
import os
import re
import socket
import ssl
import subprocess
import sys
import threading
import time
import unittest
import urllib.request
from pathlib import Path

sys.path.insert(0, str(Path(os.environ["VARIMESH_SOURCE_DIR"]) / "tests" / "server" / "http"))
from over_http import MESH, WithHttp
from programs import LARGER, VARIMESHD, run

KEY = b"a key of thirty-two bytes, or so"
LINE_KEY = "whsec_" + base64.b64encode(KEY).decode()


class Receiver:
    """Answers with the codes that it is told, one after another and the last one for ever; 0: it hangs."""

    def __init__(self, *codes, certificate=None, port=0, address="127.0.0.1", name=None):
        self.codes, self.calls, self.released = list(codes), [], threading.Event()
        receiver = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_POST(self):
                body = self.rfile.read(int(self.headers["Content-Length"]))
                receiver.calls.append((time.monotonic(), self.path, dict(self.headers.items()), body))
                code = receiver.codes.pop(0) if len(receiver.codes) > 1 else receiver.codes[0]
                if code == 0:
                    receiver.released.wait(30)
                    return
                self.send_response(code)
                if 300 <= code < 400:
                    self.send_header("Location", "/elsewhere")
                self.send_header("Content-Length", "0")
                self.end_headers()

            do_GET = do_POST

            def log_message(self, *_):
                pass

        self.server = http.server.ThreadingHTTPServer((address, port), Handler)
        self.scheme = "https" if certificate else "http"
        if certificate:
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            context.load_cert_chain(*certificate)
            self.server.socket = context.wrap_socket(self.server.socket, server_side=True)
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        self.origin = f"{self.scheme}://{name or address}:{self.server.server_address[1]}"

    def close(self):
        self.released.set()
        self.server.shutdown()
        self.server.server_close()

    def wait(self, count, seconds=20):
        deadline = time.monotonic() + seconds
        while len(self.calls) < count:
            assert time.monotonic() < deadline, f"{len(self.calls)} calls"
            time.sleep(0.01)
        return self.calls


class WithWebhooks(WithHttp):
    attempts = 4

    def flags(self):
        self.receivers = self.folder / "receivers"
        if not self.receivers.exists():  # the next server of a test reads what the one before has read
            self.allow()
        return ("--webhooks", str(self.receivers), "--webhook-seconds", "0.1", "--webhook-attempts", str(self.attempts), "--metrics", "127.0.0.1:0")

    def allow(self, *lines):
        """Writes the file of --webhooks. A running server reads it within a second."""
        part = self.folder / "receivers.part"
        part.touch(0o600)
        part.write_text("".join(line + "\n" for line in lines))
        part.rename(self.receivers)

    def receiver(self, *codes, **keywords):
        one = Receiver(*codes, **keywords)
        self.addCleanup(one.close)
        return one

    def certificate(self, name):
        """Makes a certificate for a name of OpenSSL's, such as DNS:hook.example, and returns its file and that of its key."""
        key, certificate = self.folder / "key.pem", self.folder / "certificate.pem"
        subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-keyout", key, "-out", certificate,
                        "-subj", "/CN=a receiver", "-addext", f"subjectAltName={name}"], check=True, capture_output=True, timeout=20)
        return certificate, key

    def allow_all(self, *receivers):
        """Allows the receivers, and waits until the server knows."""
        self.allow(*(f"{one.origin} {LINE_KEY} private" for one in receivers))
        digest = "0" * 64
        deadline = time.monotonic() + 10
        for one in receivers:
            spec = {"mesh": {"digest": digest}, "webhook": {"url": one.origin}}
            while self.reason("POST", "/v1/jobs?validateOnly=true", spec)[1] == "BAD_OPTION":
                self.assertLess(time.monotonic(), deadline)
                time.sleep(0.05)

    def make(self, url, mesh=MESH, **spec):
        """Submits a job with a webhook, over HTTP, and returns its number."""
        bytes_of_mesh = Path(mesh).read_bytes()
        digest = hashlib.sha256(bytes_of_mesh).hexdigest()
        self.ask("POST", f"/v1/meshes?digest={digest}", bytes_of_mesh, {"Content-Type": "application/octet-stream"})
        code, answer = self.ask("POST", "/v1/jobs", {"mesh": {"digest": digest}, "webhook": {"url": url}, **spec})
        self.assertEqual(code, 200, answer)
        return answer["job"]["name"].removeprefix("jobs/")

    def call_of(self, job, *states):
        """Waits until the call of a job has one of the states, and returns what the job says of it."""
        deadline = time.monotonic() + 30
        while (found := self.ask("GET", f"/v1/jobs/{job}")[1]["job"]).get("webhookCall", {}).get("state") not in [f"STATE_{one}" for one in states]:
            self.assertLess(time.monotonic(), deadline, found)
            time.sleep(0.02)
        return found["webhookCall"]

    def metric(self, name):
        address = re.search(r"http://([0-9.:]+)/metrics", "".join(self.server.log))[1]
        text = urllib.request.urlopen(f"http://{address}/metrics", timeout=10).read().decode()
        return float(re.search(rf"^{re.escape(name)} (\S+)$", text, re.M)[1])


class Webhooks(WithWebhooks):
    def test_are_called_once_with_the_job_and_a_signature(self):
        receiver = self.receiver(204)
        self.allow_all(receiver)
        job = self.make(receiver.origin + "/jobs?team=7", labels={"case": "wing"})
        call = self.call_of(job, "DELIVERED")
        self.assertEqual(call, {"state": "STATE_DELIVERED", "attempts": 1})
        (_, path, headers, body), = receiver.calls
        headers = {name.lower(): value for name, value in headers.items()}
        self.assertEqual((path, headers["content-type"], headers["webhook-id"]), ("/jobs?team=7", "application/json", f"jobs/{job}"))
        sent = int(headers["webhook-timestamp"])
        self.assertLess(abs(time.time() - sent), 30)
        signed = f"jobs/{job}.{sent}.".encode() + body
        expected = base64.b64encode(hmac.new(KEY, signed, hashlib.sha256).digest()).decode()
        self.assertEqual(headers["webhook-signature"], f"v1,{expected}")
        document, shown = json.loads(body), self.ask("GET", f"/v1/jobs/{job}")[1]
        shown["job"]["spec"] = {"labels": {"case": "wing"}}
        del shown["job"]["webhookCall"]
        self.assertEqual(document, shown)
        self.assertEqual(document["job"]["state"], "JOB_STATE_SUCCEEDED")
        time.sleep(1)
        self.assertEqual(len(receiver.calls), 1)
        self.assertEqual(self.metric('varimesh_webhook_calls_total{outcome="delivered"}'), 1)
        self.assertEqual(self.metric("varimesh_webhooks_waiting"), 0)

    def test_are_given_to_the_command(self):
        receiver = self.receiver(200)
        self.allow_all(receiver)
        job = self.submit(MESH, "--webhook", receiver.origin + "/done")
        self.call_of(job, "DELIVERED")
        self.assertEqual([path for _, path, *_ in receiver.calls], ["/done"])
        done = run("submit", MESH, "--webhook", "https://evil.example/", "--server", self.server.address)
        self.assertEqual((done.returncode, "may not call https://evil.example" in done.stderr), (2, True), done.stderr)

    def test_are_called_however_the_job_ends(self):
        receiver = self.receiver(200)
        self.allow_all(receiver)
        broken = self.folder / "broken.msh"
        broken.write_text("hello")
        failed = self.make(receiver.origin, broken)
        options = {"method": "METHOD_SWEEPS", "tolerance": 1e-15, "maxIterations": 100000}
        cancelled = self.make(receiver.origin, LARGER, options=options)
        self.wait(cancelled, "JOB_STATE_RUNNING")
        waiting = self.make(receiver.origin, LARGER, options=options)
        for job in (waiting, cancelled):
            self.assertNotIn("webhookCall", self.ask("GET", f"/v1/jobs/{job}")[1]["job"])
            self.ask("POST", f"/v1/jobs/{job}/cancel")
        states = {json.loads(body)["job"]["name"]: json.loads(body)["job"]["state"] for *_, body in receiver.wait(3)}
        self.assertEqual(states, {f"jobs/{failed}": "JOB_STATE_FAILED", f"jobs/{cancelled}": "JOB_STATE_CANCELLED", f"jobs/{waiting}": "JOB_STATE_CANCELLED"})

    def test_are_called_again_with_growing_pauses_until_somebody_answers(self):
        receiver = self.receiver(500, 404, 200)
        self.allow_all(receiver)
        call = self.call_of(self.make(receiver.origin), "DELIVERED")
        self.assertEqual(call["attempts"], 3)
        times = [at for at, *_ in receiver.calls]
        self.assertGreaterEqual(times[1] - times[0], 0.1)
        self.assertGreaterEqual(times[2] - times[1], 0.2)
        self.assertEqual(len({(dict(headers)["webhook-id"], body) for _, _, headers, body in receiver.calls}), 1)
        self.assertEqual(self.metric('varimesh_webhook_calls_total{outcome="failed"}'), 2)

    def test_are_given_up_in_the_end(self):
        receiver, gone = self.receiver(500), self.receiver(410)
        self.allow_all(receiver, gone)
        call = self.call_of(self.make(receiver.origin), "GIVEN_UP")
        self.assertEqual((call["attempts"], len(receiver.calls)), (4, 4))
        self.assertIn("500", call["error"])
        call = self.call_of(self.make(gone.origin), "GIVEN_UP")
        self.assertEqual((call["attempts"], len(gone.calls)), (1, 1))
        self.assertEqual(self.metric('varimesh_webhook_calls_total{outcome="given_up"}'), 2)

    def test_follow_no_redirection(self):
        for code in (301, 302, 303, 307, 308):
            receiver = self.receiver(code)
            self.allow_all(receiver)
            call = self.call_of(self.make(receiver.origin + "/first"), "GIVEN_UP")
            self.assertIn(str(code), call["error"])
            self.assertEqual({path for _, path, *_ in receiver.calls}, {"/first"})

    def test_that_hang_hold_up_no_others(self):
        hanging, quick = self.receiver(0), self.receiver(200)
        self.allow_all(hanging, quick)
        for _ in range(12):
            self.make(hanging.origin)
        hanging.wait(2)
        began = time.monotonic()
        self.call_of(self.make(quick.origin), "DELIVERED")
        self.assertLess(time.monotonic() - began, 8)
        self.assertLessEqual(len(hanging.calls), 2, "few at a time")
        began = time.monotonic()
        self.assertEqual(self.server.stop()[0], 0)
        self.assertLess(time.monotonic() - began, 8, "a server that stops gives the calls up")

    def test_go_only_to_whom_the_operator_allows(self):
        receiver = self.receiver(200)
        self.allow_all(receiver)
        port = receiver.origin.rsplit(":", 1)[1]
        spec = {"mesh": {"digest": "0" * 64}}
        for url in ("", "https://evil.example/", f"http://localhost:{port}/", f"http://127.1:{port}/", f"http://2130706433:{port}/", f"http://[::1]:{port}/",
                    f"http://127.0.0.1:{port}@evil.example/", f"http://user@127.0.0.1:{port}/", f"https://127.0.0.1:{port}/", "http://127.0.0.1/",
                    f"http://127.0.0.1:{port}\\@evil.example/", f"http://127.0.0.1:{port} /", f"http://127.0.0.1:{port}/\r\nX: y", f"http://127.0.0.1:{port}/\u00e4",
                    "http://169.254.169.254/latest/meta-data/", "file:///etc/passwd", f"http://127.0.0.1:{port}/" + "a" * 2048):
            code, reason = self.reason("POST", "/v1/jobs", {**spec, "webhook": {"url": url}})
            self.assertEqual((code, reason), (400, "BAD_OPTION"), url)
        self.assertTrue(self.ask("GET", "/v1/info")[1]["takesWebhooks"])

    def test_of_a_receiver_that_is_not_allowed_any_more_are_not_made(self):
        receiver = self.receiver(500)
        self.allow_all(receiver)
        options = {"method": "METHOD_SWEEPS", "tolerance": 1e-15, "maxIterations": 100000}
        job = self.make(receiver.origin, LARGER, options=options)
        self.allow()
        spec = {"mesh": {"digest": "0" * 64}, "webhook": {"url": receiver.origin}}
        while self.reason("POST", "/v1/jobs", spec)[1] != "BAD_OPTION":
            time.sleep(0.05)
        self.ask("POST", f"/v1/jobs/{job}/cancel")
        self.assertIn("may not call", self.call_of(job, "GIVEN_UP")["error"])
        self.assertEqual(receiver.calls, [])

    def test_with_a_wrong_file_stay_as_they_were(self):
        receiver = self.receiver(200)
        self.allow_all(receiver)
        self.allow("nonsense")
        deadline = time.monotonic() + 10
        while "Line 1 of the file of --webhooks" not in "".join(self.server.log):
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.05)
        self.call_of(self.make(receiver.origin), "DELIVERED")
        self.receivers.chmod(0o644)
        done = subprocess.run([VARIMESHD, "--webhooks", self.receivers, "--listen", "127.0.0.1:0"], capture_output=True, text=True, timeout=20)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn("chmod", done.stderr)

    def test_of_another_machine_are_encrypted(self):
        certificate, key = self.certificate("IP:127.0.0.1")
        receiver = self.receiver(200, certificate=(certificate, key))
        self.allow_all(receiver)
        call = self.call_of(self.make(receiver.origin), "GIVEN_UP")
        self.assertIn("ertificate", call["error"], "the authority is not known")
        self.server.stop()
        self.start("--webhook-authority", str(certificate))
        self.call_of(self.make(receiver.origin), "DELIVERED")


class Restarts(WithWebhooks):
    """Nothing is lost with a server."""
    attempts = 1000

    def flags(self):
        return (*super().flags(), "--state", str(self.folder / "state"))

    def test_a_call_that_was_not_made_is_made_by_the_next_server(self):
        with socket.socket() as closed:  # nobody listens there for now
            closed.bind(("127.0.0.1", 0))
            port = closed.getsockname()[1]
        self.allow(f"http://127.0.0.1:{port} {LINE_KEY} private")
        time.sleep(1.5)
        jobs = [self.make(f"http://127.0.0.1:{port}") for _ in range(3)]
        for job in jobs:
            self.assertRegex(self.call_of(job, "WAITING").get("error", ""), "^$|no answer")
            self.wait(job, "JOB_STATE_SUCCEEDED")
        self.server.process.kill()
        self.server.stop()
        late = self.receiver(200, port=port)
        self.start()
        for job in jobs:
            self.call_of(job, "DELIVERED")
        self.assertEqual({dict(headers)["webhook-id"] for _, _, headers, _ in late.calls}, {f"jobs/{job}" for job in jobs})

    def test_a_call_under_way_is_made_again_after_a_crash(self):
        hanging = self.receiver(0, 200)
        self.allow_all(hanging)
        job = self.make(hanging.origin)
        hanging.wait(1)
        self.server.process.kill()
        self.server.stop()
        self.start()
        found = self.ask("GET", f"/v1/jobs/{job}")[1]["job"]["webhookCall"]
        self.assertEqual(found["state"], "STATE_WAITING", "it waits for the end of the claim, half a minute")
        hanging.wait(2, 90)
        self.call_of(job, "DELIVERED")


class Names(WithWebhooks):
    """Names that lead into a private network, now or later."""

    def test_that_lead_to_this_machine_are_not_called(self):
        receiver = self.receiver(200)
        port = receiver.origin.rsplit(":", 1)[1]
        accepted = []
        verify = receiver.server.verify_request
        receiver.server.verify_request = lambda *arguments: accepted.append(arguments) or verify(*arguments)
        for host in ("localhost", "127.0.0.1", "[::1]", "[::ffff:127.0.0.1]"):
            self.allow(f"https://{host}:{port} {LINE_KEY}")
            time.sleep(1.5)
            call = self.call_of(self.make(f"https://{host}:{port}/"), "GIVEN_UP")
            self.assertIn("not public", call["error"], host)
        self.assertEqual(accepted, [])


class Rebinding(WithWebhooks):
    """A name that means another machine at first and this one later. It runs where the test may say what names mean."""
    attempts = 1000
    NAMES = Path("/etc/hosts")

    @classmethod
    def setUpClass(cls):
        if os.environ.get("VARIMESH_OWN_NAMES"):
            return
        if subprocess.run(["unshare", "--mount", "--net", "true"], capture_output=True, timeout=20).returncode != 0:
            print("SKIPPED: this user may not have a network and names of its own (unshare --mount --net)")
            sys.exit(77)
        os.environ["VARIMESH_OWN_NAMES"] = "yes"
        os.execvp("unshare", ["unshare", "--mount", "--net", sys.executable, __file__, "Rebinding"])

    def setUp(self):
        names = subprocess.run(["mktemp"], capture_output=True, text=True, check=True, timeout=20).stdout.strip()
        self.addCleanup(os.unlink, names)
        for command in (["ip", "link", "set", "lo", "up"], ["ip", "address", "replace", "8.8.8.8/32", "dev", "lo"], ["mount", "--bind", names, str(self.NAMES)]):
            subprocess.run(command, check=True, timeout=20)
        self.addCleanup(subprocess.run, ["umount", str(self.NAMES)], check=True, timeout=20)
        super().setUp()

    def test_a_name_that_leads_home_later_leads_nowhere(self):
        receiver = self.receiver(200)
        port = receiver.origin.rsplit(":", 1)[1]
        accepted = []
        receiver.server.verify_request = lambda *arguments: accepted.append(arguments) or True
        self.NAMES.write_text("127.0.0.1 localhost\n8.8.8.8 hook.example\n")
        self.allow(f"https://hook.example:{port} {LINE_KEY}")
        time.sleep(1.5)
        job = self.make(f"https://hook.example:{port}/")
        deadline = time.monotonic() + 20
        while "no answer" not in (call := self.call_of(job, "WAITING")).get("error", ""):
            self.assertLess(time.monotonic(), deadline, call)
            time.sleep(0.05)
        self.NAMES.write_text("127.0.0.1 localhost hook.example\n")
        while "not public" not in (call := self.call_of(job, "WAITING")).get("error", ""):
            self.assertLess(time.monotonic(), deadline, call)
            time.sleep(0.05)
        self.assertEqual(accepted, [])

    def test_a_name_with_a_public_address_beside_another_is_called_there(self):
        self.NAMES.write_text("127.0.0.1 localhost\n::1 hook.example\n8.8.8.8 hook.example\n")
        certificate, key = self.certificate("DNS:hook.example")
        receiver = self.receiver(200, certificate=(certificate, key), address="8.8.8.8", name="hook.example")
        self.server.stop()
        self.allow(f"{receiver.origin} {LINE_KEY}")
        self.start("--webhook-authority", str(certificate))
        self.call_of(self.make(receiver.origin), "DELIVERED")


if __name__ == "__main__":
    unittest.main()
