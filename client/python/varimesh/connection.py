"""Calls that repeat themselves while the server is away, and the errors that they raise.

Repeating is safe: every call of the contract is made to be repeated.
"""
from __future__ import annotations

import os
import socket
import ssl
import stat
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias

import grpc

from .errors import BadOption, Refused, ServerUnreachable, Stopped, VarimeshError
from .rpc import error_details_pb2, status_pb2

_CALL_SECONDS = 30.0
PathLike: TypeAlias = "str | os.PathLike[str]"


def _details(error: grpc.RpcError) -> tuple[error_details_pb2.ErrorInfo, float]:
    """The reason, and the seconds after which to ask the server again (0: it does not say)."""
    info, delay = error_details_pb2.ErrorInfo(), 0.0
    for key, value in error.trailing_metadata() or ():
        if key != "grpc-status-details-bin":
            continue
        for detail in status_pb2.Status.FromString(value).details:
            # Compared by name: this package's messages have google.rpc's wire format, but a name of their own.
            kind = detail.type_url.rsplit("/", 1)[-1]
            if kind == "google.rpc.ErrorInfo":
                info.ParseFromString(detail.value)
            elif kind == "google.rpc.RetryInfo":
                retry = error_details_pb2.RetryInfo.FromString(detail.value)
                delay = retry.retry_delay.ToMilliseconds() / 1000
    return info, delay


def reason_of(error: grpc.RpcError) -> str:
    return _details(error)[0].reason


def error_of(error: grpc.RpcError) -> VarimeshError:
    """The error to raise for a status."""
    info, _ = _details(error)
    code, sentence = error.code(), error.details() or ""
    if code == grpc.StatusCode.DEADLINE_EXCEEDED:
        return ServerUnreachable("The server does not answer; check that varimeshd runs there and is not overloaded.")
    if code == grpc.StatusCode.UNAVAILABLE and not info.reason:
        return ServerUnreachable(f"The server cannot be reached ({sentence}); check that varimeshd runs there.")
    if code == grpc.StatusCode.UNAVAILABLE or not info.reason:
        return ServerUnreachable(sentence or f"The call failed ({code.name}).", info.reason, info.metadata)
    return Refused(sentence, info.reason, info.metadata)


class Stop:
    """Lets one thread end the calls of another."""

    current = threading.local()

    def __init__(self) -> None:
        self._asked = threading.Event()
        self._calls: set[Any] = set()
        self._lock = threading.Lock()

    def ask(self) -> None:
        self._asked.set()
        with self._lock:
            for call in self._calls:
                call.cancel()

    @classmethod
    def of_this_thread(cls) -> Stop:
        if not hasattr(cls.current, "stop"):
            cls.current.stop = Stop()
        stop: Stop = cls.current.stop
        return stop

    def check(self) -> None:
        if self._asked.is_set():
            raise Stopped("The call was cancelled.")

    def sleep(self, seconds: float) -> None:
        self._asked.wait(seconds)
        self.check()

    @contextmanager
    def ends(self, call: Any) -> Iterator[Any]:
        """Cancels the call if the block ends before the call does, or if somebody asks for it."""
        with self._lock:
            self._calls.add(call)
        try:
            self.check()
            yield call
        finally:
            with self._lock:
                self._calls.discard(call)
            call.cancel()


class Patience:
    """Repeats calls to a server that is away, with growing pauses, until it has been away for too long."""

    def __init__(self, connection: Connection, channel: grpc.Channel) -> None:
        self._connection, self._channel, self._seconds = connection, channel, connection.retry_seconds
        self.reset()

    def reset(self) -> None:
        """The server has answered, so it may be away for the full time again."""
        self._away_since, self._pause = 0.0, 0.05

    def again(self, error: grpc.RpcError) -> None:
        """Waits before the next repeat. Raises the error if repeating does not help."""
        stop = Stop.of_this_thread()
        stop.check()
        now = time.monotonic()
        info, delay = _details(error)
        # A server that says that it stops was there a moment ago, however often that happens.
        self._away_since = now if info.reason == "STOPPING" else self._away_since or now
        left = self._away_since + self._seconds - now
        code = error.code()
        if code == grpc.StatusCode.RESOURCE_EXHAUSTED and 0 < delay <= left:
            stop.sleep(delay)
            return
        # CANCELLED, although nobody here asked for it: the call came at the moment when the server shut down.
        if code not in (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.CANCELLED) or left <= 0:
            raise error_of(error) from None
        stop.sleep(min(self._pause, left))
        self._pause = min(2 * self._pause, 2.0)
        # gRPC connects at once if somebody waits, and otherwise tries only now and then.
        wait_for_channel(self._channel, min(1.0, left), self._connection.metadata)
        stop.check()


def wait_for_channel(channel: grpc.Channel, seconds: float, metadata: Any = ()) -> bool:
    """Whether the server answers within this time."""
    # A call that waits for the connection. Any answer will do.
    check = channel.unary_unary("/grpc.health.v1.Health/Check")
    call = check.future(b"", timeout=seconds, wait_for_ready=True, metadata=metadata)
    with Stop.of_this_thread().ends(call):
        try:
            call.result()
        except grpc.FutureCancelledError:
            return False
        except grpc.RpcError as error:
            return error.code() not in (grpc.StatusCode.DEADLINE_EXCEEDED, grpc.StatusCode.UNAVAILABLE)
    return True


def find_token(token: str | None, token_file: str | os.PathLike[str] | None) -> str:
    """The token that was given, or that of a file, or that of VARIMESH_TOKEN or VARIMESH_TOKEN_FILE. Empty: none."""
    if token is None and token_file is None:
        token = os.environ.get("VARIMESH_TOKEN") or None
        token_file = os.environ.get("VARIMESH_TOKEN_FILE") or None
    if token is None and token_file is not None:
        try:
            token = Path(token_file).read_text(encoding="ascii").strip()
        except (OSError, UnicodeDecodeError):
            token = ""
        if not token:
            raise BadOption(f"The file of the token {os.fspath(token_file)} cannot be read or is empty; name a file with a token.")
    token = (token or "").strip()
    if any(not "!" <= letter <= "~" for letter in token):
        raise BadOption("The token is not one line of letters, digits and signs; check where it comes from.")
    return token


def find_credentials(address: str, authority: PathLike | None, certificate: PathLike | None,
                     key: PathLike | None) -> grpc.ChannelCredentials | None:  # fmt: skip
    """Credentials of files in PEM, or of those that VARIMESH_TLS_AUTHORITY, VARIMESH_TLS_CERTIFICATE and VARIMESH_TLS_KEY
    name. None: the connection is not encrypted."""
    if authority is None and certificate is None and key is None and not address.startswith("unix:"):
        authority, certificate, key = (os.environ.get("VARIMESH_TLS_" + name) or None
                                       for name in ("AUTHORITY", "CERTIFICATE", "KEY"))  # fmt: skip
    if authority is None and certificate is None and key is None and not address.startswith("https://"):
        return None
    if (certificate is None) != (key is None):
        raise BadOption("A certificate and its key belong together; give both.")
    parts = []
    for path in (authority, key, certificate):
        try:
            text = None if path is None else Path(path).read_bytes()
        except OSError:
            text = b""
        if text is not None and b"-----BEGIN " not in text:
            raise BadOption(f"The file {path!s} cannot be read or has nothing in PEM; name a file with a certificate or a key.")
        parts.append(text)
    return grpc.ssl_channel_credentials(*parts)


def default_address() -> str:
    """The address in VARIMESH_SERVER, or that of the socket on which a varimeshd of this user listens if nobody has given it
    an address: `socket` in the directory that VARIMESH_STATE names, otherwise varimeshd.socket in XDG_RUNTIME_DIR or in
    /tmp/varimeshd-UID. Raises BadOption if there is none."""
    if named := os.environ.get("VARIMESH_SERVER"):
        return named
    state, runtime = os.environ.get("VARIMESH_STATE"), os.environ.get("XDG_RUNTIME_DIR", "")
    places = [Path(f"/tmp/varimeshd-{os.geteuid()}/varimeshd.socket")]
    if state:
        places = [Path(state).absolute() / "socket"]
    elif runtime.startswith("/"):
        places.insert(0, Path(runtime) / "varimeshd.socket")
    for place in places:
        if _is_socket_of_this_user(place):
            return f"unix:{place}"
    raise BadOption(f"No server is named, and no varimeshd of yours listens on {places[0]}; start one, or name a server: "
                    "Client(address), or VARIMESH_SERVER.")


def _is_socket_of_this_user(path: Path) -> bool:
    try:
        # In /tmp another user could make the folder a link, and point it elsewhere later.
        folder = path.parent.lstat() if path.is_relative_to("/tmp") else path.parent.stat()
        itself = path.lstat()
    except OSError:
        return False
    mine = folder.st_uid == itself.st_uid == os.geteuid()
    return mine and not folder.st_mode & (stat.S_IWGRP | stat.S_IWOTH) and stat.S_ISSOCK(itself.st_mode)


def heard_from(address: str, seconds: float = 1.0) -> str:
    """What the server at HOST:PORT answers to the beginning of a TLS handshake: "tls", "plain" (HTTP/2), or "" if it says
    neither. "nobody": the machine is there, but nobody listens at this port, or at the path of a unix socket."""
    if address.startswith("unix:"):
        with socket.socket(socket.AF_UNIX) as connection:
            connection.settimeout(seconds)
            try:
                connection.connect(address.removeprefix("unix:").removeprefix("//"))
            except (FileNotFoundError, ConnectionRefusedError):
                return "nobody"
            except (OSError, ValueError):
                pass
        return ""
    host, _, port = address.rsplit("/", 1)[-1].rpartition(":")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE  # it only listens; nothing is entrusted to the server
    outgoing = ssl.MemoryBIO()
    try:
        context.wrap_bio(ssl.MemoryBIO(), outgoing).do_handshake()
    except ssl.SSLWantReadError:
        pass
    begin = b""
    try:
        with socket.create_connection((host.strip("[]"), int(port)), seconds) as connection:
            connection.sendall(outgoing.read())
            while len(begin) < 4 and (more := connection.recv(4 - len(begin))):
                begin += more
    except ConnectionRefusedError:
        return "nobody"
    except (OSError, ValueError):
        pass
    if begin[:2] in (b"\x15\x03", b"\x16\x03"):  # a record of TLS: an alert or a handshake
        return "tls"
    # A frame of HTTP/2 begins with three bytes of its length and one of its type; 4 are the settings.
    return "plain" if len(begin) == 4 and begin[0] == 0 and begin[3] == 4 else ""


class Connection:
    """Two channels to one server. Meshes have their own, so that they do not delay other calls; but a channel of the
    caller carries everything, and stays open."""

    def __init__(self, address: str, token: str, credentials: grpc.ChannelCredentials | None, connect_seconds: float,
                 retry_seconds: float, channel: grpc.Channel | None = None) -> None:  # fmt: skip
        self.address = address
        self.retry_seconds = retry_seconds
        self._connect_seconds = connect_seconds
        self.metadata: tuple[tuple[str, str], ...] = (("authorization", f"Bearer {token}"),) if token else ()
        # The calls are part of the trace of the program that has started this one, if it says so.
        parent = os.environ.get("TRACEPARENT", "")
        if 0 < len(parent) <= 256 and all("!" <= letter <= "~" for letter in parent):
            self.metadata += (("traceparent", parent),)
        self._met = False
        self._encrypted, self._owned = credentials is not None, channel is None
        self.control = channel or self._open(address, credentials, 1)
        self.bulk = channel or self._open(address, credentials, 2)

    @staticmethod
    def _open(address: str, credentials: grpc.ChannelCredentials | None, number: int) -> grpc.Channel:
        options = [
            ("varimesh.channel", number),  # channels with equal options would share one connection
            ("grpc.enable_retries", 0),
            # The client notices within 20 s that a server hangs or that the network has lost it. The server allows one
            # ping every 10 s.
            ("grpc.keepalive_time_ms", 15_000),
            ("grpc.keepalive_timeout_ms", 5_000),
            ("grpc.max_reconnect_backoff_ms", 2_000),
        ]
        if credentials is not None:
            return grpc.secure_channel(address, credentials, options)
        return grpc.insecure_channel(address, options)

    def meet(self) -> None:
        """Call it before the first call. Raises an error with a sentence if there is no server."""
        if self._met:
            return
        begin = time.monotonic()
        deadline = begin + self._connect_seconds
        stop = Stop.of_this_thread()
        heard = None
        while not wait_for_channel(self.control, 0.2, self.metadata):
            stop.check()
            if self._owned and heard is None:
                heard = heard_from(self.address)
            if heard == "tls" and not self._encrypted:
                raise ServerUnreachable(f"The server at {self.address} wants TLS; name the authority of its certificate with "
                                        "`authority`, or begin the address with https:// if this machine knows the authority.")
            if heard == "plain" and self._encrypted:
                raise ServerUnreachable(f"The server at {self.address} speaks no TLS; leave out https:// and the certificates, "
                                        "or start it with --tls-certificate.")
            if time.monotonic() > begin + 0.9:  # a server that is being started may need so long
                if heard == "nobody" and heard_from(self.address, 0.1) == "nobody":
                    deadline, self._encrypted = begin, False
                if heard == "tls":
                    self._raise_if_not_let_in()
                heard = "asked"
            if time.monotonic() > deadline and self._encrypted:
                raise ServerUnreachable(f"There is no server at {self.address} that answers with TLS ({self._why()}); check the "
                                        "address, and that the server's certificate is for this address and comes from "
                                        "the authority.")
            if time.monotonic() > deadline:
                raise ServerUnreachable(f"There is no server at {self.address}; start varimeshd there, or name another.")
        self._met = True

    def _raise_if_not_let_in(self) -> None:
        """Raises an error if a server that speaks TLS and this client do not come together."""
        why = self._why()
        # A server of gRPC closes the connection without a word if it does not accept the client's certificate.
        if "Socket closed" in why or "Connection reset" in why:
            raise ServerUnreachable(f"The server at {self.address} asks for a client's certificate that has not expired, from "
                                    "an authority that the server knows; name the certificate with `certificate` and `key`.")
        if "handshake failed" in why or "peer certificate" in why:
            raise ServerUnreachable(f"The certificate of the server at {self.address} is not for this address, has expired, or "
                                    f"does not come from the authority ({why}); check the address and `authority`.")

    def _why(self) -> str:
        """Why a connection does not come about."""
        try:
            self.control.unary_unary("/grpc.health.v1.Health/Check")(b"", timeout=1)
        except grpc.RpcError as error:
            return error.details() or ""
        return "it answers only now"

    def call(self, method: Any, request: Any) -> Any:
        """Sends one request and returns the answer."""
        self.meet()
        patience = Patience(self, self.control)
        while True:
            call = method.future(request, timeout=_CALL_SECONDS, metadata=self.metadata)
            with Stop.of_this_thread().ends(call):
                try:
                    return call.result()
                except grpc.FutureCancelledError:
                    Stop.of_this_thread().check()
                    error = call
                except grpc.RpcError as raised:
                    error = raised
            patience.again(error)

    @contextmanager
    def stream(self, method: Any, request: Any) -> Iterator[Any]:
        """A call with many answers, and one request or an iterator of requests. It ends with the block."""
        with Stop.of_this_thread().ends(method(request, metadata=self.metadata)) as call:
            yield call

    def close(self) -> None:
        if self._owned:
            self.control.close()
            self.bulk.close()
