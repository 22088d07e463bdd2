"""Server-sent events over HTTP (--http): a watcher sees what one by gRPC sees, over cuts and restarts. ctest runs it with
VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in the environment, and with the Python package of the build tree."""
import http.client
import json
import signal
import sys
import threading
import time
import unittest

from over_http import TLS, WithHttp
from programs import ENDLESS, LARGER

try:
    import grpc
    from google.protobuf import json_format
    from varimesh.v1 import service_pb2, service_pb2_grpc
except ModuleNotFoundError as missing:
    print(f"SKIPPED: {missing} (deploy/setup test)", flush=True)
    sys.exit(77)

ENDS = ("JOB_STATE_SUCCEEDED", "JOB_STATE_FAILED", "JOB_STATE_CANCELLED")


class Watcher:
    """Watches a job over HTTP in a thread. `cut_after`: it closes each connection after as many events, and comes again."""

    def __init__(self, test, job, after=0, cut_after=None):
        self.test, self.job, self.cut_after, self.events, self.comments, self.cuts = test, job, cut_after, [], 0, 0
        self.last, self.first, self.stopped = after, True, False
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def run(self):
        while not self.stopped:
            try:
                if self.connect():
                    return
            except (OSError, http.client.HTTPException):
                pass
            self.cuts += 1
            time.sleep(0.02)

    def connect(self):
        """Reads one answer. Returns whether the watch has come to its end."""
        connection = self.test.connection()
        path = f"/v1/jobs/{self.job}/events" + (f"?after={self.last}" if self.first else "")
        connection.request("GET", path, headers={} if self.first else {"Last-Event-ID": str(self.last)})
        answer = connection.getresponse()
        if answer.status == 204:
            return True
        if answer.status in (429, 503):
            return False
        assert answer.status == 200 and answer.headers["Content-Type"] == "text/event-stream", (answer.status, answer.read())
        self.first, here, event = False, 0, {}
        try:
            while line := answer.readline():
                field, _, value = line.decode().rstrip("\n").partition(": ")
                if line == b"\n":
                    if event:
                        self.take(event)
                        here += 1
                    event = {}
                    if self.cut_after and here >= self.cut_after:
                        return False
                elif field:
                    event[field] = value
                else:
                    self.comments += 1
            # http.client tells no cut from an end when lines are read, so the end is what the last event says.
            return bool(self.events) and self.events[-1].get("stateChange", {}).get("state") in ENDS
        finally:
            connection.close()

    def take(self, event):
        data = json.loads(event["data"])
        assert event["id"] == data["sequence"], event
        self.last = int(event["id"])
        if "bookmark" not in data:
            self.events.append(data)

    def wait(self, seconds=60):
        self.thread.join(seconds)
        self.test.assertFalse(self.thread.is_alive(), (self.last, self.cuts))
        return self.events


class GrpcWatcher(Watcher):
    """The same by gRPC. If the server no longer keeps all iterations, it watches from the start, as our clients do."""

    def channel(self):
        if not TLS:
            return grpc.insecure_channel(self.test.server.address)
        authority = (self.test.folder / "certificates" / "authority.pem").read_bytes()
        return grpc.secure_channel(self.test.server.address, grpc.ssl_channel_credentials(authority))

    def connect(self, after=None):
        with self.channel() as channel:
            request = service_pb2.WatchJobRequest(name=f"jobs/{self.job}", after_sequence=self.last if after is None else after)
            try:
                for response in service_pb2_grpc.JobServiceStub(channel).WatchJob(request, timeout=60):
                    event = response.event
                    if event.WhichOneof("event") == "bookmark" or event.sequence <= self.last:
                        continue
                    event.thinned = min(event.thinned, event.sequence - self.last - 1)
                    self.last = event.sequence
                    self.events.append(json_format.MessageToDict(event))
            except grpc.RpcError as error:
                return error.code() == grpc.StatusCode.OUT_OF_RANGE and self.connect(0)
        return True


class Checked(WithHttp):
    def check(self, events):
        """Ordered and unique, and each gap in the numbers is what the event says, unless a server was lost."""
        last = 0
        for event in events:
            sequence = int(event["sequence"])
            self.assertGreater(sequence, last)
            if sequence // 10**9 == last // 10**9:
                self.assertEqual(sequence - last - 1, int(event.get("thinned", 0)), event)
            last = sequence
        self.assertIn(events[-1]["stateChange"]["state"], ENDS)

    def check_same(self, events, truth):
        """What no watcher may miss is the same for both, and so is each iteration that both have seen."""
        self.check(events)
        self.check(truth)
        known = {event["sequence"]: {**event, "thinned": 0} for event in truth}
        for event in events:
            if event["sequence"] in known:
                self.assertEqual({**event, "thinned": 0}, known[event["sequence"]])
        for kind in ("stateChange", "quality", "log"):
            self.assertEqual([event["sequence"] for event in events if kind in event],
                             [event["sequence"] for event in truth if kind in event])


class Events(Checked):
    def test_sees_what_a_watcher_by_grpc_sees(self):
        job = self.submit(LARGER, "--method", "sweeps", "--tolerance", "1e-15", "--max-iterations", "300")
        truth = GrpcWatcher(self, job)
        watchers = [Watcher(self, job), Watcher(self, job, cut_after=1), Watcher(self, job, cut_after=17)]
        expected = truth.wait()
        self.assertGreater(len(expected), 300)
        for watcher in watchers:
            self.assertEqual(watcher.wait(), expected, "a job of few iterations loses none")
        self.check(expected)
        self.assertGreater(watchers[1].cuts, 300)
        late = Watcher(self, job, after=int(expected[-3]["sequence"]))
        self.assertEqual(late.wait(), expected[-2:])
        self.assertEqual(Watcher(self, job, after=int(expected[-1]["sequence"])).wait(), [], "there is nothing more")

    def test_a_stream_that_ends_is_told_from_one_that_is_cut(self):
        job = self.submit(LARGER, *ENDLESS)
        with self.dial(20) as connection:
            connection.sendall(f"GET /v1/jobs/{job}/events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
            came = connection.recv(4096)
            begun = time.monotonic()
            self.server.stop()
            self.assertLess(time.monotonic() - begun, 15, "a watcher does not keep the server")
            while piece := connection.recv(65536):
                came += piece
        self.assertTrue(came.startswith(b"HTTP/1.1 200 "), came[:100])
        self.assertFalse(came.endswith(b"0\r\n\r\n"))

    def test_the_last_chunk_is_the_end(self):
        job = self.submit(LARGER, "--max-iterations", "2")
        self.wait(job, *ENDS)
        came = self.send(f"GET /v1/jobs/{job}/events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
        self.assertTrue(came.endswith(b"\n\n\r\n0\r\n\r\n"), came[-100:])
        came = self.send(f"GET /v1/jobs/{job}/events HTTP/1.0\r\nHost: 127.0.0.1\r\n\r\n".encode())
        self.assertTrue(came.endswith(b"}\n\n"), came[-100:])
        self.assertNotIn(b"chunked", came)

    def test_a_comment_shows_that_the_stream_is_alive(self):
        self.submit(LARGER, *ENDLESS)
        waiting = Watcher(self, self.submit(LARGER, *ENDLESS), after=1)
        deadline = time.monotonic() + 15
        while waiting.comments == 0:
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.1)
        self.assertEqual(waiting.events, [])
        waiting.stopped = True

    def test_refuses_what_is_no_watch(self):
        job = self.submit(LARGER, *ENDLESS)
        path = f"/v1/jobs/{job}/events"
        for query in ("?after=-1", "?after=x", "?after=99999999999999999999", "?minInterval=5", "?minInterval=-1s", "?minInterval=9999s",
                      "?minInterval=%22", "?from=1"):
            self.assertEqual(self.ask("GET", path + query)[0], 400, query)
        self.assertEqual(self.ask("GET", path, headers={"Last-Event-ID": "x"})[0], 400)
        self.assertEqual(self.reason("GET", path + "?after=7777777777"), (400, "SEQUENCE_EXPIRED"))
        self.assertEqual(self.reason("GET", "/v1/jobs/" + "0" * 32 + "/events"), (404, "JOB_NOT_FOUND"))
        self.assertEqual(self.ask("POST", path, {})[0], 405)


class Limited(WithHttp):
    def flags(self):
        return ("--max-watches-per-peer", "2")

    def test_watches_count_both_ways(self):
        job = self.submit(LARGER, *ENDLESS)
        by_grpc, over_http = GrpcWatcher(self, job), Watcher(self, job)
        deadline = time.monotonic() + 20
        while not (by_grpc.events and over_http.events):
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.02)
        self.assertEqual(self.reason("GET", f"/v1/jobs/{job}/events"), (429, "PEER_LIMIT"))
        self.assertEqual(self.ask("GET", "/v1/info")[0], 200)
        over_http.stopped, over_http.cut_after = True, 1  # it goes, and leaves its place to others
        over_http.wait()
        deadline, again = time.monotonic() + 20, Watcher(self, job, cut_after=3)
        while not again.events:
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.02)
        again.stopped = by_grpc.stopped = True
        self.assertEqual(self.ask("POST", f"/v1/jobs/{job}/cancel")[0], 200)


class Restarts(Checked):
    def flags(self):
        return ("--state", str(self.folder / "state"))

    def restarted(self, how):
        job = self.submit(LARGER, *ENDLESS)
        watchers = [GrpcWatcher(self, job), Watcher(self, job), Watcher(self, job, cut_after=5)]
        for watcher in watchers:
            while len(watcher.events) < 30:
                time.sleep(0.02)
        if how == signal.SIGTERM:
            self.server.stop()
        else:
            self.server.process.send_signal(how)
            self.server.process.wait(20)
        seen = [watcher.last for watcher in watchers]
        self.start()
        for watcher, last in zip(watchers, seen):
            deadline = time.monotonic() + 40
            while watcher.last <= last:
                self.assertLess(time.monotonic(), deadline)
                time.sleep(0.02)
        self.assertEqual(self.ask("POST", f"/v1/jobs/{job}/cancel")[0], 200)
        truth, *others = [watcher.wait() for watcher in watchers]
        for events in others:
            self.check_same(events, truth)

    def test_over_a_restart(self):
        self.restarted(signal.SIGTERM)

    def test_over_the_loss_of_a_server(self):
        self.restarted(signal.SIGKILL)


if __name__ == "__main__":
    unittest.main(verbosity=2)
