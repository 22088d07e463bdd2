"""Clients of --http that send or read slowly, or not at all.
ctest runs it with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in the environment."""
import concurrent.futures
import contextlib
import hashlib
import os
import shutil
import socket
import subprocess
import sys
import threading
import time
import unittest

from over_http import WithHttp
from programs import ENDLESS, LARGER, MESH


class Slow(WithHttp):
    """Those who send bytes one at a time have no place for longer than others."""

    def drip(self, head, seconds, byte=b"x"):
        """Sends a byte every half second. Returns what came, and after how long."""
        begun = time.monotonic()
        with self.dial(1) as connection:
            connection.sendall(head)
            connection.settimeout(0.5)
            while time.monotonic() - begun < seconds:
                try:
                    connection.sendall(byte)
                    return connection.recv(65536), time.monotonic() - begun
                except TimeoutError:
                    pass
                except OSError:
                    return b"", time.monotonic() - begun
        self.fail(f"the server still waits after {seconds} s")

    def test_bodies(self):
        digest = "0" * 64
        requests = [f"POST /v1/jobs HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: {type}\r\nContent-Length: {size}\r\n\r\n".encode()
                    for type, size in (("application/json", 4000), ("application/json", 4000000), ("multipart/form-data; boundary=x", 1 << 30))]
        requests.append(f"PUT /v1/meshes?digest={digest} HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/octet-stream\r\n"
                        f"Content-Length: {1 << 30}\r\n\r\n".encode())
        with concurrent.futures.ThreadPoolExecutor() as pool:
            for came, seconds in pool.map(lambda head: self.drip(head, 50), requests):
                self.assertRegex(came, rb"^HTTP/1.1 (400|409) ")
                self.assertGreater(seconds, 20)
        self.still_answers()

    def test_an_upload_may_pause(self):
        data = MESH.read_bytes()
        with self.dial(20) as connection:
            connection.sendall(f"PUT /v1/meshes?digest={hashlib.sha256(data).hexdigest()} HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: "
                               f"application/octet-stream\r\nContent-Length: {len(data)}\r\n\r\n".encode() + data[:500])
            time.sleep(7)
            connection.sendall(data[500:])
            self.assertIn(b" 200 OK", connection.recv(65536))

    def test_headers(self):
        heads = (b"", b"GET /v1/info HTTP/1.1\r\nHost: 127.0.0.1\r\n", b"GET /v1/info HTTP/1.1\r\nHost: 127.0.0.1\r\nX: ")
        with concurrent.futures.ThreadPoolExecutor() as pool:
            for came, seconds in pool.map(lambda head: self.drip(head, 10), heads):
                self.assertNotIn(b" 200 ", came)
        self.still_answers()

    def test_headers_without_an_end(self):
        for line in (b"X: " + b"a" * 1000 + b"\r\n", b"a" * 1000):
            sent = 0
            with self.dial(10) as connection:
                connection.sendall(b"GET /v1/info HTTP/1.1\r\nHost: 127.0.0.1\r\n")
                try:
                    while sent < 50 << 20:
                        connection.sendall(line)
                        sent += len(line)
                except OSError:
                    pass
            self.assertLess(sent, 20 << 20, "the server reads on and on")
        self.still_answers()

    def test_watchers_lose_their_places(self):
        """Who takes no byte of a watch is cut soon, and another one has the place."""
        job = self.submit(LARGER, *ENDLESS)
        slow = []
        self.addCleanup(lambda: [one.close() for one in slow])
        for _ in range(128):
            one = self.dial(room=4096)
            one.sendall(f"GET /v1/jobs/{job}/events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
            slow.append(one)
        path, begun = f"/v1/jobs/{job}/events", time.monotonic()
        time.sleep(1)
        self.assertEqual(self.reason("GET", path), (429, "PEER_LIMIT"))
        while b" 429 " in self.first_bytes(path):
            self.assertLess(time.monotonic() - begun, 45, "the places are kept")
            time.sleep(1)

    def first_bytes(self, path):
        with self.dial(20) as connection:
            connection.sendall(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
            return connection.recv(4096)

    def test_readers(self):
        """Who watches and takes no byte does not hold others up."""
        job = self.submit(LARGER, *ENDLESS)
        slow = []
        self.addCleanup(lambda: [one.close() for one in slow])
        for _ in range(20):
            one = self.dial(room=4096)
            one.sendall(f"GET /v1/jobs/{job}/events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
            slow.append(one)
        for _ in range(5):
            begun = time.monotonic()
            self.assertEqual(self.ask("GET", "/v1/info")[0], 200)
            self.assertLess(time.monotonic() - begun, 10)
            time.sleep(0.5)


# The system takes a few megabytes for a reader who does not read yet. It takes less in a network of its own with this line.
SMALL_BUFFERS = ["unshare", "--user", "--map-root-user", "--net", "sh", "-c",
                 'ip link set lo up && echo "4096 4096 16384" > /proc/sys/net/ipv4/tcp_wmem && exec "$@"', "sh"]


class ReadersOfThePage(WithHttp):
    """Nobody has to say who they are for the page's files. They have few places, and whoever reads slowly is given up."""

    def setUp(self):
        if "VARIMESH_SMALL_BUFFERS" in os.environ:
            super().setUp()

    def test_leave_threads_to_others(self):
        if "VARIMESH_SMALL_BUFFERS" in os.environ:
            return self.check()
        if shutil.which("ip") is None or subprocess.run([*SMALL_BUFFERS, "true"], capture_output=True, timeout=20).returncode != 0:
            self.skipTest("this user can make no network with small buffers")
        done = subprocess.run([*SMALL_BUFFERS, sys.executable, __file__, "ReadersOfThePage"], env={**os.environ, "VARIMESH_SMALL_BUFFERS": "1"},
                              capture_output=True, text=True, timeout=200)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def ask_for_script(self):
        one = self.dial(room=4096)
        one.sendall(b"GET /three.js HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        return one

    def check(self):
        slow = [self.ask_for_script() for _ in range(400)]  # more than there are threads
        begun = time.monotonic()
        ended = threading.Event()

        def trickle():
            while not ended.wait(0.2):
                for one in slow:
                    with contextlib.suppress(OSError):
                        one.recv(4096, socket.MSG_DONTWAIT)

        codes = [one.recv(12, socket.MSG_PEEK) for one in slow]
        reader = threading.Thread(target=trickle)
        reader.start()
        self.addCleanup(reader.join)
        self.addCleanup(ended.set)
        self.assertEqual(self.ask("GET", "/v1/info")[0], 200)
        self.assertLess(time.monotonic() - begun, 10)
        self.assertGreaterEqual(codes.count(b"HTTP/1.1 200"), 32)
        self.assertGreater(codes.count(b"HTTP/1.1 429"), 200, "the files of the page take the threads of other requests")
        while self.ask_for_script().recv(12) != b"HTTP/1.1 200":
            self.assertLess(time.monotonic() - begun, 15, "the places are kept")
            time.sleep(0.5)


class Stopping(WithHttp):
    """A server that stops waits for no client."""

    def stops(self):
        begun = time.monotonic()
        self.server.stop()
        return time.monotonic() - begun

    def open(self, head, reads=True):
        one = self.dial(room=None if reads else 4096)
        one.sendall(head)
        return one

    def test_slow_uploads(self):
        """They send a little again and again, so none of them is silent for long."""
        uploads = [self.open(f"PUT /v1/meshes?digest={'0' * 64}&uploadId={i} HTTP/1.1\r\nContent-Type: application/octet-stream\r\n"
                             f"Host: 127.0.0.1\r\nContent-Length: {1 << 30}\r\n\r\n".encode() + bytes(600_000)) for i in range(8)]
        ended = threading.Event()

        def send():
            while not ended.wait(0.2):
                for one in uploads:
                    with contextlib.suppress(OSError):
                        one.sendall(bytes(30_000))

        sender = threading.Thread(target=send)
        sender.start()
        time.sleep(1.5)
        self.assertLess(self.stops(), 2.5)
        ended.set()
        sender.join()

    def test_watchers_that_read_nothing(self):
        job = self.submit(LARGER, *ENDLESS)
        for _ in range(20):
            self.open(f"GET /v1/jobs/{job}/events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode(), reads=False)
        time.sleep(15)  # the buffers are full
        self.assertLess(self.stops(), 2.5)

    def test_half_requests(self):
        for i in range(20):
            self.open((b"", b"GET /v1/info HTTP/1.1\r\nHost: ")[i % 2])
        self.assertLess(self.stops(), 2.5)


if __name__ == "__main__":
    unittest.main(verbosity=2)
