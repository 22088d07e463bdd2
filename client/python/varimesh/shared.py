"""optimise() and quality() without a client: they share one, which is made at the first call."""
from __future__ import annotations

import functools
import inspect
import os
import threading
from collections.abc import Callable
from typing import Concatenate, ParamSpec, TypeVar

from .client import Client
from .local import local

_lock = threading.Lock()
_client: Client | None = None
_owner = 0  # the process that made the client; a fork needs its own

P = ParamSpec("P")
T = TypeVar("T")


def shared_client() -> Client:
    """The client of VARIMESH_SERVER if this environment variable names a server, otherwise of a private server that ends
    with the program."""
    global _client, _owner
    with _lock:
        if _client is None or _owner != os.getpid():
            address = os.environ.get("VARIMESH_SERVER")
            _client, _owner = Client(address) if address else local(), os.getpid()
        return _client


def _with_shared_client(method: Callable[Concatenate[Client, P], T]) -> Callable[P, T]:
    """The method of Client as a function that calls it with the shared client: same arguments, types and help."""

    @functools.wraps(method)
    def call(*arguments: P.args, **keywords: P.kwargs) -> T:
        return method(shared_client(), *arguments, **keywords)

    signature = inspect.signature(method)
    own = list(signature.parameters.values())[1:]  # without self
    call.__signature__ = signature.replace(parameters=own)  # type: ignore[attr-defined]
    call.__doc__ = f"As Client.{method.__name__}(), with the shared client. {method.__doc__}"
    return call


optimise = _with_shared_client(Client.optimise)
optimize = optimise
quality = _with_shared_client(Client.quality)
