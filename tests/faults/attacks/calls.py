"""Attacks by calls: those of an owner who has a token, and wants to take the server from the others."""
import contextlib
import ctypes
import hashlib
import random
import time

import grpc
from bystander import Owner
from programs import LARGER, MESH, run
from serving import until
from varimesh.v1 import job_pb2, mesh_pb2, optimise_pb2, service_pb2

ENDLESS = {"method": optimise_pb2.METHOD_SWEEPS, "tolerance": 1e-15, "max_iterations": 100_000, "active_set": False}


class Row:
    """A row of the table. `repeats`: how often the attack is made at most; None: until the time is over."""

    flags, tls, repeats = (), False, None

    def __init__(self, short):
        self.short = short

    def serve(self, attacked):
        """Begins with the server."""
        self.attacked = attacked
        self.mallory = attacked.owner("mallory")

    def attack(self):
        """One round. What is not refused or contained is an AssertionError."""

    def settle(self):
        """What must hold after the attack. Returns what is worth saying."""
        return ""

    def end(self):
        self.mallory.close()

    def refused(self, call, *codes):
        """The sentence with which the call is refused."""
        try:
            call()
        except grpc.RpcError as error:
            assert error.code() in codes, f"{error.code()}: {error.details()}"
            assert error.details() and len(error.details().encode()) <= 1024, f"{len(error.details())} letters of an error"
            assert error.details().isprintable(), repr(error.details())
            return error.details()
        raise AssertionError("it was not refused")


def varint(value):
    out = bytearray()
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    return bytes(out) + bytes([value])


def in_zstd(data):
    """A frame that states its size, by the library that the server has too."""
    library = ctypes.CDLL("libzstd.so.1")
    library.ZSTD_compress.restype = library.ZSTD_compressBound.restype = ctypes.c_size_t
    room = ctypes.create_string_buffer(library.ZSTD_compressBound(ctypes.c_size_t(len(data))))
    size = library.ZSTD_compress(room, ctypes.c_size_t(len(room)), data, ctypes.c_size_t(len(data)), 3)
    return room.raw[:size]


class Memory(Row):
    """A few kilobytes of zstd that are many empty parts, a file of 20,000 groups times 20,000 blocks, and a message in gzip."""

    name = "memory before admission"

    def serve(self, attacked):
        super().serve(attacked)
        part = mesh_pb2.MeshPart
        head = part(header=mesh_pb2.MeshHeader(dimension=2, order=1, nodes=3, node_set=mesh_pb2.NODE_SET_EQUISPACED))
        nodes = part(coordinates=mesh_pb2.NodeCoordinates(xyz=[0, 0, 0, 1, 0, 0, 0, 1, 0]))
        empty = part(elements=mesh_pb2.ElementPart(shape=mesh_pb2.SHAPE_TRIANGLE, entity=1)).SerializeToString()
        written = b"".join(varint(len(one)) + one for one in (head.SerializeToString(), nodes.SerializeToString()))
        self.parts = written + (varint(len(empty)) + empty) * 4_000_000
        self.chunks = [service_pb2.Chunk(offset=at, data=in_zstd(self.parts[at:at + (1 << 20)]), encoding=service_pb2.ENCODING_ZSTD)
                       for at in range(0, len(self.parts), 1 << 20)]
        many = 20_000
        self.blocks = ("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 1 0\n1 0 0 0 1 1 1 " + f"{many} " +
                       " ".join(str(i + 1) for i in range(many)) + " 0\n$EndEntities\n$Nodes\n1 3 1 3\n2 1 0 3\n1\n2\n3\n"
                       f"0 0 0\n1 0 0\n0 1 0\n$EndNodes\n$Elements\n{many + 1} 1 1 1\n2 1 2 1\n1 1 2 3\n" + "2 1 2 0\n" * many +
                       "$EndElements\n").encode()
        self.zeros = bytes(64 << 20)

    def attack(self):
        digest = self.mallory.upload(self.parts, self.chunks)
        jobs = [self.mallory.submit(digest, format=mesh_pb2.MESH_FORMAT_PARTS), self.mallory.submit(self.mallory.upload(self.blocks))]
        send = self.mallory.channel.unary_unary("/varimesh.v1.JobService/SubmitJob", request_serializer=bytes)
        self.refused(lambda: self.mallory.call(send, self.zeros, compression=grpc.Compression.Gzip), grpc.StatusCode.UNIMPLEMENTED)
        for job in jobs:
            ended = self.mallory.wait(job.name)
            assert ended.state == job_pb2.JOB_STATE_FAILED and ended.error.message, f"{ended.name} ended in state {ended.state}"
            self.sentence = ended.error.message

    def settle(self):
        return f"{sum(len(chunk.data) for chunk in self.chunks)} bytes of zstd are {len(self.parts) >> 20} MiB of parts; {self.sentence!r}"


class Strangers(Row):
    """Thirty-two connections without a token, which send 4 MiB of fields that nobody knows again and again, and stay open."""

    name = "strangers"

    def serve(self, attacked):
        super().serve(attacked)
        self.bomb = b"\xfa\xff\x03\x00" * ((4 << 20) // 4 - 16)
        self.channels = [grpc.insecure_channel(attacked.address, [("grpc.use_local_subchannel_pool", 1)]) for _ in range(32)]

    def attack(self):
        for method, code in (("/varimesh.v1.JobService/GetJob", grpc.StatusCode.UNAUTHENTICATED),
                             ("/grpc.health.v1.Health/Check", grpc.StatusCode.INVALID_ARGUMENT)):
            calls = [channel.unary_unary(method, request_serializer=bytes).future(self.bomb, timeout=60) for channel in self.channels]
            for call in calls:
                assert call.exception().code() == code, call.exception()

    def end(self):
        super().end()
        for channel in self.channels:
            channel.close()


class Ended(Row):
    """More jobs than the server remembers of an owner."""

    name = "results of others"
    repeats = 1

    def __init__(self, short):
        super().__init__(short)
        self.many, self.kept = (24, 20) if short else (1040, 1000)
        self.flags = ("--max-ended-jobs", str(self.kept), "--min-ended-age", "0")

    def serve(self, attacked):
        super().serve(attacked)
        self.ann = attacked.owner("ann")
        self.digest = self.ann.upload(MESH.read_bytes())
        self.job = self.ann.wait(self.ann.submit(self.digest, request_id="once").name)

    def attack(self):
        digest = self.mallory.upload(MESH.read_bytes())
        names = [self.mallory.submit(digest, max_iterations=1, labels={"number": str(i)}).name for i in range(self.many)]
        for name in names:
            try:
                self.mallory.wait(name)
            except grpc.RpcError as error:  # it has ended so long ago that it is forgotten
                assert error.code() == grpc.StatusCode.NOT_FOUND, error.details()

    def settle(self):
        again = self.ann.submit(self.digest, request_id="once")
        assert (again.name, again.attempt) == (self.job.name, 1), "the request ran again"
        assert self.ann.download(self.job.results[0].digest)
        until(lambda: self.mallory.list() <= self.kept)
        self.ann.close()
        return f"{self.many} jobs; the server remembers {self.mallory.list()} of them"


class Texts(Row):
    """Texts that are long or have control characters, and come back in errors, lists and the log."""

    name = "texts"
    EVIL = "\x1b[31m\r\njobs/0 forged \u202e"

    def attack(self):
        head = b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"
        for name in (b"x" * (6 << 20), self.EVIL.encode(), b"\x1b]0;title\x07" * 1000):
            ended = self.mallory.wait(self.mallory.submit(self.mallory.upload(head + b"$" + name)).name)
            text = ended.error.message
            assert ended.state == job_pb2.JOB_STATE_FAILED and text, ended.state
            assert len(text.encode()) <= 1024 and text.isprintable(), repr(text[:200])
        digest = self.mallory.upload(MESH.read_bytes())
        for labels in ({"a" * 100_000: "b"}, {"a": "b" * 3_000_000}, {self.EVIL: self.EVIL}, {str(i): "x" * 200 for i in range(2000)}):
            try:
                self.mallory.submit(digest, labels=labels, max_iterations=0)
            except grpc.RpcError as error:
                assert len(error.details().encode()) <= 1024 and error.details().isprintable(), repr(error.details()[:200])
        get = self.mallory.channel.unary_unary("/varimesh.v1.JobService/GetJob")
        self.refused(lambda: self.mallory.call(get, b"\x0a\x04\xff\xfe\xfd\xfc"), grpc.StatusCode.INVALID_ARGUMENT)  # no UTF-8
        self.refused(lambda: self.mallory.wait("jobs/" + self.EVIL * 1000), grpc.StatusCode.INVALID_ARGUMENT, grpc.StatusCode.NOT_FOUND)

    def settle(self):
        listed = self.mallory.list()
        done = run("jobs", "--server", self.attacked.address, "--token-file", self.token())
        assert done.returncode == 0, done.stderr
        forged = [line for text in (done.stdout, self.attacked.log()) for line in text.splitlines()
                  if not line.replace("\t", " ").isprintable() or line.startswith("jobs/0 forged") or len(line.encode()) > 2048]
        assert not forged, repr(forged[0][:200])
        assert "libprotobuf" not in self.attacked.log(), "the parser writes into the log"
        return f"{listed} jobs are listed, no line is forged or long"

    def token(self):
        path = self.attacked.folder / "mallory.token"
        path.write_text(self.attacked.tokens["mallory"])
        path.chmod(0o600)
        return path


class Disk(Row):
    """Uploads that would together take the disk; DirectoryUploads.CannotTakeTheReserveTogether has the reserve."""

    name = "disk"
    flags = ("--max-bytes-per-owner", str(64 << 20), "--compress-after", "0")

    def stored(self):
        total = 0
        for file in (self.attacked.state / "meshes").iterdir():
            with contextlib.suppress(FileNotFoundError):  # the server deletes meshes meanwhile
                total += file.stat().st_size if file.is_file() else 0
        return total

    def attack(self):
        before = self.stored()
        calls, meshes = [], random.Random(1)
        for _ in range(16):
            data = meshes.randbytes(1 << 20)
            header = service_pb2.UploadHeader(upload_id=data[:8].hex(), digest=data[:32].hex(), size=48 << 20)
            messages = [service_pb2.UploadMeshRequest(header=header), *(
                service_pb2.UploadMeshRequest(chunk=service_pb2.Chunk(offset=i << 20, data=data)) for i in range(47))]
            calls.append(self.mallory.meshes.UploadMesh.future(iter(messages), metadata=self.mallory.metadata, timeout=60))
        refused = [call.exception() for call in calls]
        assert sum("OWNER_FULL" in str(error.trailing_metadata()) for error in refused if error) >= 12, refused
        assert self.stored() - before <= 70 << 20, f"{(self.stored() - before) >> 20} MiB are stored"
        # An Optimise that is refused leaves nothing.
        left = {file.name for file in (self.attacked.state / "meshes").iterdir()}
        mesh = random.Random(2).randbytes(1 << 20)
        spec = service_pb2.OptimiseSpec(spec=job_pb2.JobSpec(options=optimise_pb2.Options(tolerance=1e-300)), size=len(mesh))
        messages = [service_pb2.OptimiseRequest(spec=spec), service_pb2.OptimiseRequest(chunk=service_pb2.Chunk(data=mesh))]
        self.refused(lambda: list(self.mallory.call(self.mallory.optimises.Optimise, iter(messages))),
                     grpc.StatusCode.INVALID_ARGUMENT, grpc.StatusCode.RESOURCE_EXHAUSTED)
        negative = service_pb2.OptimiseRequest(spec=service_pb2.OptimiseSpec(spec=job_pb2.JobSpec(), size=-1))
        self.refused(lambda: list(self.mallory.call(self.mallory.optimises.Optimise, iter([negative, messages[1]]))),
                     grpc.StatusCode.INVALID_ARGUMENT)
        more = {file.name for file in (self.attacked.state / "meshes").iterdir()} - left
        assert not any(name.startswith(hashlib.sha256(mesh).hexdigest()) for name in more), more

    def settle(self):
        return f"{self.stored() >> 20} MiB of meshes and uploads are stored"


class Downloads(Row):
    """A hundred downloads at a time, of the last byte of each of eight files of 128 MiB, which must be hashed first."""

    name = "downloads"
    flags = ("--compress-after", "0")

    def serve(self, attacked):
        super().serve(attacked)
        size = 8 << 20 if self.short else 128 << 20
        self.sizes = {self.mallory.upload(random.Random(i).randbytes(1 << 20) * (size >> 20)): size for i in range(8)}

    def attack(self):
        calls = [self.mallory.meshes.DownloadMesh(service_pb2.DownloadMeshRequest(digest=digest, offset=self.sizes[digest] - 1),
                                                  metadata=self.mallory.metadata, timeout=120)
                 for digest in (*self.sizes,) * 12]
        for call in calls:
            assert sum(len(message.chunk.data) for message in call) == 1


class Work(Row):
    """Jobs without an end, of the highest priority, a file with an element 400,000 times, and streams that stall."""

    name = "work"
    flags = ("--max-priority", "10", "--max-pending-jobs-per-peer", "100")

    def serve(self, attacked):
        super().serve(attacked)
        self.digest = self.mallory.upload(LARGER.read_bytes())
        many = 400_000
        self.repeats_file = ("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n3\n1 0 0 0\n2 1 0 0\n3 0 1 0\n$EndNodes\n" +
                             f"$Elements\n{many}\n" + "".join(f"{i} 2 2 {i} 1 1 2 3\n" for i in range(1, many + 1)) +
                             "$EndElements\n").encode()

    def attack(self):
        self.refused(lambda: self.mallory.submit(self.digest, tolerance=1e-300), grpc.StatusCode.INVALID_ARGUMENT)
        self.refused(lambda: self.mallory.submit(self.digest, priority=100, **ENDLESS), grpc.StatusCode.INVALID_ARGUMENT)
        jobs = [self.mallory.submit(self.digest, priority=10, **ENDLESS).name for _ in range(50)]
        repeated = self.mallory.submit(self.mallory.upload(self.repeats_file), max_iterations=0, priority=10).name
        # Streams that send nothing after their beginning; the mallory of each has a connection of its own.
        self.stalled = [Owner(**self.attacked.settings("mallory")) for _ in range(4)]
        self.stop = False
        for owner in self.stalled:
            for _ in range(25):
                owner.optimises.Optimise(self.beginning(), metadata=owner.metadata, timeout=60)
        until(lambda: self.mallory.call(self.mallory.jobs.GetJob, service_pb2.GetJobRequest(name=jobs[0])).job.iteration.number > 20)
        for name in jobs:
            self.mallory.cancel(name)
        ended = self.mallory.wait(repeated)
        assert ended.state in (job_pb2.JOB_STATE_SUCCEEDED, job_pb2.JOB_STATE_FAILED), ended.state
        self.took = (ended.end_time.ToMilliseconds() - ended.start_time.ToMilliseconds()) / 1000
        assert self.took < 20, f"400,000 repeats took {self.took} s"
        self.stop = True
        for owner in self.stalled:
            owner.close()

    def beginning(self):
        yield service_pb2.OptimiseRequest(spec=service_pb2.OptimiseSpec(spec=job_pb2.JobSpec(), size=1 << 20))
        until(lambda: self.stop, 60)

    def settle(self):
        return f"400,000 repeats of an element took {self.took:.1f} s"


class Blanks(Row):
    """A long small job, and behind it one whose file of blanks wants all memory to be read."""

    name = "memory queue"
    flags = ("--max-memory-bytes", str(512 << 20), "--max-running-jobs-per-peer", "2")
    repeats = 1

    def serve(self, attacked):
        super().serve(attacked)
        self.blanks = self.mallory.upload(b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n" + b" " * (190 << 20))

    def attack(self):
        small = self.mallory.submit(self.mallory.upload(LARGER.read_bytes()), threads=1, **ENDLESS)
        self.jobs = [small.name, self.mallory.submit(self.blanks).name]

    def settle(self):
        large = self.mallory.call(self.mallory.jobs.GetJob, service_pb2.GetJobRequest(name=self.jobs[1])).job
        assert large.state == job_pb2.JOB_STATE_RUNNING, f"the large job is in state {large.state}, so nobody has waited behind it"
        # The other owner begins a job only when the one before has ended.
        ann, begun = self.attacked.owner("ann"), time.monotonic()
        spec = ann.submit(ann.upload(MESH.read_bytes()), threads=1, priority=100)
        until(lambda: ann.call(ann.jobs.GetJob, service_pb2.GetJobRequest(name=spec.name)).job.state == job_pb2.JOB_STATE_SUCCEEDED, 10,
              "a small job of another owner has not run within 10 s")
        ann.close()
        took = time.monotonic() - begun
        for name in self.jobs:
            self.mallory.cancel(name)
        return f"a small job of another owner took {took:.2f} s beside the large one, which still waits"


ROWS = [Blanks, Memory, Strangers, Ended, Texts, Disk, Downloads, Work]
