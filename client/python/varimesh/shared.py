"""optimise() and quality() without a client: they share one, which is made at the first call."""
from __future__ import annotations

import os
import threading
from typing import Any

from .client import Client, MeshLike
from .job import Result
from .local import local
from .reports import CellQuality

_lock = threading.Lock()
_client: Client | None = None
_owner = 0  # the process that made the client; a fork needs its own


def shared_client() -> Client:
    """The client of VARIMESH_SERVER if this environment variable names a server, otherwise of a private server that ends
    with the program."""
    global _client, _owner
    with _lock:
        if _client is None or _owner != os.getpid():
            address = os.environ.get("VARIMESH_SERVER")
            _client, _owner = Client(address) if address else local(), os.getpid()
        return _client


def optimise(mesh: MeshLike, output: Any = None, **arguments: Any) -> Result:
    """As Client.optimise(), with the shared client."""
    return shared_client().optimise(mesh, output, **arguments)


def quality(mesh: MeshLike, **arguments: Any) -> CellQuality:
    """As Client.quality(), with the shared client."""
    return shared_client().quality(mesh, **arguments)


optimize = optimise
