"""The metrics of a server, its probes, and the health check of containers."""
import http.client
import os
import re
import signal
import socket
import time
import unittest

from operators import varimeshd, wait_until
from programs import ENDLESS, LARGER, MESH, Server, WithFolder, run


class Metrics(WithFolder):
    def setUp(self):
        super().setUp()
        self.server = Server("--threads", "1", "--metrics", "127.0.0.1:0", "--max-mesh-bytes", "10000000")
        self.addCleanup(self.server.stop)
        self.place = wait_until(lambda: re.search(r"http://(\S+)/metrics", "".join(self.server.log)))[1]

    def ask(self, path, method="GET", **headers):
        connection = http.client.HTTPConnection(self.place, timeout=20)
        self.addCleanup(connection.close)
        connection.request(method, path, headers=headers)
        answer = connection.getresponse()
        return answer.status, answer.headers, answer.read().decode()

    def metrics(self):
        status, headers, text = self.ask("/metrics")
        if status == 404:
            self.assertIn("without prometheus-cpp", text)
            self.skipTest("this build has no metrics (Debian package prometheus-cpp-dev)")
        self.assertEqual(status, 200)
        self.assertTrue(headers["Content-Type"].startswith("text/plain; version=0.0.4"))
        values = {}
        for line in text.splitlines():
            if not line.startswith("#"):
                name, value = line.rsplit(" ", 1)
                values[name] = float(value)
        return values

    def test_probes_answer_whoever_asks_and_nothing_else_does(self):
        self.assertEqual(self.ask("/healthz/live")[::2], (200, "live\n"))
        self.assertEqual(self.ask("/healthz/ready", Host="varimesh.example:9464")[::2], (200, "ready\n"))
        for path in ("/", "/api/status", "/watch.js", "/etc/passwd", "/../etc/passwd"):
            self.assertEqual(self.ask(path)[0], 404, path)
        for method in ("POST", "PUT", "DELETE", "OPTIONS"):
            self.assertEqual(self.ask("/metrics", method)[0], 405)

    def test_health_asks_for_containers(self):
        for words, variables in ((["--metrics", self.place], {}), ([], {"VARIMESHD_METRICS": self.place})):
            done = varimeshd("health", *words, **variables)
            self.assertEqual((done.returncode, done.stdout), (0, "ready\n"), done.stderr)
        with socket.create_server(("127.0.0.1", 0)) as silent:
            silent.settimeout(0.1)
            free = f"127.0.0.1:{silent.getsockname()[1]}"
        done = varimeshd("health", "--metrics", free)
        self.assertEqual(done.returncode, 1)
        self.assertIn(f"No server answers at {free}", done.stderr)
        self.assertEqual(varimeshd("health", "--metrics", "here").returncode, 2)
        self.assertEqual(varimeshd("health").returncode, 2)
        os.kill(self.server.process.pid, signal.SIGSTOP)
        try:
            self.assertEqual(varimeshd("health", "--metrics", self.place).returncode, 1, "it waits five seconds")
        finally:
            os.kill(self.server.process.pid, signal.SIGCONT)

    def test_metrics_count_jobs_and_calls(self):
        before = self.metrics()
        self.assertEqual(before["varimesh_ready"], 1)
        self.assertEqual(before["varimesh_queue_oldest_age_seconds"], 0)
        self.assertGreater(before["process_resident_memory_bytes"], 1e6)
        self.assertGreater(before["process_open_fds"], 3)
        self.assertGreaterEqual(before["process_max_fds"], before["process_open_fds"])
        at = ("--server", self.server.address)
        self.assertEqual(run("optimise", MESH, "-o", self.folder / "out.msh", *at).returncode, 0)
        running = run("submit", LARGER, *ENDLESS, *at).stdout.strip()
        waiting = run("submit", MESH, *at).stdout.strip()
        run("cancel", "jobs/none", *at)
        time.sleep(1.2)  # metrics are measured once a second
        now = self.metrics()
        self.assertEqual(now['varimesh_jobs{state="running"}'], 1)
        self.assertEqual(now['varimesh_jobs{state="pending"}'], 1)
        self.assertGreaterEqual(now["varimesh_queue_oldest_age_seconds"], 1)
        self.assertEqual(now["varimesh_jobs_submitted_total"], 3)
        self.assertEqual(now['varimesh_job_run_seconds_count{outcome="succeeded"}'], 1)
        self.assertEqual(now["varimesh_jobs_lost_total"], 0)
        self.assertEqual(now["varimesh_job_wait_seconds_count"], 1)
        self.assertLess(now["varimesh_job_wait_seconds_sum"], 20)
        self.assertEqual(before["varimesh_worker_cpu_seconds_total"], 0)
        self.assertTrue(0 < now["varimesh_worker_cpu_seconds_total"] < 20)
        handled = 'grpc_server_handling_seconds_%s{grpc_method="CancelJob",grpc_service="varimesh.v1.JobService"}'
        self.assertEqual(now[handled % "count"], 1)
        self.assertTrue(0 < now[handled % "sum"] < 20)
        # The processes of the jobs have told what their kernels did.
        self.assertEqual(before["varimesh_kernel_operations_total"], 0)
        self.assertGreater(now["varimesh_kernel_operations_total"], 1e5)
        rate = now["varimesh_kernel_operations_total"] / now["varimesh_kernel_seconds_total"]
        self.assertTrue(1e6 < rate < 1e12, rate)
        sent = MESH.stat().st_size + LARGER.stat().st_size
        taken = now['varimesh_mesh_bytes_total{direction="in"}']
        self.assertTrue(sent / 20 < taken < sent + 1000, f"{taken}: clients may compress, and messages name their mesh")
        self.assertGreater(now['varimesh_mesh_bytes_total{direction="out"}'], 0)
        self.assertGreaterEqual(now["varimesh_store_bytes"], sent)

        def calls(method, code):
            return now.get(f'grpc_server_handled_total{{grpc_code="{code}",grpc_method="{method}",'
                           f'grpc_service="varimesh.v1.JobService"}}', 0)

        self.assertEqual(calls("CancelJob", "NOT_FOUND"), 1)
        self.assertGreaterEqual(calls("SubmitJob", "OK"), 2)
        names = "\n".join(now)
        for secret in (running, waiting, "circle", str(self.folder)):
            self.assertNotIn(secret, names)
        run("cancel", running, *at)
        run("cancel", waiting, *at)


if __name__ == "__main__":
    unittest.main(verbosity=2)
