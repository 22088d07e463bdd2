#!/usr/bin/env python3
"""Traces of a server, sent to a collector of this test. ctest runs it with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in
the environment. The collector reads the bytes by the numbers of the fields in OpenTelemetry's protocol, so that a wrong
number in server/tracing/otlp.proto is seen. The last test needs PostgreSQL's server.

  tracing_test.py Server|Farm
"""
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

sys.path[:0] = [str(Path(__file__).resolve().parents[1] / "postgres"), str(Path(__file__).resolve().parents[2] / "client")]
import farm
from programs import LARGER, MESH, VARIMESHD, Server, run

TRACE, PARENT = "4bf92f3577b34da6a3ce929d0e0e4736", "00f067aa0ba902b7"
PHASES = {"sweeps", "newton", "untangle", "accuracy"}


def fields(data):
    """The fields of a message as protobuf writes it: pairs of number and value."""
    at = 0

    def varint():
        nonlocal at
        value = shift = 0
        while True:
            byte = data[at]
            at += 1
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value

    while at < len(data):
        key = varint()
        number, kind = key >> 3, key & 7
        if kind == 0:
            yield number, varint()
        elif kind == 1:
            yield number, int.from_bytes(data[at:at + 8], "little")
            at += 8
        elif kind == 2:
            size = varint()
            yield number, data[at:at + size]
            at += size
        else:
            raise ValueError(f"kind {kind} of field {number}")


def all_of(data, number):
    return [value for found, value in fields(data) if found == number]


def one_of(data, number, otherwise=None):
    return next(iter(all_of(data, number)), otherwise)


def attributes(data, number):
    """Attributes: the key is field 1, the value field 2 with a string in 1 or a number in 3."""
    found = {}
    for pair in all_of(data, number):
        (kind, value), = fields(one_of(pair, 2))
        found[one_of(pair, 1).decode()] = {1: lambda text: text.decode(), 3: int}[kind](value)
    return found


def spans_in(body):
    for of_resource in all_of(body, 1):
        resource = attributes(one_of(of_resource, 1), 1)
        for scope in all_of(of_resource, 2):
            for span in all_of(scope, 2):
                status = one_of(span, 15, b"")
                yield {"trace": one_of(span, 1).hex(), "id": one_of(span, 2).hex(), "parent": one_of(span, 4, b"").hex(),
                       "name": one_of(span, 5).decode(), "kind": one_of(span, 6), "begin": one_of(span, 7),
                       "end": one_of(span, 8), "attributes": attributes(span, 9), "error": one_of(status, 3, 0) == 2,
                       "message": one_of(status, 2, b"").decode(), "resource": resource}


class Collector:
    """Takes what a server sends to /v1/traces. It answers `refusals` requests with 503 first."""

    def __init__(self, refusals=0, port=0):
        self.spans, self.headers, self.refused, self.refusals = [], [], 0, refusals
        collector = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self):
                body = self.rfile.read(int(self.headers["Content-Length"]))
                if collector.refused < collector.refusals:
                    collector.refused += 1
                    self.send_response(503)
                    self.send_header("Retry-After", "1")
                else:
                    collector.headers.append((self.path, dict(self.headers)))
                    collector.spans += spans_in(body)
                    self.send_response(200)
                self.send_header("Content-Length", "0")
                self.end_headers()

            def log_message(self, *_):
                pass

        self.server = ThreadingHTTPServer(("127.0.0.1", port), Handler)
        self.thread = threading.Thread(target=self.server.serve_forever)
        self.thread.start()

    @property
    def address(self):
        return f"http://127.0.0.1:{self.server.server_port}"

    def stop(self):
        self.server.shutdown()
        self.server.server_close()
        self.thread.join()


def submit(server, mesh, *flags, parent=f"00-{TRACE}-{PARENT}-01"):
    environment = {**os.environ, "TRACEPARENT": parent}
    done = run("submit", mesh, "--server", server.address, *flags, env=environment)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def wait_for(collector, name, job, seconds=30):
    """Waits for a span of a job, and returns all spans that are there by then, by name."""
    deadline = time.monotonic() + seconds
    while not any(span["name"] == name and span["attributes"].get("varimesh.job") == job for span in collector.spans):
        assert time.monotonic() < deadline, [span["name"] for span in collector.spans]
        time.sleep(0.05)
    return {span["name"]: span for span in collector.spans}


class WithCollector:
    def check(self, spans, job):
        """The spans of a job that has succeeded, below a call with a traceparent."""
        self.assertLessEqual({"submit", "wait", "run", "fetch", "read", "store"}, set(spans))
        self.assertTrue(PHASES & set(spans), spans.keys())
        self.assertEqual({span["trace"] for span in spans.values()}, {TRACE})
        self.assertEqual(len({span["id"] for span in spans.values()}), len(spans))
        self.assertEqual(spans["submit"]["parent"], PARENT)
        self.assertEqual(spans["submit"]["kind"], 2)
        for name in ("wait", "run"):
            self.assertEqual(spans[name]["parent"], spans["submit"]["id"])
            self.assertEqual(spans[name]["attributes"]["varimesh.job"], job)
        stages = [span for name, span in spans.items() if name in PHASES | {"fetch", "read", "store"}]
        for span in stages:
            self.assertEqual(span["parent"], spans["run"]["id"])
            self.assertEqual(span["kind"], 1)
        stages.sort(key=lambda span: span["begin"])
        self.assertEqual([stages[0]["name"], stages[1]["name"], stages[-1]["name"]], ["fetch", "read", "store"])
        for before, after in zip(stages, stages[1:]):
            self.assertEqual(before["end"], after["begin"], "one stage after the other")
        self.assertLessEqual(spans["run"]["begin"], stages[0]["begin"])
        self.assertLessEqual(stages[-1]["end"], spans["run"]["end"])
        self.assertLessEqual(spans["wait"]["end"], spans["run"]["end"])
        self.assertEqual(spans["run"]["attributes"]["varimesh.state"], "JOB_STATE_SUCCEEDED")
        self.assertEqual(spans["run"]["attributes"]["varimesh.attempt"], 1)
        self.assertGreater(spans["run"]["attributes"]["varimesh.iterations"], 0)
        self.assertFalse(any(span["error"] for span in spans.values()))


class OneServer(WithCollector, unittest.TestCase):
    def serve(self, collector, *flags):
        self.addCleanup(collector.stop)
        server = Server("--traces", collector.address, *flags)
        self.addCleanup(lambda: server.process.poll() is None and server.stop())
        return server

    def test_a_job_has_spans_below_the_call(self):
        os.environ["OTEL_EXPORTER_OTLP_HEADERS"] = "x-key=secret,x-other=2"
        self.addCleanup(os.environ.pop, "OTEL_EXPORTER_OTLP_HEADERS")
        collector = Collector()
        server = self.serve(collector, "--log-format", "json")
        job = submit(server, LARGER)
        self.check(wait_for(collector, "run", job), job)
        for path, headers in collector.headers:
            self.assertEqual((path, headers["Content-Type"]), ("/v1/traces", "application/x-protobuf"))
            self.assertEqual((headers["x-key"], headers["x-other"]), ("secret", "2"))
        resource = collector.spans[0]["resource"]
        self.assertEqual((resource["service.name"], resource["varimesh.role"]), ("varimeshd", "all"))
        self.assertTrue(resource["service.version"])
        server.stop()
        log = "".join(server.log)
        self.assertNotIn("secret", log)
        self.assertRegex(log, rf'"trace_id": ?"{TRACE}"')

    def test_a_key_comes_from_a_file_that_nobody_else_can_read(self):
        collector = Collector()
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "headers"
            file.write_text("x-key=secret\nx-other=2\n")
            file.chmod(0o644)
            refused = subprocess.run([VARIMESHD, "--traces", collector.address, "--traces-headers", file], capture_output=True,
                                     text=True, timeout=20)
            self.assertEqual(refused.returncode, 2)
            self.assertIn("every user of this machine can read it", refused.stderr)
            file.chmod(0o600)
            server = self.serve(collector, "--traces-headers", file)
            job = submit(server, MESH)
            self.check(wait_for(collector, "run", job), job)
        for _, headers in collector.headers:
            self.assertEqual((headers["x-key"], headers["x-other"]), ("secret", "2"))
        self.assertNotIn("secret", Path(f"/proc/{server.process.pid}/cmdline").read_text())

    def test_a_call_without_a_trace_begins_one(self):
        collector = Collector()
        server = self.serve(collector)
        first, second = submit(server, MESH, parent=""), submit(server, MESH, "--order", "3", parent="not a traceparent")
        for job in (first, second):
            wait_for(collector, "run", job)
        roots = [span for span in collector.spans if span["name"] == "submit"]
        self.assertEqual([span["parent"] for span in roots], ["", ""])
        self.assertEqual(len({span["trace"] for span in roots}), 2)
        for span in collector.spans:
            self.assertIn(span["trace"], {root["trace"] for root in roots})

    def test_a_trace_that_is_not_sampled_is_not_sent(self):
        collector = Collector()
        server = self.serve(collector)
        submit(server, MESH, parent=f"00-{TRACE}-{PARENT}-00")
        wait_for(collector, "run", submit(server, MESH, "--order", "3", parent=""))
        self.assertNotIn(TRACE, {span["trace"] for span in collector.spans})

    def test_nothing_is_lost_while_the_collector_is_away(self):
        collector = Collector(refusals=2)
        server = self.serve(collector)
        job = submit(server, MESH)
        self.check(wait_for(collector, "run", job), job)
        self.assertEqual(collector.refused, 2)
        ids = [span["id"] for span in collector.spans]
        self.assertEqual(len(ids), len(set(ids)), "each span is sent once")
        server.stop()
        log = "".join(server.log)
        self.assertIn("the collector of traces cannot be reached (HTTP status 503)", log)
        self.assertIn("the collector of traces is back", log)

    def test_jobs_do_not_need_the_collector(self):
        collector = Collector()
        address = collector.address
        collector.stop()
        server = Server("--traces", address)
        self.addCleanup(lambda: server.process.poll() is None and server.stop())
        with tempfile.TemporaryDirectory() as folder:
            done = run("optimise", MESH, "--output", Path(folder) / "out.msh", "--server", server.address)
        self.assertEqual(done.returncode, 0, done.stderr)
        begun = time.monotonic()
        status, _ = server.stop()
        self.assertEqual(status, 0)
        self.assertLess(time.monotonic() - begun, 10, "the end does not wait for it")

    def test_what_is_left_is_sent_at_the_end(self):
        collector = Collector()
        server = self.serve(collector)
        job = submit(server, MESH)
        deadline = time.monotonic() + 20
        while "succeeded" not in run("jobs", "--server", server.address).stdout.lower():
            self.assertLess(time.monotonic(), deadline)
        server.stop()
        self.check(wait_for(collector, "run", job, 5), job)

    def test_an_address_that_is_none_is_refused(self):
        for address in ("collector:4318", "ftp://collector", "http://user@collector"):
            with self.assertRaises(AssertionError):
                Server("--traces", address)


class Farm(WithCollector, farm.WithFarm):
    def test_a_trace_goes_from_the_front_end_to_the_worker(self):
        collector = Collector()
        self.addCleanup(collector.stop)
        front = self.front_end("--traces", collector.address)
        job = submit(front, LARGER)
        self.worker("--traces", collector.address)
        spans = wait_for(collector, "run", job)
        self.check(spans, job)
        self.assertEqual({name: span["resource"]["varimesh.role"] for name, span in spans.items() if name in
                          ("submit", "run")}, {"submit": "frontend", "run": "worker"})


if __name__ == "__main__":
    if sys.argv[1:2] == ["Farm"]:
        farm.skip_without(farm.DATABASE_SERVER)
    unittest.main(verbosity=2, argv=[sys.argv[0], {"Server": "OneServer"}.get(sys.argv[1], sys.argv[1])])
