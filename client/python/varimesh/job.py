"""A job, and what came of it."""
from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import reports
from .errors import BadOption
from .mesh import Mesh, from_parts
from .progress import Progress
from .reports import Event, Metrics, Quality
from .v1 import job_pb2

if TYPE_CHECKING:
    from .client import Client

ENDED = {"succeeded", "failed", "cancelled"}


class Job:
    """A job on a server, which runs whether anybody is watching or not. `state` and `labels` are as they were when it
    was last asked for: refresh() asks again."""

    def __init__(self, client: Client, message: job_pb2.Job, source: Mesh | None = None) -> None:
        self._client, self._message, self._source = client, message, source

    def __repr__(self) -> str:
        return f"<{self.name} {self.state}>"

    @property
    def name(self) -> str:
        return str(self._message.name)

    @property
    def state(self) -> str:
        """pending, running, cancelling, succeeded, failed or cancelled."""
        return reports.state_name(self._message.state)

    @property
    def ended(self) -> bool:
        return self.state in ENDED

    @property
    def labels(self) -> Mapping[str, str]:
        return dict(self._message.spec.labels)

    @property
    def last_sequence(self) -> int:
        """The number of its newest event."""
        return int(self._message.last_sequence)

    def refresh(self) -> Job:
        self._message = self._client._get(self.name)
        return self

    def watch(self, after: int = 0) -> Iterator[Event]:
        """Its events after the number `after`, each once and in order, until it ends; goes on by itself where the
        connection breaks or the server is started again."""
        yield from self._client._watch(self.name, after)
        self.refresh()

    def wait(self, progress: bool = False) -> Job:
        """Until it has ended, however."""
        show = Progress(self._message.spec.options.tolerance or 1e-6) if progress else None
        for event in self.watch():
            if show is not None:
                show(event)
        return self

    def cancel(self) -> Job:
        """Asks for it to end, which it does at its next iteration."""
        self._message = self._client._cancel(self.name)
        return self

    def delete(self) -> None:
        """Forgets it and its results; it must have ended."""
        self._client._delete(self.name)

    def result(self) -> Result:
        """What came of it, or the best so far where it was cancelled while it ran. JobFailed where it failed; Refused,
        reason JOB_NOT_SUCCEEDED, where there is nothing."""
        self._message, iterations = self._client._result(self.name)
        return Result(self._client, self._message, iterations, self._source)


class Result:
    """What came of a job. Meshes are fetched when they are asked for."""

    def __init__(self, client: Client, message: job_pb2.Job, iterations: list[Any], source: Mesh | None) -> None:
        self._client, self._message, self._source = client, message, source
        self.job = str(message.name)
        self.state = reports.state_name(message.state)
        self.metrics: Metrics = reports.metrics_of(message.metrics)
        self.history: NDArray[Any] = reports.history_of(iterations)
        self._mesh: Mesh | None = None

    def __repr__(self) -> str:
        after = self.metrics.after
        return (f"<result of {self.job}: {self.metrics.iterations} iterations, {self.metrics.stop_reason}, min Js "
                f"{after.min_scaled_jacobian:.4f}, {after.certified.valid} of {self.metrics.elements} valid>")  # fmt: skip

    @property
    def before(self) -> Quality:
        return self.metrics.before

    @property
    def after(self) -> Quality:
        return self.metrics.after

    @property
    def valid(self) -> bool:
        """Whether every element is certified valid."""
        return self.after.certified.invalid + self.after.certified.undecided == 0

    @property
    def formats(self) -> list[str]:
        """Those in which the server has the result."""
        return [reports.format_name(stored.format) for stored in self._message.results]

    @property
    def mesh(self) -> Mesh:
        """In arrays: nodes in the order in which they came in, elements too."""
        if self._mesh is None:
            self._mesh = from_parts(self._client.download(self._digest("parts")))
            if self._source is not None and len(self._source.nodes) == len(self._mesh.nodes):
                self._mesh.node_tags = self._source.node_tags
        return self._mesh

    @property
    def nodes(self) -> NDArray[np.float64]:
        """(nodes, 3)."""
        return self.mesh.nodes

    def save(self, path: str | os.PathLike[str], *, format: str | None = None) -> None:
        """Writes a file in a format that was asked for: a .vtu, or a .msh in `format`, or in the one there is. It takes
        its name only once it is whole."""
        if os.path.splitext(path)[1].lower() == ".vtu":
            format = "vtu"
        elif format is None:
            format = next((name for name in self.formats if name.startswith("msh")), "msh41")
        self._client.download(self._digest(format), path)

    def _digest(self, format: str) -> str:
        for asked, stored in zip(self._message.spec.outputs, self._message.results):
            if format in (reports.format_name(stored.format), "as-read" if asked == 0 else ""):
                return str(stored.digest)
        for stored in self._message.results:
            if reports.format_name(stored.format) == format:
                return str(stored.digest)
        raise BadOption(f"{self.job} has no result as {format}, only {', '.join(self.formats)}; "
                        f"submit it again with outputs that have '{format}'.")  # fmt: skip
