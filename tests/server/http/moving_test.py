"""The mesh of a running job over HTTP (GET /v1/jobs/ID/mesh) and over gRPC (DownloadMeshRequest.job). ctest runs it with VARIMESH,
VARIMESHD and VARIMESH_SOURCE_DIR in the environment, and with the Python package of the build tree."""
import sys
import time
import unittest

from over_http import UNKNOWN, WithHttp
from programs import ENDLESS, LARGER, MESH

try:
    import grpc
    from google.protobuf.internal.decoder import _DecodeVarint32 as read_varint
    from varimesh.v1 import mesh_pb2, service_pb2, service_pb2_grpc
except ModuleNotFoundError as missing:
    print(f"SKIPPED: {missing} (deploy/setup test)", flush=True)
    sys.exit(77)


def read_parts(text):
    """The coordinates of a mesh, the number of its cells and the numbers and answers of their quality."""
    nodes, coordinates, numbers, answers, at = 0, [], [], [], 0
    while at < len(text):
        size, at = read_varint(text, at)
        part = mesh_pb2.MeshPart.FromString(text[at:at + size])
        at += size
        if part.HasField("header"):
            nodes = part.header.nodes
        coordinates += part.coordinates.xyz
        numbers += part.cell_quality.numbers
        answers += part.cell_quality.answers
    assert len(coordinates) == 3 * nodes
    return coordinates, numbers, answers


class Moving(WithHttp):
    def look(self, job):
        connection = self.connection()
        self.addCleanup(connection.close)
        connection.request("GET", f"/v1/jobs/{job}/mesh")
        answer = connection.getresponse()
        return answer.status, answer.read()

    def wait_for_mesh(self, job, before=None):
        deadline = time.monotonic() + 30
        while True:
            code, text = self.look(job)
            if code == 200 and text != before:
                return text
            self.assertIn(code, (200, 204))
            self.assertLess(time.monotonic(), deadline, code)
            time.sleep(0.05)

    def run_endless(self):
        job = self.submit(LARGER, *ENDLESS)
        self.wait(job, "JOB_STATE_RUNNING")
        return job

    def stub(self):
        channel = grpc.insecure_channel(self.server.address)
        self.addCleanup(channel.close)
        return service_pb2_grpc.MeshServiceStub(channel)

    def test_is_shown_while_somebody_asks(self):
        job = self.run_endless()
        time.sleep(1.5)
        self.assertEqual(self.look(job), (204, b""), "nobody has asked before")
        first = self.wait_for_mesh(job)
        coordinates, numbers, answers = read_parts(first)
        job_spec = self.ask("GET", f"/v1/jobs/{job}")[1]["job"]
        moved, same_numbers, _ = read_parts(self.wait_for_mesh(job, first))
        self.assertEqual((len(moved), same_numbers), (len(coordinates), numbers))
        self.assertNotEqual(moved, coordinates)
        self.assertEqual(len(answers), len(numbers))
        self.assertEqual(len(set(numbers)), len(numbers))
        self.assertGreater(job_spec["iteration"]["number"], 0)
        begun, looks = time.monotonic(), set()
        while time.monotonic() - begun < 2:
            looks.add(self.look(job)[1])
        self.assertLessEqual(len(looks), 6, "at most twice per second")
        self.ask("POST", f"/v1/jobs/{job}/cancel")
        self.wait(job, "JOB_STATE_CANCELLED")
        self.assertEqual(self.look(job), (204, b""))

    def test_comes_by_grpc_too(self):
        job = self.run_endless()
        stub, name = self.stub(), f"jobs/{job}"
        self.wait_for_mesh(job)
        pieces = [one.chunk.data for one in stub.DownloadMesh(service_pb2.DownloadMeshRequest(job=name))]
        self.assertGreater(len(read_parts(b"".join(pieces))[1]), 100)
        for request in ({"job": name, "offset": 1}, {"job": name, "digest": "0" * 64}):
            with self.assertRaises(grpc.RpcError) as refused:
                list(stub.DownloadMesh(service_pb2.DownloadMeshRequest(**request)))
            self.assertEqual(refused.exception.code(), grpc.StatusCode.INVALID_ARGUMENT)
        with self.assertRaises(grpc.RpcError) as refused:
            list(stub.DownloadMesh(service_pb2.DownloadMeshRequest(job=UNKNOWN)))
        self.assertEqual(refused.exception.code(), grpc.StatusCode.NOT_FOUND)

    def test_of_a_job_that_does_not_run(self):
        job = self.submit(MESH)
        self.wait(job, "JOB_STATE_SUCCEEDED")
        for _ in range(3):
            self.assertEqual(self.look(job), (204, b""))
        self.assertEqual(self.reason("GET", f"/v1/{UNKNOWN}/mesh"), (404, "JOB_NOT_FOUND"))
        self.assertEqual(self.ask("GET", f"/v1/jobs/{job}/mesh?offset=5")[0], 400)
        running = self.run_endless()
        waiting = self.submit(LARGER, *ENDLESS)
        self.assertEqual(self.look(waiting), (204, b""))
        self.assertEqual(len(read_parts(self.wait_for_mesh(running))[1]) > 0, True)


if __name__ == "__main__":
    unittest.main(verbosity=2)
