"""Many connections of one client to a server, which stay."""
import resource
import socket
import struct
import time

# What a client of HTTP/2 says first: the preface and an empty SETTINGS. Who says it may stay.
HELLO = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + struct.pack(">I", 0)[1:] + bytes([4, 0, 0, 0, 0, 0])


def allow_many():
    """Lets this process have as many descriptors as it may. Returns the limits before."""
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (before[1], before[1]))
    return before


def open_connections(address, source, count):
    """Opens so many connections to HOST:PORT from the address `source`, and says HELLO on each. Returns the sockets."""
    host, port = address.rsplit(":", 1)
    opened = []
    for _ in range(count):
        one = socket.socket()
        one.setblocking(False)
        one.bind((source, 0))
        one.connect_ex((host, int(port)))
        opened.append(one)
    time.sleep(0.5)
    for one in opened:
        try:
            one.send(HELLO)
        except OSError:
            pass
    return opened
