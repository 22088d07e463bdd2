"""A job and its mesh in one form over HTTP (--http).
ctest runs it with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in the environment."""
import hashlib
import json
import re
import shutil
import subprocess
import time
import unittest
from pathlib import Path

from over_http import WithHttp
from programs import MESH


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
        done = subprocess.run(["curl", "-sS", "--fail-with-body", "-F", "spec=@spec.json", "-F", f"mesh=@{MESH}", f"{self.url}/v1/jobs"],
                              capture_output=True, text=True, timeout=30, cwd=self.folder)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.wait(json.loads(done.stdout)["job"]["name"].removeprefix("jobs/"), "JOB_STATE_SUCCEEDED")

    def test_a_large_mesh_is_not_held_in_memory(self):
        size = 300 << 20
        head = self.form(("spec", b"{}"))[:-len(f"--{self.BOUNDARY}--\r\n")] + f'--{self.BOUNDARY}\r\nContent-Disposition: form-data; name="mesh"\r\n\r\n'.encode()
        tail = f"\r\n--{self.BOUNDARY}--\r\n".encode()
        before = self.server_peak()
        with self.dial(60) as connection:
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


if __name__ == "__main__":
    unittest.main(verbosity=2)
