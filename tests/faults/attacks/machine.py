"""Attacks on the connections of the server, and damage to its files."""
import hashlib
import itertools
import os
import resource
import shutil
import subprocess
import sys
import time
import uuid
from pathlib import Path

import grpc
import http2_floods
from calls import Row
from connections import allow_many, open_connections
from programs import MESH, VARIMESHD, run
from serving import until
from varimesh.v1 import job_pb2, service_pb2

SOURCE = Path(os.environ["VARIMESH_SOURCE_DIR"])


class Transport(Row):
    """Frames of HTTP/2 from somebody without a certificate."""

    name = "transport floods, mutual TLS"
    tls = True

    def __init__(self, short):
        super().__init__(short)
        self.sent = self.connections = 0

    def attack(self):
        for kind in http2_floods.FLOODS:
            attackers = http2_floods.start(self.attacked.address, self.attacked.folder / "authority.pem", kind, 0.5 if self.short else 3)
            sent, connections = http2_floods.totals(attackers)
            self.sent, self.connections = self.sent + sent, self.connections + connections

    def settle(self):
        assert self.connections > 10, "it was no flood"
        return f"{self.connections} connections, {self.sent} messages written"


class Nginx(Row):
    name = "transport floods, nginx"
    alone = True  # the test starts its own server and its own working owner

    def run(self):
        """Returns the exit status, and what the test says of each flood."""
        done = subprocess.run([sys.executable, SOURCE / "tests/deploy/nginx_test.py", "Nginx.test_floods_stop_at_it"],
                              capture_output=True, text=True, env={**os.environ, **({} if self.short else {"VARIMESH_MEASURE": "1"})})
        lines = [line for line in done.stderr.splitlines() if "connections; p99" in line]
        return done.returncode, lines or (done.stdout + done.stderr).splitlines()[-3:]


class Stops(Row):
    name = "SIGTERM"
    alone = True  # others are not served while the server is away

    def run(self):
        program = Path(VARIMESHD).parents[1] / "tests/faults/stop_server"
        if not program.exists():
            return 77, [f"{program} is not built"]
        done = subprocess.run([program, *(["--stops", "2"] if self.short else [])], capture_output=True, text=True)
        return done.returncode, done.stdout.splitlines()[-1:]


class Descriptors(Row):
    """Connections that stay and uploads that are cut, at a server with few descriptors."""

    name = "descriptors"
    MANY = 256

    def serve(self, attacked):
        super().serve(attacked)
        resource.prlimit(attacked.server.process.pid, resource.RLIMIT_NOFILE, (self.MANY, self.MANY))
        allow_many()
        self.data = os.urandom(1 << 16)

    def attack(self):
        """1,000 connections that stay, from an address of the attacker's own, and a thousand uploads that are cut."""
        opened = open_connections(self.attacked.address, "127.0.0.2", 1000)
        time.sleep(1 if self.short else 5)
        # Another connection of somebody who was not there before.
        new = self.attacked.owner("ann")
        assert new.list() >= 0
        new.close()
        for one in opened:
            one.close()
        for _ in range(100 if self.short else 1000):
            header = service_pb2.UploadHeader(upload_id=uuid.uuid4().hex, digest=hashlib.sha256(os.urandom(8)).hexdigest(), size=1 << 20)
            messages = [service_pb2.UploadMeshRequest(header=header), service_pb2.UploadMeshRequest(chunk=service_pb2.Chunk(data=self.data))]
            self.mallory.meshes.UploadMesh.future(itertools.chain(messages, self.hold()), metadata=self.mallory.metadata, timeout=0.05)

    def hold(self):
        time.sleep(0.1)
        yield from ()

    def settle(self):
        if os.geteuid() != 0:
            return "only root sees the descriptors of a server"
        taken = len(list(Path(f"/proc/{self.attacked.server.process.pid}/fd").iterdir()))
        assert taken < self.MANY / 2, f"{taken} descriptors are taken"
        return f"{taken} of {self.MANY} descriptors are taken afterwards"


class Store(Row):
    """A disk that loses bytes."""

    name = "store"
    flags = ("--compress-after", "0")

    def attack(self):
        """A blob is cut, changed, and deleted while the server runs; each time it is refused, and sent again."""
        data = MESH.read_bytes() + f"$Comments\n{uuid.uuid4().hex}\n$EndComments\n".encode()
        digest = self.mallory.upload(data)
        blob = next(file for file in (self.attacked.state / "meshes").iterdir() if file.name.startswith(digest) and not file.suffix)
        for damage in (lambda: os.truncate(blob, 100), lambda: flip(blob), blob.unlink):
            damage()
            self.refused(lambda: self.mallory.download(digest), grpc.StatusCode.DATA_LOSS, grpc.StatusCode.NOT_FOUND)
            try:
                ended = self.mallory.wait(self.mallory.submit(digest).name)
                assert ended.state == job_pb2.JOB_STATE_FAILED and ended.error.message, ended.state
            except grpc.RpcError as error:
                assert error.code() in (grpc.StatusCode.NOT_FOUND, grpc.StatusCode.FAILED_PRECONDITION), error
            assert self.mallory.upload(data) == digest and self.mallory.download(digest) == data
        ended = self.mallory.wait(self.mallory.submit(digest).name)
        assert ended.state == job_pb2.JOB_STATE_SUCCEEDED, ended.error.message

    def settle(self):
        assert self.attacked.alive()
        return "a cut, a changed and a deleted blob were refused, and taken again"


def flip(path):
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


class Files(Row):
    """What other users and other servers of the machine could put in the way."""

    name = "files"

    def attack(self):
        flags = self.attacked.flags[2:]
        tokens = flags[flags.index("--tokens"):][:2]

        def refused(*flags):
            done = subprocess.run([VARIMESHD, "--listen", "127.0.0.1:0", *tokens, *flags], capture_output=True, text=True, timeout=30)
            assert done.returncode in (1, 2) and done.stderr.strip(), (flags, done)
            return done.stderr

        refused("--state", self.attacked.state)  # another server uses it
        lock = self.attacked.state / "lock"
        lock.unlink(missing_ok=True)
        refused("--state", self.attacked.state)
        # Meshes without a database of their jobs.
        alone = self.attacked.folder / "alone"
        (alone / "meshes").mkdir(parents=True, mode=0o700)
        alone.chmod(0o700)
        (alone / "meshes" / hashlib.sha256(b"mesh").hexdigest()).write_bytes(b"mesh")
        assert "restore" in refused("--state", alone)
        shutil.rmtree(alone)
        theirs = self.attacked.folder / "theirs"
        theirs.mkdir(exist_ok=True)
        theirs.chmod(0o777)
        refused("--state", theirs)  # others may write into it
        if os.geteuid() == 0:
            theirs.chmod(0o700)
            os.chown(theirs, 65534, 65534)
            refused("--state", theirs)
        shutil.rmtree(theirs)
        secret = Path("/etc/passwd").read_bytes()
        digest = hashlib.sha256(secret).hexdigest()
        link = self.attacked.state / "meshes" / digest
        link.symlink_to("/etc/passwd")
        self.refused(lambda: self.mallory.download(digest), grpc.StatusCode.NOT_FOUND, grpc.StatusCode.DATA_LOSS)
        link.unlink()
        # A unix socket that another server has.
        path = self.attacked.folder / "socket"
        first = subprocess.Popen([VARIMESHD, "--listen", f"unix:{path}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        until(path.exists)
        second = subprocess.run([VARIMESHD, "--listen", f"unix:{path}"], capture_output=True, text=True, timeout=30)
        assert second.returncode == 1 and "socket" in second.stderr, second.stderr
        assert run("jobs", "--server", f"unix:{path}").returncode == 0
        first.terminate()
        first.wait(20)

    def settle(self):
        return "a link, folders of others, and a socket and a directory in use were refused"


ROWS = [Transport, Nginx, Descriptors, Stops, Store, Files]
