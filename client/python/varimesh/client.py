"""The client of a server."""
from __future__ import annotations

import contextlib
import os
import tempfile
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import TracebackType
from typing import Any, TypeAlias, Unpack

import grpc

from . import pages, reports, transfer
from .adapters import as_mesh
from .connection import Connection, Patience, Stop, default_address, find_credentials, find_token
from .errors import BadMesh, BadOption, JobCancelled, JobFailed, Stopped, VarimeshError
from .events import Event, event_of, watch
from .job import Job, Result
from .mesh import Mesh, from_parts, to_parts
from .names import spellings, suggestion
from .numbering import OF_FILES, Numbering
from .options import Geometry, Layers, Options, numbered_from_one, to_message
from .progress import Progress
from .reports import CellQuality, Quality, ServerInfo, info_of
from .v1 import job_pb2, mesh_pb2, service_pb2, service_pb2_grpc

#: A file's path, a Mesh, (nodes, cells), a meshio mesh, a pyvista grid, or the module gmsh.
MeshLike: TypeAlias = Any
_READABLE = (mesh_pb2.MESH_FORMAT_MSH22, mesh_pb2.MESH_FORMAT_MSH22_BINARY, mesh_pb2.MESH_FORMAT_MSH41,
             mesh_pb2.MESH_FORMAT_MSH41_BINARY, mesh_pb2.MESH_FORMAT_PARTS)  # fmt: skip
Path: TypeAlias = "str | os.PathLike[str]"
Paths: TypeAlias = "str | os.PathLike[str] | Sequence[str | os.PathLike[str]]"


class Client:
    """The client of one server. Any thread may call it. A call repeats itself while the server is away.

    `address` is HOST:PORT or unix:PATH; the default is that in the environment variable VARIMESH_SERVER, or the socket of a
    varimeshd of this user that was started without an address. `token` is sent with every call; a server that has no tokens
    ignores it. It can also be in a file, `token_file`, or in the environment variables VARIMESH_TOKEN and
    VARIMESH_TOKEN_FILE; `token=""` is none. Use it only on connections that others cannot read: loopback, or with TLS. `connect` is how many seconds to wait
    for the first contact (a second where nobody listens), `retry` for a server that went away.

    For TLS, `authority` is a file with the authority that the server's certificate must come from; `certificate` and `key`
    are files for a server that asks for a certificate. The environment variables VARIMESH_TLS_AUTHORITY,
    VARIMESH_TLS_CERTIFICATE and VARIMESH_TLS_KEY stand for them. An address that begins with https:// is for servers whose
    authority this machine knows. Instead of files, `credentials` takes gRPC's, and `channel` a channel that is ready, which
    carries everything and is not closed; then `address` is only for messages.
    """

    def __init__(self, address: str | None = None, token: str | None = None, *,
                 token_file: str | os.PathLike[str] | None = None, authority: Path | None = None, certificate: Path | None = None, key: Path | None = None,
                 credentials: grpc.ChannelCredentials | None = None, channel: grpc.Channel | None = None,
                 connect: float = 5.0, retry: float = 60.0) -> None:  # fmt: skip
        if address is None:
            address = default_address()
        token = find_token(token, token_file)
        # What lets the command call the same server; gRPC's objects cannot be handed on.
        self._for_command: dict[str, str | None] | None = None
        if credentials is None and channel is None:
            self._for_command = {"VARIMESH_SERVER": address, "VARIMESH_TOKEN": token or None, "VARIMESH_TOKEN_FILE": None}
            files = {"AUTHORITY": authority, "CERTIFICATE": certificate, "KEY": key}
            if any(files.values()):
                self._for_command |= {"VARIMESH_TLS_" + name: None if file is None else os.fspath(file)
                                      for name, file in files.items()}  # fmt: skip
            credentials = find_credentials(address, authority, certificate, key)
        self.address = address = plain_address(address)
        self._connection = Connection(address, token, credentials, connect, retry, channel)
        self._jobs = service_pb2_grpc.JobServiceStub(self._connection.control)  # type: ignore[no-untyped-call]
        self._meshes = service_pb2_grpc.MeshServiceStub(self._connection.bulk)  # type: ignore[no-untyped-call]

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self.address}>"

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
                 priority: int = 0, geometry: Geometry | Path | None = None, layers: Layers | None = None,
                 keep_orders: bool = False, **options: Unpack[Options]) -> Result:  # fmt: skip
        """Optimises a mesh and waits for the result.

        `output` names files to write (.msh in `format`, .vtu, .mesh, .xml, .su2, .h5, .cgns,
        .pyfrm, or .html for a report). The result also has its mesh in arrays, unless
        `arrays` is False, which saves the server the disk space. Ctrl-C and an exception in `on_event` cancel the job.
        For a mesh in arrays, numbers in options and reports count from 0. `geometry` is a CAD model on which boundary nodes
        slide first, on a server that takes geometries. `layers` says into which layers thick cells at walls are split after
        the optimisation. If a file has elements of several orders, `keep_orders` writes each at the order at which it came,
        if that loses nothing and the format can hold it.

        Raises JobFailed, JobCancelled (by somebody else), Refused, ServerUnreachable, BadOption, BadMesh or BadOutput. It
        is no error if elements of the result are not certified valid; `result.valid` says whether all are.
        """
        paths = sorted(_paths(output), key=pages.is_page)  # meshes first
        for path in paths:
            transfer.check_writable(path)
            if pages.is_page(path):  # before the work
                self._for_report("JOB", path)
        mesh = mesh if _is_path(mesh) else self._as_mesh(mesh)
        wanted = [_format_of(path, format, _is_path(mesh) and transfer.is_msh(mesh)) for path in paths if not pages.is_page(path)]
        if arrays is not False:
            # A result in the format of the file keeps its numbers, which arrays do not have.
            wanted += ["as-read"] if _is_path(mesh) and all(one in reports.FORMAT_OF_ENDING.values() for one in wanted) else []
            wanted.append("parts")
        job = self.submit(mesh, outputs=list(dict.fromkeys(wanted)), request_id=request_id, labels=labels,
                          priority=priority, geometry=geometry, layers=layers, keep_orders=keep_orders,
                          **options)  # fmt: skip
        show = Progress(options.get("tolerance") or 1e-3) if progress else None
        try:
            for event in job.watch():
                for take in (show, on_event):
                    if take is not None:
                        self._tell(job, take, event)
        except (KeyboardInterrupt, Stopped):
            self._cancel_quietly(job)
            raise
        if job.state == "cancelled":
            raise JobCancelled(f"Somebody else cancelled {job.name}.", job.name)
        result = job.result()
        for path in paths:
            result.save(path, format=format)
        if not _is_path(mesh) and arrays is not False:
            result.mesh  # noqa: B018 - who gave arrays wants arrays, also after the client is closed
        return result

    optimize = optimise

    def quality(self, mesh: MeshLike, output: Paths | None = None, *, lattice: int = 0, threads: int = 0,
                diagnose: bool = False, format: str | None = None) -> CellQuality:  # fmt: skip
        """The quality of a mesh and of each of its cells. Nothing is moved. The arguments are those of the command:
        `lattice` is the number of intervals per edge on which cells are sampled (0: the default), and `diagnose` says
        which elements no movement of free nodes can repair. `output` names files that get the mesh with marks on its
        elements (.vtu: cell arrays, .msh: a physical group)."""
        paths = _paths(output)
        for path in paths:
            transfer.check_writable(path)
        mesh = mesh if _is_path(mesh) else self._as_mesh(mesh)
        wanted = dict.fromkeys(_format_of(path, format, _is_path(mesh) and transfer.is_msh(mesh)) for path in paths)
        task = job_pb2.QualityTask(lattice=lattice, diagnose=diagnose or bool(paths))
        with self._quality_job(task, mesh, [*wanted, "cell-quality"], threads) as job:
            result = job.wait().result()
            for path in paths:
                result.save(path, format=format)
            return reports.cell_quality_of(result.after, self.download(result._digest("cell-quality")),
                                           result._numbering, result.metrics.unrepairable)  # fmt: skip

    # ===== jobs =====

    def submit(self, mesh: MeshLike, *, outputs: Iterable[str] = (), request_id: str | None = None,
               labels: Mapping[str, str] | None = None, priority: int = 0, geometry: Geometry | Path | None = None,
               layers: Layers | None = None, keep_orders: bool = False, **options: Unpack[Options]) -> Job:  # fmt: skip
        """Sends a mesh and puts a job in the queue.

        `outputs` names formats ("msh41-binary", "vtu", "parts" for arrays, "as-read"); the default is "as-read". Arrays have
        no numbers: if a file's result is asked for as "parts" and in no .msh format, `Result.quality` numbers all elements,
        those of boundaries included, from 1 in the order of the arrays.

        A repeat with the same `request_id` answers with the same job, so a script that gives one can safely run again.
        Without one, each call uses an id of its own when it repeats itself.
        """
        arrays = None if _is_path(mesh) else self._as_mesh(mesh)
        message = to_message(options if arrays is None else numbered_from_one(options))
        labels = {**({} if arrays is not None else {"file": transfer.file_label(mesh)}), **(labels or {})}
        spec = job_pb2.JobSpec(options=message, labels=labels, priority=priority,
                               outputs=[_format_number(name) for name in outputs])  # fmt: skip
        if geometry is not None:
            spec.geometry.CopyFrom(self._upload_geometry(geometry))
        if layers is not None or keep_orders:
            self.info().check(layers=layers is not None, keep_orders=keep_orders)
            spec.keep_orders = keep_orders
        if layers is not None:
            spec.layers.CopyFrom(layers.to_message())
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
        return info_of(self._connection.call(self._jobs.GetServerInfo, service_pb2.GetServerInfoRequest()))

    # ===== meshes =====

    def upload(self, mesh: MeshLike) -> str:
        """Uploads a mesh, unless the server has it already. Returns its digest."""
        if not _is_path(mesh):
            return transfer.upload(self._connection, self._meshes, transfer.BytesSource(b"".join(to_parts(self._as_mesh(mesh)))))
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

    def _upload_geometry(self, geometry: Geometry | Path) -> job_pb2.Geometry:
        geometry = geometry if isinstance(geometry, Geometry) else Geometry(geometry)
        message = geometry.to_message()
        if geometry.file is None:
            return message
        self.info().check(geometry=True)
        message.digest = self.upload(geometry.file)
        return message

    # ===== for Job =====

    def _as_mesh(self, source: MeshLike) -> Mesh:
        return as_mesh(source, self._read_vtu)

    def _read_vtu(self, file: bytes) -> Mesh:
        """The mesh in the bytes of a VTU or MSH file."""
        digest = transfer.upload(self._connection, self._meshes, transfer.BytesSource(file))
        try:
            with self._quality_job(job_pb2.QualityTask(), mesh_pb2.MeshReference(digest=digest), ["parts"]) as job:
                return from_parts(self.download(job.wait().result()._digest("parts")))
        except JobFailed as error:
            raise BadMesh(error.sentence) from error

    def _for_report(self, job: str, path: Path) -> dict[str, str | None]:
        """What tells the command that writes reports where the server is. Raises BadOption or BadOutput if it cannot write any."""
        if self._for_command is None:
            raise BadOption("The command that writes reports cannot be given gRPC's credentials or channel; give files, or run "
                            f"'varimesh result {job} --report {os.fspath(path)}'.")  # fmt: skip
        pages.find_command()
        return self._for_command

    @contextlib.contextmanager
    def _quality_job(self, task: job_pb2.QualityTask, mesh: MeshLike, outputs: Iterable[str], threads: int = 0) -> Iterator[Job]:
        """A job that judges a mesh: a file, a Mesh, or the reference of a mesh that the server has. It is deleted in the end."""
        spec = job_pb2.JobSpec(quality=task, options=to_message({"threads": threads}),
                               outputs=[_format_number(name) for name in outputs])  # fmt: skip
        if isinstance(mesh, mesh_pb2.MeshReference):
            spec.mesh.CopyFrom(mesh)
        else:
            spec.mesh.digest = self.upload(mesh)
            if isinstance(mesh, Mesh):
                spec.mesh.format = mesh_pb2.MESH_FORMAT_PARTS
        request = service_pb2.SubmitJobRequest(request_id=uuid.uuid4().hex, spec=spec)
        job = Job(self, self._connection.call(self._jobs.SubmitJob, request).job)
        try:
            yield job
        except BaseException as error:
            if isinstance(error, (KeyboardInterrupt, Stopped)):
                self._cancel_quietly(job)
            with contextlib.suppress(VarimeshError):  # the first error says more, and a job that still runs ends soon
                job.delete()
            raise
        job.delete()

    def _derived(self, message: job_pb2.Job, format: str) -> bytes:
        """The mesh of a job's result in another format, or the quality of its cells."""
        # A file keeps the numbers of elements.
        stored = [one for one in message.results if one.format in _READABLE]
        stored.sort(key=lambda one: bool(one.format == mesh_pb2.MESH_FORMAT_PARTS))
        if not stored:
            raise BadOption(f"{message.name} has no result in a format that can be read again; submit it with the output "
                            "'parts' or 'as-read'.")  # fmt: skip
        reference = mesh_pb2.MeshReference(digest=stored[0].digest)
        if stored[0].format == mesh_pb2.MESH_FORMAT_PARTS:
            reference.format = mesh_pb2.MESH_FORMAT_PARTS
        with self._quality_job(job_pb2.QualityTask(), reference, [format]) as job:
            return self.download(job.wait().result()._digest(format))

    def _cell_quality(self, message: job_pb2.Job, report: Quality, numbering: Numbering) -> CellQuality:
        return reports.cell_quality_of(report, self._derived(message, "cell-quality"), numbering)

    def _to_pyvista(self, message: job_pb2.Job) -> Any:
        import pyvista

        with tempfile.TemporaryDirectory(prefix="varimesh-") as folder:
            path = os.path.join(folder, "mesh.vtu")
            with open(path, "wb") as file:
                file.write(self._derived(message, "vtu"))
            return pyvista.read(path)

    def _tell(self, job: Job, take: Callable[[Event], object], event: Event) -> None:
        """Gives an event to a callback. If the callback raises, nobody waits for the job any more."""
        try:
            take(event)
        except BaseException:
            self._cancel_quietly(job)
            raise

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

    def _watch(self, name: str, after: int, numbering: Numbering = OF_FILES) -> Iterator[Event]:
        return (event_of(event, numbering) for event in watch(self._connection, self._jobs, name, after))

    def _result(self, name: str) -> tuple[job_pb2.Job, list[Any]]:
        """The job and its history."""
        job = self._get(name)
        if reports.state_name(job.state) == "failed":
            from_zero = job.spec.mesh.format == mesh_pb2.MESH_FORMAT_PARTS
            raise JobFailed(Numbering(from_zero).sentence(job.error.message), job.error.reason, name)
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


def plain_address(address: str) -> str:
    """The address without "http://" and a slash at the end, which people copy from a browser."""
    address = address.removeprefix("http://").removeprefix("https://")
    return address if address.startswith("unix:") else address.rstrip("/")


def _paths(output: Paths | None) -> list[str | os.PathLike[str]]:
    if output is None:
        return []
    return [output] if isinstance(output, (str, os.PathLike)) else list(output)


def _format_of(path: str | os.PathLike[str], format: str | None, from_file: bool) -> str:
    """The name of the format in which a file is written. `from_file`: a .msh may have the format of the input."""
    ending = os.path.splitext(path)[1].lower()
    if ending != ".msh" and ending not in reports.FORMAT_OF_ENDING:
        raise BadOption(f"The ending of {os.fspath(path)} gives no format; name a .msh, .vtu, .mesh, .xml, .su2, "
                        ".h5, .cgns or .pyfrm file.")
    if ending in reports.FORMAT_OF_ENDING:
        return reports.FORMAT_OF_ENDING[ending]
    return format or ("as-read" if from_file else "msh41")


def _format_number(name: str) -> Any:
    known = {"as-read": 0, **spellings(mesh_pb2.MeshFormat.DESCRIPTOR)}
    if name not in known:
        raise BadOption(f"There is no format '{name}'; {suggestion(name, known)}")
    return known[name]
