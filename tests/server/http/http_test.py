"""Calls over HTTP with JSON (--http): the same answers as by gRPC, for the same callers, and nothing for pages of other sites.
ctest runs it with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in the environment."""
import concurrent.futures
import hashlib
import http.client
import json
import os
import re
import shutil
import socket
import subprocess
import time
import unittest
from pathlib import Path

from over_http import JSON, WithHttp
from programs import ENDLESS, LARGER, MESH, VARIMESHD, run

UNKNOWN = "jobs/" + "0" * 32
# Every call, as a method and a path; JOB stands for the number of a job.
CALLS = [("GET", "/v1/info"), ("POST", "/v1/jobs"), ("GET", "/v1/jobs"), ("GET", "/v1/jobs/JOB"), ("POST", "/v1/jobs/JOB/cancel"),
         ("DELETE", "/v1/jobs/JOB"), ("GET", "/v1/jobs/JOB/result"), ("GET", "/v1/jobs/JOB/events?after=99999999999"), ("POST", "/v1/meshes?digest=" + "0" * 64),
         ("GET", "/v1/uploads/one?digest=" + "0" * 64)]
DOCUMENT = ("GET", "/v1/openapi.json")
BYTES = {"Content-Type": "application/octet-stream"}


class Calls(WithHttp):
    def test_a_job_from_its_submission_to_its_end(self):
        first = self.wait(self.submit(), "JOB_STATE_SUCCEEDED")
        code, submitted = self.ask("POST", "/v1/jobs?requestId=once", first["spec"])
        self.assertEqual(code, 200, submitted)
        name = submitted["job"]["name"]
        self.assertEqual(self.ask("POST", "/v1/jobs?requestId=once", first["spec"])[1]["job"]["name"], name, "the same request")
        again = self.wait(name.removeprefix("jobs/"), "JOB_STATE_SUCCEEDED")
        self.assertEqual([result["digest"] for result in again["results"]], [result["digest"] for result in first["results"]])
        listed = self.ask("GET", "/v1/jobs?states=JOB_STATE_SUCCEEDED&pageSize=1")[1]
        self.assertEqual([job["name"] for job in listed["jobs"]], [name])
        more = self.ask("GET", f"/v1/jobs?states=JOB_STATE_SUCCEEDED&pageSize=1&pageToken={listed['nextPageToken']}")[1]
        self.assertEqual([job["name"] for job in more["jobs"]], [first["name"]])
        self.assertEqual(self.ask("GET", "/v1/jobs?states=JOB_STATE_RUNNING")[1], {})
        self.assertEqual(self.ask("DELETE", f"/v1/{name}"), (200, {}))
        self.assertEqual(self.reason("GET", f"/v1/{name}"), (404, "JOB_NOT_FOUND"))

    def test_labels_choose_jobs(self):
        spec = self.wait(self.submit(), "JOB_STATE_SUCCEEDED")["spec"]
        spec["labels"] = {"wing": "left & right"}
        name = self.ask("POST", "/v1/jobs", spec)[1]["job"]["name"]
        self.assertEqual([job["name"] for job in self.ask("GET", "/v1/jobs?labels.wing=left+%26%20right")[1]["jobs"]], [name])
        self.assertEqual(self.ask("GET", "/v1/jobs?labels.wing=none")[1], {})

    def test_cancels(self):
        job = self.submit(LARGER, *ENDLESS)
        self.wait(job, "JOB_STATE_RUNNING")
        self.assertEqual(self.ask("POST", f"/v1/jobs/{job}/cancel")[0], 200)
        self.wait(job, "JOB_STATE_CANCELLED")

    def test_says_what_the_server_is(self):
        code, info, headers = self.ask("GET", "/v1/info", raw=True)
        self.assertEqual(code, 200)
        self.assertIn("MESH_FORMAT_VTU", info["outputFormats"])
        self.assertEqual(headers["X-Content-Type-Options"], "nosniff")
        self.assertIsNone(headers["Access-Control-Allow-Origin"])

    def test_says_the_sentences_of_grpc(self):
        by_grpc = run("cancel", UNKNOWN, "--server", self.server.address).stderr
        code, document = self.ask("POST", f"/v1/{UNKNOWN}/cancel")
        self.assertEqual((code, document["code"]), (404, 5))
        self.assertIn(document["message"].rstrip("."), by_grpc)
        self.assertEqual(document["details"][0]["@type"], "type.googleapis.com/google.rpc.ErrorInfo")
        spec = {"mesh": {"digest": "a" * 64}}
        self.assertEqual(self.reason("POST", "/v1/jobs", spec), (400, "MESH_NOT_FOUND"))
        self.assertEqual(self.reason("POST", "/v1/jobs", {**spec, "options": {"maxIterations": -5}})[0], 400)

    def test_checks_without_submitting(self):
        spec = self.wait(self.submit(), "JOB_STATE_SUCCEEDED")["spec"]
        self.assertEqual(self.ask("POST", "/v1/jobs?validateOnly=true", spec)[0], 200)
        self.assertEqual(len(self.ask("GET", "/v1/jobs")[1]["jobs"]), 1)

    def test_the_lines_of_the_page(self):
        if shutil.which("curl") is None or shutil.which("jq") is None:
            self.skipTest("there is no curl or no jq")
        page = (Path(os.environ["VARIMESH_SOURCE_DIR"]) / "docs" / "http.md").read_text()
        lines = [line for block in re.findall(r"```sh\n(.*?)```", page, re.S)[1:] for line in block.splitlines()]
        self.assertGreater(len(lines), 11)
        shutil.copy(MESH, self.folder / "mesh.msh")
        script = "\n".join(["set -e -o pipefail", "set -x", *(line.replace("curl ", "curl --fail-with-body ") for line in lines)])
        done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, cwd=self.folder, timeout=60,
                              env={**os.environ, "HTTP": f"http://{self.http}"})
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        local = self.folder / "local.vtu"
        self.assertEqual(run("optimise", MESH, "-o", local).returncode, 0)
        self.assertEqual((self.folder / "better.vtu").read_bytes(), local.read_bytes())

    def test_with_curl(self):
        if shutil.which("curl") is None:
            self.skipTest("there is no curl")
        spec = self.wait(self.submit(), "JOB_STATE_SUCCEEDED")["spec"]

        def curl(*arguments):
            done = subprocess.run(["curl", "-sS", "--fail-with-body", *arguments], capture_output=True, text=True, timeout=30)
            return done.returncode, json.loads(done.stdout)

        code, submitted = curl("--json", json.dumps(spec), f"http://{self.http}/v1/jobs")
        self.assertEqual(code, 0, submitted)
        self.assertEqual(curl(f"http://{self.http}/v1/{submitted['job']['name']}")[0], 0)
        self.assertEqual(curl("-X", "POST", f"http://localhost:{self.http.rsplit(':')[1]}/v1/{UNKNOWN}/cancel")[0], 22)


class Meshes(WithHttp):
    def upload(self, data, query="", headers=BYTES):
        return self.ask("POST", f"/v1/meshes?digest={hashlib.sha256(data).hexdigest()}{query}", data, headers)

    def download(self, path, **headers):
        connection = http.client.HTTPConnection(self.http, timeout=30)
        self.addCleanup(connection.close)
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        return answer.status, answer.read(), answer.headers

    def test_a_mesh_there_and_its_result_back(self):
        data = MESH.read_bytes()
        digest = hashlib.sha256(data).hexdigest()
        for _ in range(2):
            stored = self.upload(data)[1]
            self.assertEqual((stored["digest"], stored["size"]), (digest, str(len(data))))
        formats = ["MESH_FORMAT_MSH41", "MESH_FORMAT_VTU"]
        job = self.ask("POST", "/v1/jobs", {"mesh": {"digest": digest}, "outputs": formats})[1]["job"]["name"]
        self.wait(job.removeprefix("jobs/"), "JOB_STATE_SUCCEEDED")
        for format, ending in zip(formats, ("msh", "vtu")):
            code, got, headers = self.download(f"/v1/{job}/result?format={format}")
            self.assertEqual(code, 200, got[:300])
            name = ("msh41" if ending == "msh" else "vtu")
            local = self.folder / f"local.{ending}"
            done = run("optimise", MESH, "-o", local, "--format", name)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(got, local.read_bytes(), format)
            self.assertEqual(headers["ETag"].strip('"'), hashlib.sha256(got).hexdigest())
            code, rest, headers = self.download(f"/v1/{job}/result?format={format}", Range="bytes=1000-")
            self.assertEqual((code, rest), (206, got[1000:]))
            self.assertEqual(headers["Content-Range"], f"bytes 1000-{len(got) - 1}/{len(got)}")
            self.check_ranges(f"/v1/{job}/result?format={format}", got)
        self.assertEqual(self.ask("GET", f"/v1/{job}/result")[0], 400, "there are two")
        self.assertEqual(self.ask("GET", f"/v1/{job}/result?format=MESH_FORMAT_SU2")[0], 400)
        self.assertEqual(self.reason("GET", f"/v1/{UNKNOWN}/result"), (404, "JOB_NOT_FOUND"))

    def check_ranges(self, path, whole):
        size = len(whole)
        for range, first, end in (("5-9", 5, 10), ("0-0", 0, 1), ("0-", 0, size), ("-7", size - 7, size), (f"-{size + 5}", 0, size),
                                  (f"{size - 1}-", size - 1, size), (f"10-{size + 99}", 10, size), ("3-9223372036854775807", 3, size)):
            code, part, headers = self.download(path, Range=f"bytes={range}")
            self.assertEqual((code, part, headers["Content-Range"]), (206, whole[first:end], f"bytes {first}-{end - 1}/{size}"), range)
        for range in (f"{size}-", f"{size + 5}-{size + 9}", "-0", "9223372036854775807-"):
            code, _, headers = self.download(path, Range=f"bytes={range}")
            self.assertEqual((code, headers["Content-Range"]), (416, f"bytes */{size}"), range)
        for range in ("bytes=9-5", "bytes=0-1,5-6", "bytes=", "bytes=-", "bytes=x-", "bytes=--5", "lines=0-5", "bytes=99999999999999999999-"):
            self.assertEqual(self.download(path, Range=range)[:2], (200, whole), range)
        tag = f'"{hashlib.sha256(whole).hexdigest()}"'
        self.assertEqual(self.download(path, **{"Range": "bytes=5-9", "If-Range": tag})[0], 206)
        self.assertEqual(self.download(path, **{"Range": "bytes=5-9", "If-Range": '"another"'})[:2], (200, whole))

    def test_a_job_without_a_result(self):
        job = self.submit(LARGER, *ENDLESS)
        self.assertEqual(self.reason("GET", f"/v1/jobs/{job}/result"), (400, "JOB_NOT_SUCCEEDED"))

    def test_a_cut_upload_goes_on(self):
        data = bytes(range(256)) * 12000
        digest, size = hashlib.sha256(data).hexdigest(), len(data)
        host, port = self.http.rsplit(":", 1)
        head = (f"PUT /v1/meshes?digest={digest}&uploadId=mine HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/octet-stream\r\n"
                f"Content-Length: {size}\r\n\r\n").encode()
        with socket.create_connection((host, int(port)), 20) as connection:
            connection.sendall(head + data[:size // 2])
        asked = f"/v1/uploads/mine?digest={digest}"
        deadline = time.monotonic() + 20
        while (code := self.ask("GET", asked)[0]) != 200 or not self.ask("GET", asked)[1]:
            self.assertLess(time.monotonic(), deadline, code)
            time.sleep(0.05)
        time.sleep(0.5)  # what is on its way arrives
        have = int(self.ask("GET", asked)[1]["committedSize"])
        self.assertGreater(have, 0)
        self.assertLessEqual(have, size // 2)
        code, stored = self.ask("POST", f"/v1/meshes?digest={digest}&uploadId=mine&offset={have}", data[have:], BYTES)
        self.assertEqual((code, stored["digest"]), (200, digest), stored)
        self.assertEqual(self.ask("GET", asked)[1]["complete"], True)

    def test_refuses_what_is_no_upload(self):
        data = b"not a mesh" * 100
        digest = hashlib.sha256(data).hexdigest()
        self.assertEqual(self.reason("POST", f"/v1/meshes?digest={'0' * 64}", data, BYTES), (400, "DIGEST_MISMATCH"))
        self.assertEqual(self.reason("POST", "/v1/meshes", data, BYTES)[0], 400)
        self.assertEqual(self.reason("POST", "/v1/meshes?digest=../../etc", data, BYTES)[0], 400)
        self.assertEqual(self.upload(data, "&offset=-5")[0], 400)
        self.assertEqual(self.upload(data, "&offset=99")[1]["details"][0]["reason"], "WRONG_OFFSET")
        self.assertEqual(self.upload(data, "&offset=9223372036854775807")[0], 400)
        self.assertEqual(self.upload(data, "&owner=bob")[0], 400)
        self.assertEqual(self.upload(data, "&uploadId=" + "a" * 200)[0], 400)
        for type in ("text/plain", "application/json", "multipart/form-data", ""):
            self.assertEqual(self.upload(data, headers={"Content-Type": type})[0], 400, type)
        self.assertEqual(self.reason("GET", f"/v1/uploads/none?digest={digest}"), (404, "UPLOAD_NOT_FOUND"))
        self.still_answers()

    def test_transfers_leave_threads_to_others(self):
        """One address has eight transfers under way at most, however slow they are."""
        head = (b"POST /v1/meshes?digest=%s&uploadId=%d HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/octet-stream\r\n"
                b"Content-Length: 100000\r\n\r\n")
        host, port = self.http.rsplit(":", 1)
        refused, slow = 0, []
        self.addCleanup(lambda: [one.close() for one in slow])
        for i in range(12):
            slow.append(socket.create_connection((host, int(port)), 20))
            slow[-1].sendall(head % (b"0" * 64, i))
            time.sleep(0.02)
        for one in slow:
            one.settimeout(0.2)
            try:
                refused += b" 429 " in one.recv(65536)
            except TimeoutError:
                pass
        self.assertEqual(refused, 4)
        self.assertEqual(self.ask("GET", "/v1/info")[0], 200)


class Forms(WithHttp):
    """A job and its mesh in one request."""

    BOUNDARY = "~~here~~"

    def form(self, *parts, boundary=BOUNDARY, end="--\r\n"):
        text = b""
        for name, data in parts:
            text += f'--{boundary}\r\nContent-Disposition: form-data; name="{name}"; filename="name=x"\r\n\r\n'.encode() + data + b"\r\n"
        return text + f"--{boundary}{end}".encode()

    def post(self, body, query="", type=f"multipart/form-data; boundary={BOUNDARY}", **headers):
        return self.ask("POST", "/v1/jobs" + query, body, {"Content-Type": type, **headers})

    def test_a_job_with_its_mesh(self):
        mesh = MESH.read_bytes()
        code, told = self.post(self.form(("spec", b"{}"), ("mesh", mesh)), "?requestId=once")
        self.assertEqual(code, 200, told)
        name = told["job"]["name"]
        done = self.wait(name.removeprefix("jobs/"), "JOB_STATE_SUCCEEDED")
        self.assertEqual(done["spec"]["mesh"]["digest"], hashlib.sha256(mesh).hexdigest())
        self.assertEqual(self.post(self.form(("spec", b"{}"), ("mesh", mesh)), "?requestId=once")[1]["job"]["name"], name)
        known = json.dumps(done["spec"]).encode()
        self.assertEqual(self.post(self.form(("spec", known), ("mesh", mesh)))[0], 200, "with the right digest")
        self.assertEqual(self.reason("POST", "/v1/jobs", self.form(("spec", known), ("mesh", mesh + b"\n")),
                                     {"Content-Type": f"multipart/form-data; boundary={self.BOUNDARY}"}), (400, "DIGEST_MISMATCH"))

    def test_whatever_bytes_the_mesh_has(self):
        """Beginnings of the boundary in the mesh, and at the ends of pieces."""
        almost = b"\r\n--" + self.BOUNDARY.encode()[:-1]
        mesh = MESH.read_bytes()
        head, _, tail = mesh.partition(b"$Nodes")
        comment = b"$Comments\n%s\n$EndComments\n"
        for filler in (almost * 3, b"\r" * 70000, almost * 100000, b"x" * ((1 << 20) - 200) + almost * 40):
            data = head + comment % filler + b"$Nodes" + tail
            told = self.post(self.form(("spec", b"{}"), ("mesh", data)))[1]
            known = self.ask("GET", "/v1/" + told["job"]["name"])[1]["job"]
            self.assertEqual(known["spec"]["mesh"]["digest"], hashlib.sha256(data).hexdigest())

    def test_forms_that_are_none(self):
        mesh = MESH.read_bytes()
        good = self.form(("spec", b"{}"), ("mesh", mesh))
        for what, body in (("the mesh first", self.form(("mesh", mesh), ("spec", b"{}"))), ("no mesh", self.form(("spec", b"{}"))),
                           ("no spec", self.form(("mesh", mesh))), ("three parts", self.form(("spec", b"{}"), ("mesh", mesh), ("more", b""))),
                           ("two meshes", self.form(("spec", b"{}"), ("mesh", mesh), ("mesh", mesh))), ("no JSON", self.form(("spec", b"{"), ("mesh", mesh))),
                           ("no end", self.form(("spec", b"{}"), ("mesh", mesh), end="")), ("cut", good[:-30]), ("nothing", b""),
                           ("another boundary", self.form(("spec", b"{}"), ("mesh", mesh), boundary="other")),
                           ("a part without a name", good.replace(b'name="mesh"', b"")), ("an open name", good.replace(b'name="mesh"; filename="name=x"', b'name="mesh')),
                           ("a long header", good.replace(b"Content-Disp", b"X: " + b"a" * 9000 + b"\r\nContent-Disp")),
                           ("a spec that is too large", self.form(("spec", b" " * (5 << 20)), ("mesh", mesh)))):
            with self.subTest(what):
                self.assertEqual(self.post(body)[0], 400)
        for type in ("multipart/form-data", "multipart/form-data; boundary=", "multipart/form-data; boundary=" + "a" * 71, "multipart/mixed; boundary=x"):
            self.assertEqual(self.post(good, type=type)[0], 400, type)
        self.assertEqual(self.post(good, "?validateOnly=true")[0], 400)
        self.assertEqual(self.post(good, Origin="http://evil.example")[0], 403)
        self.assertEqual(self.ask("GET", "/v1/jobs")[1], {}, "no job was made")
        self.still_answers()

    def test_with_curl(self):
        if shutil.which("curl") is None:
            self.skipTest("there is no curl")
        (self.folder / "spec.json").write_text('{"outputs": ["MESH_FORMAT_VTU"]}')
        done = subprocess.run(["curl", "-sS", "--fail-with-body", "-F", "spec=@spec.json", "-F", f"mesh=@{MESH}", f"http://{self.http}/v1/jobs"],
                              capture_output=True, text=True, timeout=30, cwd=self.folder)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.wait(json.loads(done.stdout)["job"]["name"].removeprefix("jobs/"), "JOB_STATE_SUCCEEDED")

    def test_a_large_mesh_is_not_held_in_memory(self):
        host, port = self.http.rsplit(":", 1)
        size = 300 << 20
        head = self.form(("spec", b"{}"))[:-len(f"--{self.BOUNDARY}--\r\n")] + f'--{self.BOUNDARY}\r\nContent-Disposition: form-data; name="mesh"\r\n\r\n'.encode()
        tail = f"\r\n--{self.BOUNDARY}--\r\n".encode()
        before = self.server_peak()
        with socket.create_connection((host, int(port)), 60) as connection:
            connection.sendall((f"POST /v1/jobs HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: multipart/form-data; boundary={self.BOUNDARY}\r\n"
                                f"Content-Length: {len(head) + size + len(tail)}\r\n\r\n").encode() + head)
            for _ in range(300):
                connection.sendall(bytes(1 << 20))
            connection.sendall(tail)
            self.assertIn(b" 200 OK", connection.recv(65536))
        self.assertLess(self.server_peak() - before, 64 << 20)

    def server_peak(self):
        """The most memory that the server has had, in bytes."""
        status = Path(f"/proc/{self.server.process.pid}/status").read_text()
        return int(re.search(r"VmHWM:\s+(\d+) kB", status)[1]) << 10


class FormLimits(Forms):
    test_a_job_with_its_mesh = test_whatever_bytes_the_mesh_has = test_with_curl = test_forms_that_are_none = None
    test_a_large_mesh_is_not_held_in_memory = None

    def flags(self):
        return ("--max-mesh-bytes", "2000000")

    def test_a_mesh_that_is_too_large(self):
        """The refusal comes before all of the mesh has."""
        begun = time.monotonic()
        code, told = self.post(self.form(("spec", b"{}"), ("mesh", bytes(6 << 20))))
        self.assertEqual((code, told["details"][0]["reason"]), (429, "MESH_TOO_LARGE"))
        self.assertLess(time.monotonic() - begun, 20)
        self.still_answers()


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
        for path in ("/", "/v1", "/v1/", "/v1/jobsx", "/v2/jobs", "/etc/passwd", "/v1/jobs/../../../etc/passwd",
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
        own = {"Origin": f"http://{self.http}", "Sec-Fetch-Site": "same-origin"}
        self.assertEqual(self.ask("GET", "/v1/info", headers=own)[0], 200)

    def test_slow_clients_do_not_hold_others_up(self):
        host, port = self.http.rsplit(":", 1)
        slow = []
        self.addCleanup(lambda: [one.close() for one in slow])
        for i in range(40):
            slow.append(socket.create_connection((host, int(port)), 20))
            slow[-1].sendall((b"", b"POST /v1/jobs HTTP/1.1\r\nHost: ", b"POST /v1/jobs HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: "
                              b"application/json\r\nContent-Length: 1000\r\n\r\n{")[i % 3])
        for _ in range(5):
            begun = time.monotonic()
            self.assertEqual(self.ask("GET", "/v1/info")[0], 200)
            self.assertLess(time.monotonic() - begun, 2)
        codes = [one.recv(4096).split(b" ")[1] for one in slow[2::3]]
        self.assertEqual((codes.count(b"400"), codes.count(b"429")), (4, 9), "four bodies were waited for, and given up")

    def test_addresses_that_others_reach(self):
        for address in ("0.0.0.0:0", "10.0.0.1:80", "8080", ":8080", "example.org:80"):
            done = subprocess.run([VARIMESHD, "--listen", "127.0.0.1:0", "--http", address], capture_output=True, text=True, timeout=20)
            self.assertEqual(done.returncode, 2, address)
            self.assertIn("--http 127.0.0.1:8080", done.stderr)


class Slow(WithHttp):
    """Those who send bytes one at a time have no place for longer than others."""

    def drip(self, head, seconds, byte=b"x"):
        """Sends a byte every half second. Returns what came, and after how long."""
        host, port = self.http.rsplit(":", 1)
        begun = time.monotonic()
        with socket.create_connection((host, int(port)), 1) as connection:
            connection.sendall(head)
            connection.settimeout(0.5)
            while time.monotonic() - begun < seconds:
                try:
                    connection.sendall(byte)
                    return connection.recv(65536), time.monotonic() - begun
                except TimeoutError:
                    pass
                except OSError:
                    return b"", time.monotonic() - begun
        self.fail(f"the server still waits after {seconds} s")

    def test_bodies(self):
        digest = "0" * 64
        requests = [f"POST /v1/jobs HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: {type}\r\nContent-Length: {size}\r\n\r\n".encode()
                    for type, size in (("application/json", 4000), ("application/json", 4000000), ("multipart/form-data; boundary=x", 1 << 30))]
        requests.append(f"PUT /v1/meshes?digest={digest} HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/octet-stream\r\n"
                        f"Content-Length: {1 << 30}\r\n\r\n".encode())
        with concurrent.futures.ThreadPoolExecutor() as pool:
            for came, seconds in pool.map(lambda head: self.drip(head, 50), requests):
                self.assertRegex(came, rb"^HTTP/1.1 (400|409) ")
                self.assertGreater(seconds, 20)
        self.still_answers()

    def test_an_upload_may_pause(self):
        data = MESH.read_bytes()
        host, port = self.http.rsplit(":", 1)
        with socket.create_connection((host, int(port)), 20) as connection:
            connection.sendall(f"PUT /v1/meshes?digest={hashlib.sha256(data).hexdigest()} HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: "
                               f"application/octet-stream\r\nContent-Length: {len(data)}\r\n\r\n".encode() + data[:500])
            time.sleep(7)
            connection.sendall(data[500:])
            self.assertIn(b" 200 OK", connection.recv(65536))

    def test_headers(self):
        heads = (b"", b"GET /v1/info HTTP/1.1\r\nHost: 127.0.0.1\r\n", b"GET /v1/info HTTP/1.1\r\nHost: 127.0.0.1\r\nX: ")
        with concurrent.futures.ThreadPoolExecutor() as pool:
            for came, seconds in pool.map(lambda head: self.drip(head, 10), heads):
                self.assertNotIn(b" 200 ", came)
        self.still_answers()

    def test_headers_without_an_end(self):
        host, port = self.http.rsplit(":", 1)
        for line in (b"X: " + b"a" * 1000 + b"\r\n", b"a" * 1000):
            sent = 0
            with socket.create_connection((host, int(port)), 10) as connection:
                connection.sendall(b"GET /v1/info HTTP/1.1\r\nHost: 127.0.0.1\r\n")
                try:
                    while sent < 50 << 20:
                        connection.sendall(line)
                        sent += len(line)
                except OSError:
                    pass
            self.assertLess(sent, 20 << 20, "the server reads on and on")
        self.still_answers()

    def test_readers(self):
        """Who watches and takes no byte does not hold others up."""
        job = self.submit(LARGER, *ENDLESS)
        host, port = self.http.rsplit(":", 1)
        slow = []
        self.addCleanup(lambda: [one.close() for one in slow])
        for _ in range(20):
            one = socket.socket()
            one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            one.connect((host, int(port)))
            one.sendall(f"GET /v1/jobs/{job}/events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
            slow.append(one)
        for _ in range(5):
            begun = time.monotonic()
            self.assertEqual(self.ask("GET", "/v1/info")[0], 200)
            self.assertLess(time.monotonic() - begun, 2)
            time.sleep(0.5)


class Callers(WithHttp):
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
        host, port = self.http.rsplit(":", 1)
        with socket.create_connection((host, int(port)), 20) as connection:
            connection.sendall(head)
            self.assertIn(b" 401 ", connection.recv(65536), "no byte of the body has come")
        self.assertLess(time.monotonic() - begun, 1.5)

    def test_roles(self):
        job = self.submit_as("ann")
        sends = {CALLS[1], *CALLS[8:]}
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
        for method, path in CALLS[3:8]:
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


class Limits(WithHttp):
    def flags(self):
        return ("--max-submissions-per-peer", "3")

    def test_the_limits_of_a_peer_count_both_ways(self):
        spec = self.wait(self.submit(), "JOB_STATE_SUCCEEDED")["spec"]
        for _ in range(2):
            self.assertEqual(self.ask("POST", "/v1/jobs", spec)[0], 200)
        code, document, headers = self.ask("POST", "/v1/jobs", spec, raw=True)
        self.assertEqual((code, document["details"][0]["reason"]), (429, "PEER_LIMIT"))
        self.assertGreater(int(headers["Retry-After"]), 0)
        forged = {**JSON, "varimesh-address": "10.0.0.1", "X-Forwarded-For": "10.0.0.1"}
        self.assertEqual(self.ask("POST", "/v1/jobs", spec, forged)[0], 429)


if __name__ == "__main__":
    unittest.main(verbosity=2)
