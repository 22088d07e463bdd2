"""Meshes to the server and back, going on where a broken connection stopped."""
from __future__ import annotations

import hashlib
import os
import stat
import tempfile
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Protocol

import grpc

from .connection import Connection, Patience, Stop
from .errors import ServerUnreachable
from .v1 import service_pb2, service_pb2_grpc

CHUNK = 256 * 1024


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
    """A file; a pipe or a device is read to its end first."""

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


def upload(connection: Connection, stub: service_pb2_grpc.MeshServiceStub, source: Source) -> str:
    """Brings a mesh, unless it is there already; its digest."""
    stop = Stop.of_this_thread()
    digest, size = hashlib.sha256(), 0
    for _, data in _chunks(source, 0):
        stop.check()
        digest.update(data)
        size += len(data)
    header = service_pb2.UploadHeader(upload_id=uuid.uuid4().hex, digest=digest.hexdigest(), size=size)
    query = service_pb2.QueryUploadRequest(upload_id=header.upload_id, digest=header.digest)
    connection.meet()
    patience = Patience(connection, connection.bulk)
    committed = 0
    while True:
        try:
            known = stub.QueryUpload(query, timeout=30, metadata=connection.metadata)
        except grpc.RpcError as error:
            if error.code() != grpc.StatusCode.NOT_FOUND:
                patience.again(error)
                continue
            known = service_pb2.QueryUploadResponse()
        if known.complete:
            return header.digest
        # A connection that breaks again and again is worth the full time as long as bytes arrive.
        if known.committed_size > committed:
            patience.reset()
        committed = known.committed_size

        def requests(offset: int = committed) -> Iterator[service_pb2.UploadMeshRequest]:
            yield service_pb2.UploadMeshRequest(header=header)
            for at, data in _chunks(source, offset):
                yield service_pb2.UploadMeshRequest(chunk=service_pb2.Chunk(offset=at, data=data))

        try:
            connection.upload(stub.UploadMesh, requests)
            return header.digest
        except grpc.FutureCancelledError:
            stop.check()
        except grpc.RpcError as error:
            patience.again(error)


def download(connection: Connection, stub: service_pb2_grpc.MeshServiceStub, digest: str,
             take: Callable[[bytes], object]) -> None:  # fmt: skip
    """Delivers the bytes of a mesh to `take`, in order, and raises where they are not those of the digest."""
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
        raise ServerUnreachable("The bytes that came are not those of the mesh; fetch it again.", "DIGEST_MISMATCH")


def write_file(path: str | os.PathLike[str], fill: Callable[[Callable[[bytes], object]], None]) -> None:
    """A file that takes its name only once it is whole; a link stays a link, and a file that is replaced keeps its
    rights."""
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
