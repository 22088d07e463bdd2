"""Attacks by many at once: half-open connections, watches, deletions; and a tag of XML without an end."""
import http.client
import re
import socket
import time

import grpc
from calls import ENDLESS, Row
from programs import LARGER, MESH
from serving import until
from varimesh.v1 import job_pb2, service_pb2


class HalfOpen(Row):
    """Forty connections that send half a request, or nothing, to each of the HTTP ports."""

    name = "half-open connections"
    flags = ("--admin", "127.0.0.1:0", "--metrics", "127.0.0.1:0")
    MANY = 40

    def serve(self, attacked):
        super().serve(attacked)
        self.ports = until(lambda: (found := re.findall(r"http://(127\.0\.0\.1:\d+)/", attacked.log()))[1:] and found)
        self.silent, self.slowest = [], 0

    def attack(self):
        self.end_connections()
        for place in self.ports[:2]:
            host, port = place.split(":")
            for i in range(self.MANY):
                self.silent.append(socket.create_connection((host, int(port)), 20))
                self.silent[-1].sendall(b"GET /healthz/live HTTP/1.1\r\nHost: 127.0.0.1\r\n" if i % 2 else b"")
            begun = time.monotonic()
            asking = http.client.HTTPConnection(place, timeout=20)
            asking.request("GET", "/healthz/live")
            assert asking.getresponse().status == 200
            asking.close()
            self.slowest = max(self.slowest, time.monotonic() - begun)
        assert self.slowest < 8, f"a probe took {self.slowest:.1f} s"

    def settle(self):
        self.end_connections()
        return f"the slowest probe took {self.slowest:.2f} s"

    def end_connections(self):
        for one in self.silent:
            one.close()
        self.silent = []


class Bodies(Row):
    """Twenty-four submissions over HTTP at a time, each with 4 MiB of JSON, beside another owner's requests."""

    name = "bodies of JSON"
    flags = ("--http", "127.0.0.1:0")
    MANY = 24

    def serve(self, attacked):
        super().serve(attacked)
        self.place = until(lambda: (found := re.findall(r"http://(127\.0\.0\.1:\d+)/v1/", attacked.log())) and found[0])
        labels = ",".join(f'"{i}":"x"' for i in range(20_000 if self.short else 280_000))
        self.body = f'{{"labels":{{{labels}}}}}'
        self.slowest, self.refused = 0, 0

    def ask(self, owner, method, path, body=None):
        asking = http.client.HTTPConnection(self.place, timeout=60)
        asking.request(method, path, body, {"Authorization": "Bearer " + self.attacked.tokens[owner], "Content-Type": "application/json"})
        return asking

    def attack(self):
        asked = [self.ask("mallory", "POST", "/v1/jobs", self.body) for _ in range(self.MANY)]
        begun = time.monotonic()
        assert self.ask("ann", "GET", "/v1/info").getresponse().status == 200
        self.slowest = max(self.slowest, time.monotonic() - begun)
        for one in asked:
            status = one.getresponse().status
            assert status in (400, 429), status
            self.refused += status == 429
            one.close()
        assert self.slowest < 8, f"another owner's request took {self.slowest:.1f} s"

    def settle(self):
        return f"another owner's request took {self.slowest:.2f} s at most; {self.refused} bodies were not read"


class Watches(Row):
    """Watches of the health without a token, on eight connections."""

    name = "watches of the health"
    flags = ("--max-watches-per-peer", "200")
    MANY = 100  # on each

    def attack(self):
        channels = [grpc.insecure_channel(self.attacked.address, [("grpc.use_local_subchannel_pool", 1)]) for _ in range(8)]
        calls = [channel.unary_stream("/grpc.health.v1.Health/Watch", request_serializer=bytes)(b"", timeout=60)
                 for channel in channels for _ in range(self.MANY)]
        time.sleep(0.3)
        refused = [call for call in calls if not call.is_active()]
        assert all(call.code() == grpc.StatusCode.RESOURCE_EXHAUSTED for call in refused), {call.code() for call in refused}
        assert refused, "all of them were let in"
        self.open = len(calls) - len(refused)
        for channel in channels:
            channel.close()

    def settle(self):
        return f"{self.open} of {8 * self.MANY} stayed open"


class Deletions(Row):
    """Sixty-four deletions at a time of a mesh that 1,600 waiting jobs have."""

    name = "deletions"
    flags = ("--max-pending-jobs", "4000", "--max-pending-jobs-per-peer", "2000", "--max-submissions-per-peer", "0")

    def serve(self, attacked):
        super().serve(attacked)
        self.first = self.mallory.submit(self.mallory.upload(LARGER.read_bytes()), threads=1, **ENDLESS).name
        until(lambda: self.mallory.call(self.mallory.jobs.GetJob, service_pb2.GetJobRequest(name=self.first)).job.state ==
              job_pb2.JOB_STATE_RUNNING)
        self.digest = self.mallory.upload(MESH.read_bytes())
        for _ in range(100 if self.short else 1600):
            self.mallory.submit(self.digest, threads=1)

    def attack(self):
        request = service_pb2.DeleteMeshRequest(digest=self.digest)
        calls = [self.mallory.meshes.DeleteMesh.future(request, metadata=self.mallory.metadata, timeout=60) for _ in range(64)]
        for call in calls:
            assert call.exception().code() == grpc.StatusCode.FAILED_PRECONDITION, call.exception()

    def settle(self):
        return f"{self.mallory.list()} jobs have the mesh"


class Tag(Row):
    """A file of XML that is one tag, with a time limit, and one that is cancelled."""

    name = "a tag without an end"
    repeats = 1

    def serve(self, attacked):
        super().serve(attacked)
        size = 8 << 20 if self.short else 84 << 20
        self.digest = self.mallory.upload(b'<?xml version="1.0"?>\n<VTKFile type="' + b"a" * size)

    def attack(self):
        begun = time.monotonic()
        ended = self.mallory.wait(self.mallory.submit(self.digest, threads=1, time_limit=5).name)
        self.took = time.monotonic() - begun
        assert ended.state == job_pb2.JOB_STATE_FAILED and ended.error.message, ended.state
        assert self.took < 15, f"a job with a limit of 5 s took {self.took:.1f} s"
        name = self.mallory.submit(self.digest, threads=1).name
        self.mallory.cancel(name)
        begun = time.monotonic()
        self.mallory.wait(name)
        assert time.monotonic() - begun < 10, "a cancel was not looked at"

    def settle(self):
        return f"it was refused after {self.took:.1f} s"


ROWS = [HalfOpen, Bodies, Watches, Deletions, Tag]
