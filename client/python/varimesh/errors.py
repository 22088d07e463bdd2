"""The errors of this package. Each has a sentence for people and the server's reason for programs."""
from __future__ import annotations

from collections.abc import Mapping


class VarimeshError(Exception):
    """The base of all errors of this package.

    `sentence` says what was wrong, where, and what to do. `reason` is the constant of the server's ErrorInfo, such as
    "MESH_NOT_FOUND"; proto/varimesh/v1/service.proto lists them. It is empty if the error does not come from a server.
    `metadata` gives details of the reason.
    """

    def __init__(self, sentence: str, reason: str = "", metadata: Mapping[str, str] | None = None) -> None:
        super().__init__(sentence if not reason else f"{sentence} [{reason}]")
        self.sentence = sentence
        self.reason = reason
        self.metadata: dict[str, str] = dict(metadata or {})


class ServerUnreachable(VarimeshError):
    """There is no server, or it went away and did not come back in time."""


class Refused(VarimeshError):
    """The server refused the call. `reason` says why."""


class BadOption(VarimeshError, ValueError):
    """There is no such option, or it cannot have this value. Nothing was sent."""


class BadOutput(VarimeshError, OSError):
    """A file cannot be written. Nothing was sent."""


class BadMesh(VarimeshError, ValueError):
    """The arrays are not a mesh. Nothing was sent."""


class JobFailed(VarimeshError):
    """The job ended as FAILED. `reason` is BAD_INPUT, BAD_OPTION, OUTPUT, LOST or INTERNAL."""

    def __init__(self, sentence: str, reason: str, job: str) -> None:
        super().__init__(sentence, reason)
        self.job = job


class JobCancelled(VarimeshError):
    """Somebody cancelled the job. If it was running, `client.job(error.job).result()` has the best mesh so far."""

    def __init__(self, sentence: str, job: str) -> None:
        super().__init__(sentence)
        self.job = job


class Stopped(VarimeshError):
    """The caller cancelled the asynchronous call."""
