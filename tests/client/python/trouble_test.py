"""Connections that break, servers that go away, programs that are interrupted."""
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import unittest
from concurrent import futures

import support
from support import LARGER, MESH, Cutter, Server

support.need()
import grpc
import varimesh


def mebibytes(count):
    """Bytes that cannot be compressed and that no store has yet."""
    return os.urandom(count << 20)


class Broken(support.WithServer):
    def through(self, *allowances):
        proxy = Cutter(self.server.address, allowances)
        self.addCleanup(proxy.close)
        client = varimesh.Client(proxy.address, retry=20)
        self.addCleanup(client.close)
        client.info()  # the client's control channel takes the first connection
        proxy.allowances = list(allowances)
        return proxy, client

    def test_an_upload_and_a_download_resume_after_a_break(self):
        path = self.folder / "bytes"
        path.write_bytes(mebibytes(16))
        proxy, client = self.through(3 << 20, 3 << 20, 6 << 20)
        digest = client.upload(path)
        self.assertEqual(proxy.cuts, 3)
        self.assertLess(proxy.passed, (16 << 20) + 4 * (256 << 10))  # one chunk per cut is sent again
        proxy.allowances, proxy.passed = [3 << 20, 6 << 20], 0
        self.assertEqual(client.download(digest), path.read_bytes())
        self.assertEqual(proxy.cuts, 5)
        self.assertLess(proxy.passed, 22 << 20)
        proxy.passed = 0
        self.assertEqual(client.upload(path), digest)  # the server has it
        self.assertLess(proxy.passed, 1 << 16)

    def test_a_watch_resumes_after_the_last_event(self):
        proxy, client = self.through(20_000, 20_000)
        job = client.submit(LARGER, method="sweeps", tolerance=1e-15, max_iterations=400)
        numbers = sequence_numbers(client.job(job.name).watch())
        self.assertGreaterEqual(proxy.cuts, 1)
        self.assertEqual(numbers, sorted(set(numbers)))
        self.assertEqual(job.refresh().state, "succeeded")


def sequence_numbers(events):
    """The numbers of the events that the server keeps: bookmarks have the number of the event before them."""
    return [event.sequence for event in events
            if any((event.state, event.iteration, event.quality, event.log))]


class Away(support.WithFolder):
    def test_a_missing_server_gives_a_sentence(self):
        client = varimesh.Client("127.0.0.1:1", connect=0.3)
        with self.assertRaises(varimesh.ServerUnreachable) as caught:
            client.info()
        self.assertIn("start varimeshd", str(caught.exception))

    def test_where_nobody_listens_that_is_said_at_once(self):
        with socket.create_server(("127.0.0.1", 0)) as taken:  # and closed, so that nobody listens there
            port = taken.getsockname()[1]
        for address in (f"127.0.0.1:{port}", f"unix:{self.folder}/none"):
            begin = time.monotonic()
            with self.assertRaisesRegex(varimesh.ServerUnreachable, f"There is no server at {address}; start varimeshd"):
                varimesh.Client(address).info()
            self.assertLess(time.monotonic() - begin, 4)

    def test_a_watch_continues_when_the_server_comes_back(self):
        server = Server("--state", str(self.folder / "state"), folder=self.folder)
        client = varimesh.Client(server.address)
        job = client.submit(LARGER, method="sweeps", tolerance=1e-15, max_iterations=300)
        numbers, attempts = [], set()
        for event in job.watch():
            kept = sequence_numbers([event])
            numbers += kept
            attempts.add(event.attempt)
            if kept and len(numbers) == 10:
                server.stop(signal.SIGKILL)
                server.start()
        self.assertEqual(numbers, sorted(set(numbers)))
        self.assertEqual((job.state, max(attempts)), ("succeeded", 2))
        self.assertEqual(job.result().metrics.iterations, 300)
        client.close()
        self.assertEqual(server.stop(), 0)

    def test_the_token_is_sent_with_every_call(self):
        seen = []

        class Handler(grpc.GenericRpcHandler):
            def service(self, details):
                seen.append((details.method.rsplit("/")[-1], dict(details.invocation_metadata).get("authorization")))

        server = grpc.server(futures.ThreadPoolExecutor(2), handlers=(Handler(),))
        port = server.add_insecure_port("127.0.0.1:0")
        server.start()
        client = varimesh.Client(f"127.0.0.1:{port}", token="secret")
        for call in (client.info, lambda: client.upload(MESH), lambda: client.download("0" * 64),
                     lambda: list(client._watch("jobs/x", 0))):
            with self.assertRaises(varimesh.VarimeshError):
                call()
        server.stop(0)
        self.assertEqual({token for _, token in seen}, {"Bearer secret"})
        self.assertEqual([one for one in seen if one[0] != "Check"], [(name, "Bearer secret")
                                for name in ("GetServerInfo", "SendMesh", "DownloadMesh", "WatchJob")])


PROGRAM = """
import sys, varimesh
from varimesh import local
client = varimesh.local()
with open(f"/proc/{client._stop.peek()[2][0].pid}/task/{client._stop.peek()[2][0].pid}/children") as file:
    print(client.address, *file.read().split(), flush=True)
client.optimise(sys.argv[1], method="sweeps", tolerance=1e-15, max_iterations=100_000,
                on_event=lambda event: event.iteration and print("iteration", flush=True))
"""


def alive(pid):
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rsplit(")")[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


class Interrupted(support.WithServer):
    def program(self):
        process = subprocess.Popen([sys.executable, "-c", PROGRAM, str(LARGER)], stdout=subprocess.PIPE, text=True,
                                   stderr=subprocess.PIPE)
        address, *pids = process.stdout.readline().split()
        self.assertTrue(pids and all(map(alive, pids)))
        self.assertEqual(process.stdout.readline(), "iteration\n")
        return process, address, pids

    def end(self, process, pids):
        process.communicate(timeout=60)
        deadline = time.monotonic() + 20
        while any(map(alive, pids)) and time.monotonic() < deadline:
            time.sleep(0.02)
        self.assertFalse([pid for pid in pids if alive(pid)])

    def test_a_private_server_ends_with_a_program_that_is_killed(self):
        process, _, pids = self.program()
        process.kill()
        self.end(process, pids)

    def test_a_private_server_ends_on_ctrl_c_and_leaves_no_files(self):
        process, address, pids = self.program()
        process.send_signal(signal.SIGINT)
        self.end(process, pids)
        self.assertFalse(os.path.exists(os.path.dirname(address.removeprefix("unix:"))))

    def test_ctrl_c_cancels_the_job(self):
        def interrupt(event):
            if event.iteration is not None:
                threading.Thread(target=os.kill, args=(os.getpid(), signal.SIGINT)).start()
                time.sleep(10)

        with self.assertRaises(KeyboardInterrupt):
            self.client.optimise(LARGER, **support.ENDLESS, labels={"for": "interrupt"}, on_event=interrupt)
        (job,) = self.client.jobs(labels={"for": "interrupt"})
        self.assertEqual(job.wait().state, "cancelled")

    def test_ctrl_c_takes_a_job_of_quality_back(self):
        busy = [self.client.submit(LARGER, **support.ENDLESS) for _ in range(os.cpu_count() + 1)]
        self.addCleanup(lambda: [one.cancel() for one in busy])
        while self.client.job(busy[0].name).state == "pending":
            time.sleep(0.01)
        jobs = {job.name for job in self.client.jobs()}
        timer = threading.Timer(1, os.kill, (os.getpid(), signal.SIGINT))
        timer.start()
        self.addCleanup(timer.cancel)
        with self.assertRaises(KeyboardInterrupt):
            self.client.quality(MESH)
        self.assertEqual({job.name for job in self.client.jobs()}, jobs)

    def test_a_server_that_cannot_start_says_why(self):
        with self.assertRaises(varimesh.ServerUnreachable) as caught:
            varimesh.local(state=MESH)
        self.assertRegex(str(caught.exception), "did not start: .{20,}")
        os.environ["VARIMESHD"], kept = "", os.environ["VARIMESHD"]
        path, os.environ["PATH"] = os.environ["PATH"], "/nowhere"
        try:
            with self.assertRaisesRegex(varimesh.ServerUnreachable, "install varimesh-server"):
                varimesh.local()
        finally:
            os.environ["VARIMESHD"], os.environ["PATH"] = kept, path


if __name__ == "__main__":
    unittest.main(verbosity=2)
