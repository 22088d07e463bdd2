"""Attacks by many at once: half-open connections, watches, deletions, large requests; and files that take long to read or write."""
import http.client
import re
import socket
import time

import grpc
from calls import ENDLESS, Row
from programs import LARGER, MESH
from serving import until
from varimesh.v1 import job_pb2, mesh_pb2, optimise_pb2, service_pb2


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
    """Twenty-four submissions over HTTP at a time, each with 4 MiB of JSON, beside another owner's requests over HTTP."""

    name = "bodies of JSON"
    flags = ("--http", "127.0.0.1:0")
    MANY = 24

    def serve(self, attacked):
        super().serve(attacked)
        self.place = attacked.http()
        many = 20_000 if self.short else 280_000
        labels = ",".join(f'"{i}":"x"' for i in range(many))
        self.bodies = [f'{{"labels":{{{labels}}}}}', f'{{"options":{{"fixNodes":[{",".join("1" * 7 * many)}]}}}}']
        self.refused = 0

    def ask(self, body):
        asking = http.client.HTTPConnection(self.place, timeout=60)
        asking.request("POST", "/v1/jobs", body,
                       {"Authorization": "Bearer " + self.attacked.tokens["mallory"], "Content-Type": "application/json"})
        return asking

    def attack(self):
        asked = [self.ask(self.bodies[i % 2]) for i in range(self.MANY)]
        for one in asked:
            status = one.getresponse().status
            assert status in (400, 429), status
            self.refused += status == 429
            one.close()

    def settle(self):
        return f"{self.refused} bodies were not read"


class Messages(Row):
    """Twenty-four submissions by gRPC at a time, each with 3 MiB of labels, by SubmitJob and by Optimise."""

    name = "large submissions"
    MANY = 24

    def serve(self, attacked):
        super().serve(attacked)
        labels = {str(i): "x" for i in range(20_000 if self.short else 240_000)}
        self.request = service_pb2.SubmitJobRequest(spec=job_pb2.JobSpec(labels=labels)).SerializeToString()
        self.submit = self.mallory.channel.unary_unary("/varimesh.v1.JobService/SubmitJob", request_serializer=bytes)
        self.optimise = self.mallory.channel.stream_stream("/varimesh.v1.OptimiseService/Optimise", request_serializer=bytes)
        spec = service_pb2.OptimiseSpec(spec=job_pb2.JobSpec(labels=labels))
        self.messages = [service_pb2.OptimiseRequest(spec=spec).SerializeToString(),
                         service_pb2.OptimiseRequest(chunk=service_pb2.Chunk(data=b"no mesh")).SerializeToString()]

    def attack(self):
        calls = [self.submit.future(self.request, metadata=self.mallory.metadata, timeout=60) for _ in range(self.MANY)]
        for call in calls:
            assert call.exception().code() == grpc.StatusCode.INVALID_ARGUMENT, call.exception()
        streams = [self.optimise(iter(self.messages), metadata=self.mallory.metadata, timeout=60) for _ in range(self.MANY)]
        for stream in streams:
            self.refused(lambda stream=stream: list(stream), grpc.StatusCode.INVALID_ARGUMENT)


class Unknown(Row):
    """A hundred streams at a time that send fields that nobody knows, which take ten times their size when they are parsed."""

    name = "unknown fields"
    MANY = 100

    def attack(self):
        for method in ("MeshService/SendMesh", "OptimiseService/Optimise"):
            for size in (1 << 20, 4 << 20):
                send = self.mallory.channel.stream_stream(f"/varimesh.v1.{method}", request_serializer=bytes)
                message = b"\xfa\xff\x03\x00" * (size // 4 - 64)
                streams = [send(iter([message]), metadata=self.mallory.metadata, timeout=60)
                           for _ in range(self.MANY // (10 if self.short else 1))]
                for stream in streams:
                    self.refused(lambda stream=stream: list(stream), grpc.StatusCode.INVALID_ARGUMENT)


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


class Groups(Row):
    """An element in very many groups, whose names begin alike, as CGNS: HDF5 takes a while for each of them."""

    name = "groups for HDF5"
    repeats = 1

    def serve(self, attacked):
        super().serve(attacked)
        formats = self.mallory.call(self.mallory.jobs.GetServerInfo, service_pb2.GetServerInfoRequest()).output_formats
        self.knows_cgns = mesh_pb2.MESH_FORMAT_CGNS in formats
        self.took = {}

    def submit(self, groups):
        tags = " ".join(str(i + 1) for i in range(groups))
        names = "".join(f'2 {i + 1} "{"g" * 40}"\n' for i in range(groups))
        mesh = ("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n" + f"$PhysicalNames\n{groups}\n{names}$EndPhysicalNames\n"
                f"$Entities\n0 0 1 0\n1 0 0 0 1 1 1 {groups} {tags} 0\n$EndEntities\n$Nodes\n1 3 1 3\n2 1 0 3\n1\n2\n3\n"
                "0 0 0\n1 0 0\n0 1 0\n$EndNodes\n$Elements\n1 1 1 1\n2 1 2 1\n1 1 2 3\n$EndElements\n")
        spec = job_pb2.JobSpec(outputs=[mesh_pb2.MESH_FORMAT_CGNS], options=optimise_pb2.Options(threads=1))
        spec.mesh.digest = self.mallory.upload(mesh.encode())
        return self.mallory.call(self.mallory.jobs.SubmitJob, service_pb2.SubmitJobRequest(spec=spec)).job.name

    def attack(self):
        if not self.knows_cgns:
            return
        few, many = (500, 2_000) if self.short else (16_000, 150_000)
        begun = time.monotonic()
        ended = self.mallory.wait(self.submit(few))
        self.took["16,000 groups" if few == 16_000 else "few groups"] = time.monotonic() - begun
        assert ended.state == job_pb2.JOB_STATE_SUCCEEDED, f"{ended.state}: {ended.error.message}"
        name = self.submit(many)
        until(lambda: self.mallory.call(self.mallory.jobs.GetJob, service_pb2.GetJobRequest(name=name)).job.state !=
              job_pb2.JOB_STATE_PENDING)
        time.sleep(0 if self.short else 3)
        self.mallory.cancel(name)
        begun = time.monotonic()
        self.mallory.wait(name)
        self.took["the cancel of a write"] = time.monotonic() - begun
        assert max(self.took.values()) < 30, self.took

    def settle(self):
        return ", ".join(f"{what} took {seconds:.1f} s" for what, seconds in self.took.items()) or "there is no HDF5"


ROWS = [HalfOpen, Bodies, Messages, Unknown, Watches, Deletions, Tag, Groups]
