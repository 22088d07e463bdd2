"""Meshes over HTTP (--http): there in one piece or after a cut, and results back, whole or in ranges.
ctest runs it with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in the environment."""
import hashlib
import time
import unittest

from over_http import BYTES, UNKNOWN, WithHttp
from programs import ENDLESS, LARGER, MESH, run


class Meshes(WithHttp):
    def upload(self, data, query="", headers=BYTES):
        return self.ask("POST", f"/v1/meshes?digest={hashlib.sha256(data).hexdigest()}{query}", data, headers)

    def download(self, path, **headers):
        connection = self.connection()
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
        head = (f"PUT /v1/meshes?digest={digest}&uploadId=mine HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/octet-stream\r\n"
                f"Content-Length: {size}\r\n\r\n").encode()
        asked = f"/v1/uploads/mine?digest={digest}"
        with self.dial(20) as connection:
            connection.sendall(head + data[:size // 2])
            deadline = time.monotonic() + 20  # a client that closes before the server has anything leaves nothing to go on from
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
        refused, slow = 0, []
        self.addCleanup(lambda: [one.close() for one in slow])
        for i in range(12):
            slow.append(self.dial(20))
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


if __name__ == "__main__":
    unittest.main(verbosity=2)
