"""The log for programs: what its lines are about, audit, and the traces of calls."""
import hashlib
import importlib.util
import json
import unittest

from operators import environment, varimeshd, wait_until
from programs import ENDLESS, LARGER, MESH, Server, WithFolder, run

TRACE = "4bf92f3577b34da6a3ce929d0e0e4736"


class Logs(WithFolder):
    def setUp(self):
        super().setUp()
        file = self.folder / "tokens"

        def make(name, *roles):
            flags = [word for role in roles for word in ("--role", role)]
            return varimeshd("token", name, "--tokens", file, *flags).stdout.strip()

        self.ann, self.reader = make("ann"), make("bob", "read")
        self.server = Server("--tokens", str(file), "--log-format", "json", "--threads", "1")
        self.stopped = False
        self.addCleanup(lambda: self.stopped or self.server.stop())

    def call(self, token, *arguments):
        return run(*arguments, "--server", self.server.address, env=environment(VARIMESH_TOKEN=token))

    def lines(self):
        self.stopped = True
        self.server.stop()
        return [json.loads(line) for line in self.server.log]

    def test_every_line_is_an_object_and_says_what_it_is_about(self):
        job = self.call(self.ann, "submit", MESH).stdout.strip()
        self.assertEqual(self.call(self.ann, "watch", job).returncode, 0)
        lines = self.lines()
        for line in lines:
            self.assertRegex(line["time"], r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z$")
            self.assertIn(line["level"], ("info", "warning"))
            self.assertNotIn(self.ann, json.dumps(line))
        about = [line for line in lines if line.get("job") == job and "audit" not in line]
        self.assertEqual([line["message"].removeprefix(job + " ") for line in about],
                         ["submitted", "started, attempt 1", "JOB_STATE_SUCCEEDED"])
        self.assertEqual([line["owner"] for line in about], ["ann"] * 3)
        self.assertEqual([line.get("attempt") for line in about], [None, 1, 1])

    def test_what_people_do_is_written_down(self):
        job = self.call(self.ann, "submit", LARGER, *ENDLESS).stdout.strip()
        self.assertNotEqual(self.call(self.reader, "cancel", job).returncode, 0)
        self.assertNotEqual(self.call("vm_wrong", "jobs").returncode, 0)
        self.assertNotEqual(self.call(self.ann, "submit", MESH, "--priority", "101").returncode, 0)
        self.assertEqual(self.call(self.ann, "cancel", job).returncode, 0)
        self.call(self.ann, "watch", job)
        self.assertEqual(self.call(self.ann, "delete", job).returncode, 0)
        audit = [line for line in self.lines() if "audit" in line]
        done = [(line["audit"], line["outcome"], line.get("owner"), line.get("job")) for line in audit]
        for expected in (("submit", "ok", "ann", job), ("refused", "RIGHT_MISSING", "bob", None),
                         ("refused", "TOKEN_UNKNOWN", None, None), ("cancel", "ok", "ann", job),
                         ("delete", "ok", "ann", job)):
            self.assertIn(expected, done)
        self.assertEqual({line["address"] for line in audit}, {"127.0.0.1"})
        refused = next(line for line in audit if line["outcome"] == "RIGHT_MISSING")
        self.assertIn("CancelJob", refused["message"])

    @unittest.skipUnless(importlib.util.find_spec("grpc"), "python3-grpcio is missing (deploy/setup test)")
    def test_jobs_keep_the_trace_of_their_call(self):
        import grpc

        self.call(self.ann, "submit", MESH)  # uploads the mesh
        digest = hashlib.sha256(MESH.read_bytes()).hexdigest()
        mesh = b"\x0a" + bytes([len(digest)]) + digest.encode() + b"\x10\x01"  # a MeshRef: digest, MSH 2.2
        spec = b"\x0a" + bytes([len(mesh)]) + mesh
        request = b"\x12" + bytes([len(spec)]) + spec
        with grpc.insecure_channel(self.server.address) as channel:
            call = channel.unary_unary("/varimesh.v1.JobService/SubmitJob")
            for parent in (f"00-{TRACE}-00f067aa0ba902b7-01", "00-not-a-trace-01"):
                call(request, timeout=20, metadata=(("authorization", "Bearer " + self.ann), ("traceparent", parent)))
        wait_until(lambda: sum("SUCCEEDED" in line for line in self.server.log) == 3)
        traces = [line.get("trace_id") for line in self.lines() if "SUCCEEDED" in line["message"]]
        self.assertEqual((traces.count(TRACE), traces.count(None)), (1, 2))


if __name__ == "__main__":
    unittest.main(verbosity=2)
