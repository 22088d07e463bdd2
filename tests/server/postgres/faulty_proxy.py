"""A proxy before an S3 server that fails as servers and networks do."""
import itertools
import random
import select
import socket
import threading
import time

UNAVAILABLE = (b"HTTP/1.1 503 Slow Down\r\nContent-Length: 38\r\nConnection: close\r\n\r\n"
               b"<Error><Code>SlowDown</Code></Error>\r\n")


class FaultyProxy:
    """Passes connections on to a port of this machine. As soon as it is `faulty`, of each ten it answers two with 503, cuts two
    in their requests and two in their answers, after a random number of bytes, and passes one on slowly."""

    ORDER = ("503", "whole", "cut request", "slow", "cut answer", "whole", "503", "cut answer", "whole", "cut request")

    def __init__(self, port, seed=7):
        self.server_port, self.chance, self.faulty = port, random.Random(seed), False
        self.counts = dict.fromkeys(self.ORDER, 0)
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port, self.ended = self.listener.getsockname()[1], threading.Event()
        threading.Thread(target=self.accept, daemon=True).start()

    def close(self):
        self.ended.set()
        self.listener.close()

    def accept(self):
        for kind in itertools.cycle(self.ORDER):
            try:
                client, _ = self.listener.accept()
            except OSError:
                return
            kind = kind if self.faulty else "whole"
            threading.Thread(target=self.serve, args=(client, kind, self.chance.randrange(1, 6000)), daemon=True).start()

    def serve(self, client, kind, limit):
        with client, socket.create_connection(("127.0.0.1", self.server_port)) as server:
            # Clients keep their connections; new ones meet new faults.
            begun, passed = time.monotonic(), {client: 0, server: 0}
            cut = {"cut request": client, "cut answer": server}.get(kind)
            try:
                while not self.ended.is_set() and time.monotonic() - begun < (3 if kind == "slow" else 1):
                    for source in select.select([client, server], [], [], 0.2)[0]:
                        data = source.recv(4096)
                        if not data:
                            return
                        if kind == "503":
                            self.counts[kind] += 1
                            client.sendall(UNAVAILABLE)
                            return
                        passed[source] += len(data)
                        if source is cut and passed[source] > limit:
                            self.counts[kind] += 1
                            (server if source is client else client).sendall(data[:len(data) // 2])
                            return
                        if kind == "slow":
                            time.sleep(0.1)
                        (server if source is client else client).sendall(data)
                if passed[client]:
                    self.counts[kind] += 1
            except OSError:
                pass
