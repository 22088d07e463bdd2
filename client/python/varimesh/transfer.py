"""Uploads and downloads of meshes, and the files of both. Transfers resume at the place where a connection broke."""
from __future__ import annotations

import hashlib
import os
import stat
import tempfile
import threading
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any, Protocol

import grpc

from .connection import Connection, Patience, Stop
from .errors import BadOutput, ServerUnreachable
from .v1 import service_pb2, service_pb2_grpc

CHUNK = 256 * 1024
PIECE = CHUNK // 2  # one piece is on its way while the server stores another


class Source(Protocol):
    """Bytes that can be read from any offset, as often as needed."""

    def read(self, offset: int, most: int) -> bytes: ...


class BytesSource:
    """Bytes in memory."""

    def __init__(self, data: bytes) -> None:
        self._data = memoryview(data)

    def read(self, offset: int, most: int) -> bytes:
        return bytes(self._data[offset : offset + most])


class FileSource:
    """A file. A pipe or a device is first read to its end."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._file: IO[bytes] = open(path, "rb")
        if not stat.S_ISREG(os.fstat(self._file.fileno()).st_mode):
            with self._file as stream:
                self._file = tempfile.TemporaryFile()
                while piece := stream.read(CHUNK):
                    self._file.write(piece)
            self._file.flush()

    def read(self, offset: int, most: int) -> bytes:
        return os.pread(self._file.fileno(), most, offset)

    def close(self) -> None:
        self._file.close()


def _chunks(source: Source, offset: int) -> Iterator[tuple[int, bytes]]:
    while data := source.read(offset, CHUNK):
        yield offset, data
        offset += len(data)


class _Sending:
    """One attempt at an upload. gRPC's thread takes the requests. It waits while a chunk is on its way that the server
    has not acknowledged, so at most that chunk has to be sent again after a break."""

    def __init__(self, header: service_pb2.UploadHeader, source: Source) -> None:
        self._header, self._source = header, source
        self._committed, self._ended = -1, False
        self._changed = threading.Condition()

    def acknowledge(self, committed: int) -> None:
        with self._changed:
            self._committed = committed
            self._changed.notify()

    def end(self) -> None:
        with self._changed:
            self._ended = True
            self._changed.notify()

    def _may_send(self, beyond: int) -> bool:
        with self._changed:
            self._changed.wait_for(lambda: self._ended or self._committed >= beyond)
            return not self._ended

    def requests(self) -> Iterator[service_pb2.SendMeshRequest]:
        yield service_pb2.SendMeshRequest(header=self._header)
        self._may_send(0)
        sent = self._committed
        while self._may_send(sent + PIECE - CHUNK) and (data := self._source.read(sent, PIECE)):
            yield service_pb2.SendMeshRequest(chunk=service_pb2.Chunk(offset=sent, data=data))
            sent += len(data)


def upload(connection: Connection, stub: service_pb2_grpc.MeshServiceStub, source: Source) -> str:
    """Uploads a mesh, unless the server has it already. Returns its digest."""
    stop = Stop.of_this_thread()
    digest, size = hashlib.sha256(), 0
    for _, data in _chunks(source, 0):
        stop.check()
        digest.update(data)
        size += len(data)
    header = service_pb2.UploadHeader(upload_id=uuid.uuid4().hex, digest=digest.hexdigest(), size=size)
    connection.meet()
    patience = Patience(connection, connection.bulk)
    committed = 0
    while True:
        sending = _Sending(header, source)
        try:
            with connection.stream(stub.SendMesh, sending.requests()) as call:
                for response in call:
                    if response.HasField("mesh"):
                        return header.digest
                    # A connection that breaks again and again gets the full time again as long as bytes arrive.
                    if response.committed_size > committed:
                        patience.reset()
                    committed = response.committed_size
                    sending.acknowledge(committed)
        except grpc.RpcError as error:
            patience.again(error)
        finally:
            sending.end()


def download(connection: Connection, stub: service_pb2_grpc.MeshServiceStub, digest: str,
             take: Callable[[bytes], object]) -> None:  # fmt: skip
    """Passes the bytes of a mesh to `take`, in order. Raises ServerUnreachable if they do not have the digest."""
    connection.meet()
    patience = Patience(connection, connection.bulk)
    came = hashlib.sha256()
    request = service_pb2.DownloadMeshRequest(digest=digest)
    while True:
        with connection.stream(stub.DownloadMesh, request) as call:
            try:
                for response in call:
                    data = response.chunk.data
                    take(data)
                    came.update(data)
                    request.offset += len(data)
                    patience.reset()
                break
            except grpc.RpcError as raised:
                error = raised
        patience.again(error)
    if came.hexdigest() != digest:
        raise ServerUnreachable("The mesh arrived damaged; fetch it again.", "DIGEST_MISMATCH")


def write_file(path: str | os.PathLike[str], fill: Callable[[Callable[[bytes], object]], None]) -> None:
    """Writes a file that takes its name only when it is complete. A link stays a link, and a file that is replaced keeps
    its permissions."""
    target = Path(os.path.realpath(path))
    mode = target.stat().st_mode if target.exists() else None
    if mode is not None and not stat.S_ISREG(mode):
        with open(target, "wb") as stream:  # a pipe or a device
            fill(stream.write)
        return
    beside = tempfile.NamedTemporaryFile(dir=target.parent, prefix=f".{target.name}.", delete=False)
    try:
        with beside:
            fill(beside.write)
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(beside.name, stat.S_IMODE(mode) if mode is not None else 0o666 & ~mask)
        os.replace(beside.name, target)
    except BaseException:
        os.unlink(beside.name)
        raise


# ===== files =====


def file_label(path: str | os.PathLike[str]) -> str:
    """The name of a file as the value of a label, which has at most 128 bytes; a longer name loses its beginning."""
    name = os.fsencode(os.path.basename(os.fspath(path))).decode("utf-8", "replace")
    return name.encode()[-128:].decode("utf-8", "ignore")


def check_writable(path: str | os.PathLike[str]) -> None:
    """Raises BadOutput if a file cannot be written, before any work is done."""
    target = os.path.realpath(path)
    folder = os.path.dirname(target)
    if os.path.isdir(target):
        raise BadOutput(f"{os.fspath(path)} is a folder; name a file in it.")
    if not os.path.isdir(folder):
        raise BadOutput(f"{os.fspath(path)} cannot be written: there is no folder {folder}; make it, or name another.")
    if not os.access(target if os.path.exists(target) else folder, os.W_OK):
        raise BadOutput(f"{os.fspath(path)} cannot be written: this user may not write there; name another place.")


def is_msh(path: Any) -> bool:
    """Whether a mesh file may be one of Gmsh's, so that a .msh may have its format. Nothing is read from a pipe."""
    try:
        if not os.path.isfile(path):
            return True
        with open(path, "rb") as file:
            begin = file.read(4096).lstrip()
            return not begin.startswith((b"MFEM ", b"<"))
    except OSError:
        return True
