"""Watchers over HTTP at several front ends, which change from one to another, see what one by gRPC sees. ctest runs it with VARIMESH,
VARIMESHD and VARIMESH_SOURCE_DIR in the environment, and with the Python package of the build tree. It starts a PostgreSQL server of
its own."""
import re
import signal
import sys
import time
import unittest

from farm import DATABASE_SERVER, HERE, WithFarm, skip_without
from programs import ENDLESS, LARGER

sys.path.insert(0, str(HERE.parent / "http"))
from events_test import Checked, GrpcWatcher, Watcher


class FarmHttp(WithFarm):
    check, check_same, connection = Checked.check, Checked.check_same, Checked.connection

    @property
    def http(self):
        """The address for the next connection: that of another front end each time."""
        self.turn += 1
        return self.addresses[self.turn % len(self.addresses)]

    def until(self, holds, what):
        deadline = time.monotonic() + 60
        while not holds():
            self.assertLess(time.monotonic(), deadline, what)
            time.sleep(0.02)

    def test_watchers_change_front_ends_and_workers_are_lost(self):
        self.turn, servers = 0, [self.front_end("--http", "127.0.0.1:0") for _ in range(3)]
        self.server = servers[0]  # that of the watcher by gRPC
        found = lambda server: re.search(r"http://(127\.0\.0\.1:\d+)/v1/", "".join(server.log))
        for server in servers:
            self.until(lambda: found(server), "its address for HTTP")
        self.addresses = [found(server)[1] for server in servers]
        worker = self.worker()
        job = self.ask(self.server, "submit", LARGER, *ENDLESS).split()[0].removeprefix("jobs/")
        watchers = [GrpcWatcher(self, job), Watcher(self, job), Watcher(self, job, cut_after=2), Watcher(self, job, cut_after=3)]
        for watcher in watchers:
            self.until(lambda: len(watcher.events) > 5, "the first events")
        servers[2].process.kill()
        self.until(lambda: watchers[2].cuts > 10 and watchers[3].cuts > 10, "the others go on")
        worker.end(signal.SIGKILL)
        self.worker()
        for watcher in watchers:
            self.until(lambda: any(event.get("attempt") == 2 and "iteration" in event for event in watcher.events), "the second attempt")
        self.ask(self.server, "cancel", f"jobs/{job}")
        # Each front end gives an iteration the time at which it has heard of it.
        truth, *others = [[{**event, "time": ""} if "iteration" in event else event for event in watcher.wait()] for watcher in watchers]
        for events in others:
            self.check_same(events, truth)
        states = [event["stateChange"]["state"].removeprefix("JOB_STATE_") for event in truth if "stateChange" in event]
        self.assertEqual((states[:4], states[-1]), (["PENDING", "RUNNING"] * 2, "CANCELLED"))  # A busy machine may lose the second worker too.


if __name__ == "__main__":
    skip_without(DATABASE_SERVER)
    unittest.main(verbosity=2)
