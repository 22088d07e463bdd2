"""The client of a server."""
from __future__ import annotations

import os
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import TracebackType
from typing import Any, TypeAlias, Unpack

import grpc

from . import reports, transfer
from .adapters import as_mesh
from .connection import Connection, Patience, Stop
from .errors import BadOption, JobCancelled, JobFailed, Stopped
from .job import Job, Result
from .mesh import to_parts
from .names import spellings, suggestion
from .options import Options, to_message
from .progress import Progress
from .reports import Event, Quality, ServerInfo
from .v1 import job_pb2, mesh_pb2, service_pb2, service_pb2_grpc
from .watching import watch

#: A file's path, a Mesh, (nodes, cells), a meshio mesh, or the module gmsh.
MeshLike: TypeAlias = Any
Paths: TypeAlias = "str | os.PathLike[str] | Sequence[str | os.PathLike[str]]"


class Client:
    """The client of one server. Any thread may call it. A call repeats itself while the server is away.

    `address` is HOST:PORT or unix:PATH. `token` is sent with every call; a server that has no tokens ignores it. Use it
    only on connections that others cannot read: loopback, or with `credentials`. `connect` is how many seconds to wait
    for the first contact, `retry` for a server that went away.
    """

    def __init__(self, address: str, token: str | None = None, *, credentials: grpc.ChannelCredentials | None = None,
                 connect: float = 5.0, retry: float = 60.0) -> None:  # fmt: skip
        self.address = address
        self._connection = Connection(address, token, credentials, connect, retry)
        self._jobs = service_pb2_grpc.JobServiceStub(self._connection.control)  # type: ignore[no-untyped-call]
        self._meshes = service_pb2_grpc.MeshServiceStub(self._connection.bulk)  # type: ignore[no-untyped-call]

    def close(self) -> None:
        """Closes the connection. Jobs continue."""
        self._connection.close()

    def __enter__(self) -> Client:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:  # fmt: skip
        self.close()

    # ===== one call for everything =====

    def optimise(self, mesh: MeshLike, output: Paths | None = None, *, format: str | None = None,
                 progress: bool = False, on_event: Callable[[Event], object] | None = None,
                 arrays: bool | None = None, request_id: str | None = None, labels: Mapping[str, str] | None = None,
                 priority: int = 0, **options: Unpack[Options]) -> Result:  # fmt: skip
        """Optimises a mesh and waits for the result.

        `output` names files to write (.msh in `format`, .vtu). `arrays` says whether the result should have its mesh in
        arrays. By default it has, unless the mesh comes from a file and goes to files. Ctrl-C cancels the job.

        Raises JobFailed, JobCancelled (by somebody else), Refused, ServerUnreachable, BadOption or BadMesh. It
        is no error if elements of the result are not certified valid; `result.valid` says whether all are.
        """
        paths = _paths(output)
        mesh = mesh if _is_path(mesh) else as_mesh(mesh)
        wanted = [_format_of(path, format, _is_path(mesh)) for path in paths]
        if arrays or (arrays is None and not (paths and _is_path(mesh))):
            wanted += ["as-read"] if _is_path(mesh) and not paths else []
            wanted.append("parts")
        job = self.submit(mesh, outputs=list(dict.fromkeys(wanted)), request_id=request_id, labels=labels,
                          priority=priority, **options)  # fmt: skip
        show = Progress(options.get("tolerance") or 1e-3) if progress else None
        try:
            for event in job.watch():
                for take in (show, on_event):
                    if take is not None:
                        take(event)
        except (KeyboardInterrupt, Stopped):
            self._cancel_quietly(job)
            raise
        if job.state == "cancelled":
            raise JobCancelled(f"Somebody else cancelled {job.name}.", job.name)
        result = job.result()
        for path in paths:
            result.save(path, format=format)
        return result

    def quality(self, mesh: MeshLike, **options: Unpack[Options]) -> Quality:
        """The quality of a mesh that could be optimised. Nothing is moved."""
        options["max_iterations"] = 0
        job = self.submit(mesh, **options)
        job.wait()
        try:
            return job.result().before
        finally:
            job.delete()

    # ===== jobs =====

    def submit(self, mesh: MeshLike, *, outputs: Iterable[str] = (), request_id: str | None = None,
               labels: Mapping[str, str] | None = None, priority: int = 0, **options: Unpack[Options]) -> Job:  # fmt: skip
        """Sends a mesh and puts a job in the queue.

        `outputs` names formats ("msh41-binary", "vtu", "parts" for arrays, "as-read"); the default is "as-read". A repeat
        with the same `request_id` answers with the same job, so a script that gives one can safely run again. Without
        one, each call uses an id of its own when it repeats itself.
        """
        spec = job_pb2.JobSpec(options=to_message(options), labels=dict(labels or {}), priority=priority,
                               outputs=[_format_number(name) for name in outputs])  # fmt: skip
        arrays = None if _is_path(mesh) else as_mesh(mesh)
        spec.mesh.digest = self.upload(mesh if arrays is None else arrays)
        if arrays is not None:
            spec.mesh.format = mesh_pb2.MESH_FORMAT_PARTS
        request = service_pb2.SubmitJobRequest(request_id=request_id or uuid.uuid4().hex, spec=spec)
        job = self._connection.call(self._jobs.SubmitJob, request).job
        return Job(self, job, arrays)

    def job(self, name: str) -> Job:
        """The job of this name, with or without "jobs/"."""
        return Job(self, self._get(name if name.startswith("jobs/") else "jobs/" + name))

    def jobs(self, states: Iterable[str] = (), labels: Mapping[str, str] | None = None) -> Iterator[Job]:
        """The server's jobs, newest first."""
        known = spellings(job_pb2.JobState.DESCRIPTOR)
        request = service_pb2.ListJobsRequest(labels=dict(labels or {}))
        for state in states:
            if state not in known:
                raise BadOption(f"There is no state '{state}'; {suggestion(state, known)}")
            request.states.append(known[state])
        while True:
            page = self._connection.call(self._jobs.ListJobs, request)
            yield from (Job(self, job) for job in page.jobs)
            request.page_token = page.next_page_token
            if not request.page_token:
                return

    def info(self) -> ServerInfo:
        """The server's version, its limits and what it accepts."""
        return reports.info_of(self._connection.call(self._jobs.GetServerInfo, service_pb2.GetServerInfoRequest()))

    # ===== meshes =====

    def upload(self, mesh: MeshLike) -> str:
        """Uploads a mesh, unless the server has it already. Returns its digest."""
        if not _is_path(mesh):
            return transfer.upload(self._connection, self._meshes, transfer.BytesSource(b"".join(to_parts(as_mesh(mesh)))))
        file = transfer.FileSource(mesh)
        try:
            return transfer.upload(self._connection, self._meshes, file)
        finally:
            file.close()

    def download(self, digest: str, path: str | os.PathLike[str] | None = None) -> bytes:
        """The bytes of a mesh or a result. If `path` is given, they go to that file, and the return value is empty."""
        if path is not None:
            transfer.write_file(path, lambda take: transfer.download(self._connection, self._meshes, digest, take))
            return b""
        data = bytearray()
        transfer.download(self._connection, self._meshes, digest, data.extend)
        return bytes(data)

    # ===== for Job =====

    def _get(self, name: str) -> job_pb2.Job:
        job: job_pb2.Job = self._connection.call(self._jobs.GetJob, service_pb2.GetJobRequest(name=name)).job
        return job

    def _cancel(self, name: str) -> job_pb2.Job:
        job: job_pb2.Job = self._connection.call(self._jobs.CancelJob, service_pb2.CancelJobRequest(name=name)).job
        return job

    def _cancel_quietly(self, job: Job) -> None:
        """After an interrupt: asks once, with little time."""
        Stop.current.stop = Stop()
        try:
            self._jobs.CancelJob(service_pb2.CancelJobRequest(name=job.name), timeout=2, metadata=self._connection.metadata)
        except grpc.RpcError:
            pass

    def _delete(self, name: str) -> None:
        self._connection.call(self._jobs.DeleteJob, service_pb2.DeleteJobRequest(name=name))

    def _watch(self, name: str, after: int) -> Iterator[Event]:
        return (reports.event_of(event) for event in watch(self._connection, self._jobs, name, after))

    def _result(self, name: str) -> tuple[job_pb2.Job, list[Any]]:
        """The job and its history."""
        job = self._get(name)
        if reports.state_name(job.state) == "failed":
            raise JobFailed(job.error.message, job.error.reason, name)
        patience = Patience(self._connection, self._connection.control)
        request = service_pb2.GetResultRequest(name=name, without_meshes=True)
        while True:
            iterations: list[Any] = []
            with self._connection.stream(self._jobs.GetResult, request) as call:
                try:
                    for response in call:
                        if response.WhichOneof("message") == "job":
                            job = response.job
                        iterations += response.history.iterations
                    return job, iterations
                except grpc.RpcError as raised:
                    error = raised
            patience.again(error)


def _is_path(mesh: object) -> bool:
    return isinstance(mesh, (str, os.PathLike))


def _paths(output: Paths | None) -> list[str | os.PathLike[str]]:
    if output is None:
        return []
    return [output] if isinstance(output, (str, os.PathLike)) else list(output)


def _format_of(path: str | os.PathLike[str], format: str | None, from_file: bool) -> str:
    """The name of the format in which a file is written."""
    ending = os.path.splitext(path)[1].lower()
    if ending not in (".msh", ".vtu"):
        raise BadOption(f"The ending of {os.fspath(path)} gives no format; name a .msh or a .vtu file.")
    if ending == ".vtu":
        return "vtu"
    return format or ("as-read" if from_file else "msh41")


def _format_number(name: str) -> Any:
    known = {"as-read": 0, **spellings(mesh_pb2.MeshFormat.DESCRIPTOR)}
    if name not in known:
        raise BadOption(f"There is no format '{name}'; {suggestion(name, known)}")
    return known[name]
