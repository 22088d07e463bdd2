"""Watching a job, resuming by itself."""
from __future__ import annotations

from collections.abc import Iterator

import grpc

from .connection import Connection, Patience, reason_of
from .errors import BadOption
from .v1 import job_pb2, service_pb2, service_pb2_grpc


def watch(connection: Connection, stub: service_pb2_grpc.JobServiceStub, name: str,
          after: int) -> Iterator[job_pb2.JobEvent]:  # fmt: skip
    """The events after the number `after`, each once and in order, until the job ends. Iterations may be left out for a
    slow reader, and the next event says how many were."""
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
                raise BadOption(f"{name} has no event number {after}: its last is {job.last_sequence}.", "BAD_OPTION")
        # The server dropped some iterations behind it. From the start on it has every state and all that it still keeps;
        # what was seen before is passed over.
        request.after_sequence = 0
