"""Watches a job, and resumes by itself."""
from __future__ import annotations

from collections.abc import Iterator

import grpc

from .connection import Connection, Patience, reason_of
from .errors import BadOption
from .v1 import job_pb2, service_pb2, service_pb2_grpc


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
