"""Connections that would take all descriptors of a server, and a server that no longer reaches itself.
ctest runs it with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in the environment."""
import http.client
import os
import re
import resource
import subprocess
import threading
import time
import unittest
from pathlib import Path

from connections import allow_many, open_connections
from programs import ENDLESS, LARGER, MESH, VARIMESHD, WithFolder, run

DESCRIPTORS, CONNECTIONS = 256, 1000


class Flood(WithFolder):
    def serve(self, *flags):
        """A server with few descriptors, its address and that of its admin port."""
        server = subprocess.Popen(
            [VARIMESHD, "--listen", "127.0.0.1:0", "--admin", "127.0.0.1:0", "--state", self.folder / "state", "--threads", "1",
             *flags], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (DESCRIPTORS, DESCRIPTORS)))
        log = []
        reader = threading.Thread(target=lambda: log.extend(server.stderr))
        reader.start()

        def end():
            server.kill() if server.poll() is None else None
            server.wait(20)
            reader.join()
            server.stderr.close()

        self.addCleanup(end)
        self.until(lambda: re.search("live page is at", "".join(log)), 20, lambda: "".join(log))
        text = "".join(log)
        return server, re.search(r"listens on (\S+)", text)[1], re.search(r"http://([^/]+)/", text)[1], log

    def until(self, holds, seconds, why=lambda: ""):
        deadline = time.monotonic() + seconds
        while not holds():
            self.assertLess(time.monotonic(), deadline, why())
            time.sleep(0.1)

    def flood(self, address, source):
        """Opens connections from an address, which stay. Returns what closes them."""
        self.addCleanup(resource.setrlimit, resource.RLIMIT_NOFILE, allow_many())
        opened = open_connections(address, source, CONNECTIONS)

        def close():
            while opened:
                opened.pop().close()

        self.addCleanup(close)
        return close

    @staticmethod
    def readiness(admin):
        """The status of the answer; None if there is none, as there is no descriptor for the question."""
        connection = http.client.HTTPConnection(admin, timeout=5)
        try:
            connection.request("GET", "/healthz/ready")
            return connection.getresponse().status
        except OSError:
            return None
        finally:
            connection.close()

    def optimise(self, address):
        done = run("optimise", MESH, "--server", address, "-o", self.folder / "out.msh")
        self.assertEqual(done.returncode, 0, done.stderr)

    def test_the_connections_of_one_address_leave_room_for_others(self):
        server, address, admin, log = self.serve()
        self.flood(address, "127.0.0.2")
        for _ in range(3):
            self.optimise(address)
            self.assertEqual(self.readiness(admin), 200)
        self.assertIn("connections are refused, first one from 127.0.0.2", "".join(log))
        if os.geteuid() == 0:  # others may not look
            held = len(list(Path(f"/proc/{server.pid}/fd").iterdir()))
            self.assertLess(held, DESCRIPTORS * 3 // 4)

    def test_a_full_server_says_so_and_goes_on(self):
        """Its call to itself comes from the address that has all connections. It does not end, as the next would be as full."""
        server, address, admin, log = self.serve("--watchdog-seconds", "6")
        job = run("submit", LARGER, "--server", address, *ENDLESS).stdout.strip()
        close = self.flood(address, "127.0.0.1")
        self.until(lambda: self.readiness(admin) == 503, 20)
        time.sleep(14)
        self.assertIsNone(server.poll(), "".join(log)[-2000:])
        self.assertEqual(self.readiness(admin), 503)
        close()
        self.until(lambda: self.readiness(admin) == 200, 20)
        self.assertEqual(run("cancel", job, "--server", address).returncode, 0)
        self.optimise(address)

    def test_a_server_that_does_not_reach_itself_ends_and_keeps_its_jobs(self):
        server, address, admin, log = self.serve("--watchdog-seconds", "6")
        self.assertEqual(self.readiness(admin), 200)
        job = run("submit", LARGER, "--server", address, *ENDLESS).stdout.strip()
        # It has descriptors, but gets no more: it accepts nobody.
        resource.prlimit(server.pid, resource.RLIMIT_NOFILE, (10, DESCRIPTORS))
        self.assertEqual(server.wait(60), 1, "".join(log)[-2000:])
        self.assertIn("has not reached itself for", "".join(log))
        _, address, _, _ = self.serve()
        self.assertIn(job, run("jobs", "--server", address).stdout)
        self.assertEqual(run("cancel", job, "--server", address).returncode, 0)
        self.optimise(address)


if __name__ == "__main__":
    unittest.main()
