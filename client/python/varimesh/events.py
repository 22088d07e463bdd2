"""What happens to a job: its events, and the stream of them, which resumes by itself."""
from __future__ import annotations

import datetime
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import grpc
import numpy as np
from numpy.typing import NDArray

from .connection import Connection, Patience, reason_of
from .errors import BadOption
from .names import spelled
from .numbering import OF_FILES, Numbering
from .reports import Quality, SlideTrial, quality_of, slide_trial_of, state_name
from .v1 import job_pb2, optimise_pb2, service_pb2, service_pb2_grpc

HISTORY = np.dtype(
    [("number", "i4"), ("phase", "U8"), ("energy", "f8"), ("residual", "f8"), ("relative_gradient", "f8"),
     ("min_scaled_jacobian", "f8"), ("invalid_elements", "i8"), ("active_nodes", "i8"), ("seconds", "f8"),
     ("repairable_elements", "i8"), ("products", "i4"), ("linear_solve", "U18"), ("left_elements", "i8"),
     ("on_device", "?")])  # fmt: skip


@dataclass(frozen=True)
class Iteration:
    """What is known after an iteration. proto/varimesh/v1/optimise.proto describes the fields."""

    number: int
    phase: str
    energy: float
    residual: float
    relative_gradient: float
    min_scaled_jacobian: float
    invalid_elements: int
    active_nodes: int
    seconds: float
    repairable_elements: int
    products: int
    linear_solve: str
    left_elements: int  # that would not be certified valid if the run ended here
    on_device: bool  # a graphics card has made it, or steps of it
    seconds_left: float | None  # how long the job will still take, as an estimate; None: nobody can tell


@dataclass(frozen=True)
class Work:
    """How far a run has come inside an iteration, or between two."""

    activity: str  # assembly, products, sweep or splits
    done: int
    of: int  # 0: not known
    groups_left: int | None  # without room, found by the last look for splits; None before any
    seconds_left: float | None  # as in an iteration


@dataclass(frozen=True, repr=False)
class Event:
    """One thing that happened to a job. One of state, iteration, quality (with stage), log, slide_trial and work is set.
    `work` comes at most ten times per second and is not kept. None is set in a bookmark, which only shows that the server
    is alive."""

    sequence: int
    attempt: int
    time: datetime.datetime
    thinned: int
    state: str | None = None
    iteration: Iteration | None = None
    stage: str | None = None
    quality: Quality | None = None
    log: str | None = None
    work: Work | None = None
    slide_trial: SlideTrial | None = None  # another way to slide begins or has ended

    def __repr__(self) -> str:
        kinds = ("state", "iteration", "quality", "log", "work", "slide_trial")
        what = next((value for kind in kinds if (value := getattr(self, kind)) is not None), "bookmark")
        return f"<event {self.sequence}: {what}>"


def iteration_of(message: optimise_pb2.Iteration) -> Iteration:
    values = {name: getattr(message, name) for name in Iteration.__dataclass_fields__}
    values["phase"] = spelled(optimise_pb2.Phase.DESCRIPTOR, message.phase)
    values["linear_solve"] = spelled(optimise_pb2.LinearSolve.DESCRIPTOR, message.linear_solve)
    values["seconds_left"] = message.seconds_left if message.HasField("seconds_left") else None
    return Iteration(**values)


def history_of(iterations: list[optimise_pb2.Iteration]) -> NDArray[Any]:
    names = HISTORY.names
    assert names is not None
    rows = [iteration_of(one) for one in iterations]
    return np.array([tuple(getattr(row, name) for name in names) for row in rows], dtype=HISTORY)


def event_of(message: job_pb2.JobEvent, numbering: Numbering = OF_FILES) -> Event:
    what: dict[str, Any] = {}
    kind = message.WhichOneof("event")
    if kind == "state_change":
        what["state"] = state_name(message.state_change.state)
    elif kind == "iteration":
        what["iteration"] = iteration_of(message.iteration)
    elif kind == "quality":
        what["stage"] = spelled(job_pb2.QualityEvent.Stage.DESCRIPTOR, message.quality.stage)
        what["quality"] = quality_of(message.quality.report, numbering)
    elif kind == "log":
        what["log"] = message.log.text
    elif kind == "slide_trial":
        what["slide_trial"] = slide_trial_of(message.slide_trial)
    elif kind == "bookmark" and message.bookmark.HasField("work"):
        work = message.bookmark.work
        groups = work.groups_left if work.HasField("groups_left") else None
        left = work.seconds_left if work.HasField("seconds_left") else None
        what["work"] = Work(spelled(job_pb2.Work.Activity.DESCRIPTOR, work.activity), work.done, work.of, groups, left)
    return Event(message.sequence, message.attempt, message.time.ToDatetime(tzinfo=datetime.timezone.utc), message.thinned, **what)


def watch(connection: Connection, stub: service_pb2_grpc.JobServiceStub, name: str,
          after: int) -> Iterator[job_pb2.JobEvent]:  # fmt: skip
    """Yields the events after the number `after`, each once and in order, until the job ends. The server may leave out
    iterations for a slow reader; the next event says how many."""
    connection.meet()
    patience = Patience(connection, connection.control)
    request = service_pb2.WatchJobRequest(name=name, after_sequence=after)
    seen = after
    while True:
        with connection.stream(stub.WatchJob, request) as call:
            try:
                for response in call:
                    event = response.event
                    patience.reset()
                    bookmark = event.WhichOneof("event") == "bookmark"
                    if event.sequence < seen or (event.sequence == seen and not bookmark):
                        continue
                    seen = request.after_sequence = event.sequence
                    yield event
                return
            except grpc.RpcError as raised:
                error = raised
        if reason_of(error) != "SEQUENCE_EXPIRED" or request.after_sequence == 0:
            patience.again(error)
            continue
        if seen == after:
            job = connection.call(stub.GetJob, service_pb2.GetJobRequest(name=name)).job
            if job.last_sequence < after:
                raise BadOption(f"{name} has no event number {after}; its last is {job.last_sequence}.", "BAD_OPTION")
        # The server no longer keeps some iterations after this event. From the start it delivers every state and all
        # iterations that it keeps. Events that were seen before are skipped above.
        request.after_sequence = 0
