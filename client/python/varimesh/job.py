"""A job and its result."""
from __future__ import annotations

import contextlib
import datetime
import os
import tempfile
from collections.abc import Generator, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import pages, reports
from .adapters import to_meshio
from .errors import BadOption, VarimeshError
from .events import Event, history_of
from .names import counted
from .numbering import Numbering
from .mesh import Mesh, from_parts
from .progress import Progress
from .reports import CellQuality, Metrics, Quality
from .v1 import job_pb2, mesh_pb2

if TYPE_CHECKING:
    from .client import Client

ENDED = {"succeeded", "failed", "cancelled"}


def numbering_of(message: job_pb2.Job) -> Numbering:
    """The numbers of a job's reports: from 0 if its mesh came in arrays."""
    return Numbering(from_zero=message.spec.mesh.format == mesh_pb2.MESH_FORMAT_PARTS)


class Job:
    """A job on a server. It runs whether anybody watches it or not. `state` and `labels` are those of the last answer;
    refresh() asks the server again."""

    def __init__(self, client: Client, message: job_pb2.Job, source: Mesh | None = None) -> None:
        self._client, self._message, self._source = client, message, source

    def __repr__(self) -> str:
        return f"<{self.name} {self.state}>"

    def __await__(self) -> Generator[Any, None, Result]:
        """`await job` waits for its end without blocking the event loop, and gives its result with the mesh in arrays.
        Cancelling the task does not cancel the job."""
        from .aio import in_thread  # aio builds on this module

        def finish() -> Result:
            result = self.wait().result()
            if "parts" in result.formats:
                result.mesh  # noqa: B018
            return result

        return in_thread(finish).__await__()

    @property
    def name(self) -> str:
        return str(self._message.name)

    @property
    def state(self) -> str:
        """One of pending, running, cancelling, succeeded, failed and cancelled."""
        return reports.state_name(self._message.state)

    @property
    def ended(self) -> bool:
        return self.state in ENDED

    @property
    def owner(self) -> str:
        """Whose job it is; empty on a server that does not ask who calls."""
        return str(self._message.owner)

    @property
    def labels(self) -> Mapping[str, str]:
        return dict(self._message.spec.labels)

    @property
    def file(self) -> str | None:
        """The name of the mesh file; None for a mesh in arrays."""
        return self.labels.get("file")

    @property
    def submitted(self) -> datetime.datetime:
        """When the server took the job."""
        time: datetime.datetime = self._message.create_time.ToDatetime(tzinfo=datetime.timezone.utc)
        return time

    @property
    def last_sequence(self) -> int:
        """The sequence number of its newest event."""
        return int(self._message.last_sequence)

    def refresh(self) -> Job:
        self._message = self._client._get(self.name)
        return self

    def watch(self, after: int = 0) -> Iterator[Event]:
        """Yields the job's events after the number `after`, each once and in order, until the job ends. Continues by
        itself if the connection breaks or the server restarts."""
        yield from self._client._watch(self.name, after, numbering_of(self._message))
        self.refresh()

    def wait(self, progress: bool = False) -> Job:
        """Waits until the job has ended in any state."""
        show = Progress(self._message.spec.options.tolerance or 1e-3) if progress else None
        for event in self.watch():
            if show is not None:
                show(event)
        return self

    def cancel(self) -> Job:
        """Asks for the job to end. It does so at once, and its result is the best mesh so far."""
        self._message = self._client._cancel(self.name)
        return self

    def delete(self) -> None:
        """Deletes the job and its results. It must have ended."""
        self._client._delete(self.name)

    def result(self) -> Result:
        """The result of the job, or the best result so far if it was cancelled while it ran. Raises JobFailed if it
        failed, and Refused with the reason JOB_NOT_SUCCEEDED if it has no result."""
        self._message, iterations = self._client._result(self.name)
        return Result(self._client, self._message, iterations, self._source)


class Result:
    """The result of a job. Meshes are fetched when they are asked for."""

    def __init__(self, client: Client, message: job_pb2.Job, iterations: list[Any], source: Mesh | None) -> None:
        self._client, self._message, self._source = client, message, source
        self.job = str(message.name)
        self.state = reports.state_name(message.state)
        self._numbering = numbering_of(message)
        self.metrics: Metrics = reports.metrics_of(message.metrics, self._numbering)
        self.history: NDArray[Any] = history_of(iterations)
        self._mesh: Mesh | None = None
        self._quality: CellQuality | None = None
        self._report: str | None = None

    def __repr__(self) -> str:
        after = self.metrics.after
        return (f"<result of {self.job}: {counted(self.metrics.iterations, 'iteration')}, {self.metrics.stop_reason}, min Js "
                f"{after.min_scaled_jacobian:.4f}, {after.certified.valid} of {self.metrics.elements} valid>")  # fmt: skip

    @property
    def before(self) -> Quality:
        return self.metrics.before

    @property
    def after(self) -> Quality:
        return self.metrics.after

    @property
    def quality(self) -> CellQuality:
        """The quality of the result and of each of its cells, in the order of its mesh. The server computes the arrays
        when they are first asked for."""
        if self._quality is None:
            self._quality = self._client._cell_quality(self._message, self.after, self._numbering)
        return self._quality

    def report(self) -> str:
        """The report as the text of a page in HTML: pictures of the mesh with a colour per element, the convergence, and all
        figures. Needs the command `varimesh`."""
        return self._report_within(None)

    def _write_report(self, path: str | os.PathLike[str], seconds: float | None = None) -> None:
        pages.write_report(self.job, path, self._client._for_report(self.job, path), seconds)

    def _report_within(self, seconds: float | None) -> str:
        if self._report is None:
            with tempfile.TemporaryDirectory(prefix="varimesh-") as folder:
                path = Path(folder, "report.html")
                self._write_report(path, seconds)
                self._report = path.read_text(encoding="utf-8")
        return self._report

    def _repr_html_(self) -> str:
        """The report inside the notebook. If the mesh is large, there is no command `varimesh`, or the report takes long, only
        a picture of the histogram before and after, and the figures."""
        report = None
        if self.metrics.elements <= pages.MOST_ELEMENTS:
            with contextlib.suppress(VarimeshError, OSError):
                report = self._report_within(pages.MOST_SECONDS)
        return pages.of_notebook(self, report)

    @property
    def valid(self) -> bool:
        """Whether every element is certified valid."""
        return self.after.certified.invalid + self.after.certified.undecided == 0

    @property
    def formats(self) -> list[str]:
        """The formats in which the server has the result."""
        return [reports.format_name(stored.format) for stored in self._message.results]

    @property
    def mesh(self) -> Mesh:
        """The mesh in arrays. Nodes and elements are in the order of the input."""
        if self._mesh is None:
            self._mesh = from_parts(self._client.download(self._digest("parts")))
            if self._source is not None and len(self._source.nodes) == len(self._mesh.nodes):
                self._mesh.node_tags = self._source.node_tags
        return self._mesh

    @property
    def nodes(self) -> NDArray[np.float64]:
        """The coordinates of the nodes: (nodes, 3), or (nodes, 2) if they were given so."""
        columns = 3 if self._source is None else self._source.columns
        return self.mesh.nodes[:, :columns]

    def to_meshio(self) -> Any:
        """The mesh as a meshio.Mesh, with its groups."""
        return to_meshio(self.mesh)

    def to_pyvista(self) -> Any:
        """The mesh as a pyvista.UnstructuredGrid: Lagrange cells, with the arrays of a VTU file (docs/report.md)."""
        return self._client._to_pyvista(self._message)

    def save(self, path: str | os.PathLike[str], *, format: str | None = None) -> None:
        """Writes a file in a format that was asked for: a .vtu or .mesh, or a .msh in `format`. Without `format`, a .msh
        has the format in which the server has the result. A .html is the report (docs/report.md), which needs the command
        `varimesh`. The file takes its name only when it is complete."""
        if pages.is_page(path):
            self._write_report(path)
            return
        format = reports.FORMAT_OF_ENDING.get(os.path.splitext(path)[1].lower(), format)
        if format is None:
            format = next((name for name in self.formats if name.startswith("msh")), "msh41")
        self._client.download(self._digest(format), path)

    def _digest(self, format: str) -> str:
        for asked, stored in zip(self._message.spec.outputs, self._message.results):
            if format in (reports.format_name(stored.format), "as-read" if asked == 0 else ""):
                return str(stored.digest)
        for stored in self._message.results:
            if reports.format_name(stored.format) == format:
                return str(stored.digest)
        raise BadOption(f"{self.job} has no result in the format {format}, only in {', '.join(self.formats)}; "
                        f"submit it again with '{format}' among the outputs.")  # fmt: skip
