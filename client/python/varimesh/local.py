"""A private server for a program. It listens on a socket that only its owner can use, and ends with the program, however
the program ends."""
from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import time
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import IO

from .client import Client
from .errors import ServerUnreachable
from .requirements import find_program

# The shell ends the server when the shell's standard input ends. That happens even if this process is killed.
_KEEPER = """
exec 3<&0
"$@" 3<&- &
server=$!
{ read -r _ <&3; kill -TERM $server; } &
reader=$!
exec 3<&-
wait $server
status=$?
kill $reader 2>/dev/null
exit $status
"""


class LocalClient(Client):
    """A client with a server of its own, which close() stops."""

    _stop: Callable[[], object] | None = None

    def close(self) -> None:
        super().close()
        if self._stop is not None:
            self._stop()


def find_server() -> str:
    """The path of varimeshd: from VARIMESHD, in this package, or from PATH."""
    found = find_program("varimeshd", "VARIMESHD")
    if found is None:
        raise ServerUnreachable("There is no varimeshd that can be run; install varimesh-server, or set VARIMESHD to its path.")
    return found


def local(*, threads: int = 0, state: str | os.PathLike[str] | None = None, executable: str | None = None,
          log: IO[bytes] | None = None, timeout: float = 20.0, processes: bool = False) -> LocalClient:  # fmt: skip
    """Starts a server and returns a client of it. `with varimesh.local() as client: …` stops the server at its end.

    `threads` is the number of threads for the running jobs; 0 means all of the machine's. `state` is a directory that
    keeps jobs and meshes. `log` takes the server's log. By default the log goes nowhere, but an error at the start is in the
    exception. With `processes`, each job runs in a process of its own, which jobs with a geometry need; `varimesh_worker`
    must be installed with the server.
    """
    folder = Path(tempfile.mkdtemp(prefix="varimesh-"))
    socket, port_file, log_file = (folder / name for name in ("socket", "address", "log"))
    command = [executable or find_server(), "--listen", f"unix:{socket}", "--port-file", str(port_file),
               "--isolation", "process" if processes else "none", "--threads", str(threads), "--log-level", "info" if log else "error"]  # fmt: skip
    command += ["--state", os.fspath(state)] if state is not None else ["--data", str(folder)]
    with open(log_file, "wb") as own_log:
        # The server has a session of its own. Ctrl-C at the terminal goes to the program, which cancels its job and stops
        # the server.
        server = subprocess.Popen(["/bin/sh", "-c", _KEEPER, "varimeshd", *command], stdin=subprocess.PIPE,
                                  stdout=subprocess.DEVNULL, stderr=log or own_log, start_new_session=True)  # fmt: skip
    deadline = time.monotonic() + timeout
    while not port_file.exists():
        if server.poll() is not None or time.monotonic() > deadline:
            said = log_file.read_text(errors="replace").strip()
            _end(server, folder, os.getpid())
            raise ServerUnreachable(f"{command[0]} did not start: {said or 'it printed nothing'}.")
        time.sleep(0.005)
    client = LocalClient(f"unix:{socket}", token="")
    client._stop = weakref.finalize(client, _end, server, folder, os.getpid())
    return client


def _end(server: subprocess.Popen[bytes], folder: Path, owner: int) -> None:
    if os.getpid() != owner:  # a fork of the program ends; the server is not its
        return
    assert server.stdin is not None
    server.stdin.close()
    try:
        server.wait(40)
    except subprocess.TimeoutExpired:
        os.killpg(server.pid, 9)
        server.wait()
    shutil.rmtree(folder, ignore_errors=True)
