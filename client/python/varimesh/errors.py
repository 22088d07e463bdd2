"""What can go wrong, each with a sentence for people and the server's reason for programs."""
from __future__ import annotations

from collections.abc import Mapping


class VarimeshError(Exception):
    """The base of all errors of this package.

    `sentence` says what was wrong, where, and what to do; `reason` is the constant of the server's ErrorInfo
    ("MESH_NOT_FOUND"; proto/varimesh/v1/service.proto lists them), empty where no server said no; `metadata` says what
    the reason is about.
    """

    def __init__(self, sentence: str, reason: str = "", metadata: Mapping[str, str] | None = None) -> None:
        super().__init__(sentence if not reason else f"{sentence} [{reason}]")
        self.sentence = sentence
        self.reason = reason
        self.metadata: dict[str, str] = dict(metadata or {})


class ServerUnreachable(VarimeshError):
    """The server is not there, or went away and did not come back in time."""


class Refused(VarimeshError):
    """The server said no: `reason` says why."""


class BadOption(VarimeshError, ValueError):
    """An option that does not exist, or a value that it cannot have; nothing was sent."""


class BadMesh(VarimeshError, ValueError):
    """Arrays that are no mesh; nothing was sent."""


class JobFailed(VarimeshError):
    """The job ended as FAILED: `reason` is BAD_INPUT, BAD_OPTION, OUTPUT, LOST or INTERNAL."""

    def __init__(self, sentence: str, reason: str, job: str) -> None:
        super().__init__(sentence, reason)
        self.job = job


class JobCancelled(VarimeshError):
    """Somebody cancelled the job; `client.job(error.job).result()` has the best mesh so far, where it ran."""

    def __init__(self, sentence: str, job: str) -> None:
        super().__init__(sentence)
        self.job = job


class Stopped(VarimeshError):
    """The asynchronous call was cancelled by its caller."""
