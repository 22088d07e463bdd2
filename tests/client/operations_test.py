"""What an operator has of a server: metrics, probes, a log for programs, settings from a file and the environment, and the
service of systemd. ctest runs it with the name of a group."""
import hashlib
import http.client
import importlib.util
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import time
import unittest

from programs import ENDLESS, LARGER, MESH, VARIMESHD, Server, WithFolder, run

TRACE = "4bf92f3577b34da6a3ce929d0e0e4736"
UNIT = os.environ["VARIMESH_SOURCE_DIR"] + "/deploy/varimeshd.service"


def environment(**variables):
    kept = {key: value for key, value in os.environ.items() if not key.startswith("VARIMESH") or key == "VARIMESH_SOURCE_DIR"}
    return {**kept, **variables}


def varimeshd(*words, **variables):
    return subprocess.run([VARIMESHD, *map(str, words)], capture_output=True, text=True, timeout=20,
                          env=environment(**variables))


def wait_until(holds, seconds=20):
    deadline = time.monotonic() + seconds
    while not (value := holds()):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    return value


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


class Logs(WithFolder):
    def setUp(self):
        super().setUp()
        file = self.folder / "tokens"

        def make(name, *roles):
            flags = [word for role in roles for word in ("--role", role)]
            return varimeshd("token", name, "--tokens", file, *flags).stdout.strip()

        self.ann, self.reader = make("ann"), make("bob", "read")
        self.server = Server("--tokens", str(file), "--log-format", "json", "--threads", "1")
        self.stopped = False
        self.addCleanup(lambda: self.stopped or self.server.stop())

    def call(self, token, *arguments):
        return run(*arguments, "--server", self.server.address, env=environment(VARIMESH_TOKEN=token))

    def lines(self):
        self.stopped = True
        self.server.stop()
        return [json.loads(line) for line in self.server.log]

    def test_every_line_is_an_object_and_says_what_it_is_about(self):
        job = self.call(self.ann, "submit", MESH).stdout.strip()
        self.assertEqual(self.call(self.ann, "watch", job).returncode, 0)
        lines = self.lines()
        for line in lines:
            self.assertRegex(line["time"], r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z$")
            self.assertIn(line["level"], ("info", "warning"))
            self.assertNotIn(self.ann, json.dumps(line))
        about = [line for line in lines if line.get("job") == job and "audit" not in line]
        self.assertEqual([line["message"].removeprefix(job + " ") for line in about],
                         ["submitted", "started, attempt 1", "JOB_STATE_SUCCEEDED"])
        self.assertEqual([line["owner"] for line in about], ["ann"] * 3)
        self.assertEqual([line.get("attempt") for line in about], [None, 1, 1])

    def test_what_people_do_is_written_down(self):
        job = self.call(self.ann, "submit", LARGER, *ENDLESS).stdout.strip()
        self.assertNotEqual(self.call(self.reader, "cancel", job).returncode, 0)
        self.assertNotEqual(self.call("vm_wrong", "jobs").returncode, 0)
        self.assertNotEqual(self.call(self.ann, "submit", MESH, "--priority", "101").returncode, 0)
        self.assertEqual(self.call(self.ann, "cancel", job).returncode, 0)
        self.call(self.ann, "watch", job)
        self.assertEqual(self.call(self.ann, "delete", job).returncode, 0)
        audit = [line for line in self.lines() if "audit" in line]
        done = [(line["audit"], line["outcome"], line.get("owner"), line.get("job")) for line in audit]
        for expected in (("submit", "ok", "ann", job), ("refused", "RIGHT_MISSING", "bob", None),
                         ("refused", "TOKEN_UNKNOWN", None, None), ("cancel", "ok", "ann", job),
                         ("delete", "ok", "ann", job)):
            self.assertIn(expected, done)
        self.assertEqual({line["address"] for line in audit}, {"127.0.0.1"})
        refused = next(line for line in audit if line["outcome"] == "RIGHT_MISSING")
        self.assertIn("CancelJob", refused["message"])

    @unittest.skipUnless(importlib.util.find_spec("grpc"), "python3-grpcio is missing (deploy/setup test)")
    def test_jobs_keep_the_trace_of_their_call(self):
        import grpc

        self.call(self.ann, "submit", MESH)  # uploads the mesh
        digest = hashlib.sha256(MESH.read_bytes()).hexdigest()
        mesh = b"\x0a" + bytes([len(digest)]) + digest.encode() + b"\x10\x01"  # a MeshRef: digest, MSH 2.2
        spec = b"\x0a" + bytes([len(mesh)]) + mesh
        request = b"\x12" + bytes([len(spec)]) + spec
        with grpc.insecure_channel(self.server.address) as channel:
            call = channel.unary_unary("/varimesh.v1.JobService/SubmitJob")
            for parent in (f"00-{TRACE}-00f067aa0ba902b7-01", "00-not-a-trace-01"):
                call(request, timeout=20, metadata=(("authorization", "Bearer " + self.ann), ("traceparent", parent)))
        wait_until(lambda: sum("SUCCEEDED" in line for line in self.server.log) == 3)
        traces = [line.get("trace_id") for line in self.lines() if "SUCCEEDED" in line["message"]]
        self.assertEqual((traces.count(TRACE), traces.count(None)), (1, 2))


class Settings(WithFolder):
    def setUp(self):
        super().setUp()
        self.file = self.folder / "varimeshd.conf"

    def settings(self, *words, **variables):
        done = varimeshd(*words, "--print-config", **variables)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    def test_one_key_has_one_name_everywhere(self):
        self.assertIn("\n# max-priority = 100\n", self.settings())
        self.assertIn("\nmax-priority = 7  # from the command line\n", self.settings("--max-priority", "7"))
        self.assertIn("\nmax-priority = 8  # from the environment\n", self.settings(VARIMESHD_MAX_PRIORITY="8"))
        self.file.write_text("# a comment\n\n  max-priority =9 # another\ninsecure = true\n"
                             f"state = \"{self.folder}/with spaces # and more\"\n")
        said = self.settings("--config", self.file)
        self.assertIn(f"\nmax-priority = 9  # from '{self.file}'\n", said)
        self.assertIn("\ninsecure = true  # from ", said)
        self.assertIn(f"\nstate = \"{self.folder}/with spaces # and more\"  # from ", said)
        self.assertEqual(said, self.settings(VARIMESHD_CONFIG=str(self.file)))

    def test_the_command_line_goes_before_the_environment_and_that_before_the_file(self):
        self.file.write_text("max-priority = 1\nthreads = 2\nmax-watches-per-peer = 3\n")
        said = self.settings("--config", self.file, "--max-priority", "4", VARIMESHD_MAX_PRIORITY="5", VARIMESHD_THREADS="6",
                             VARIMESH_STATE="/old/name")
        for line in ("max-priority = 4  # from the command line", "threads = 6  # from the environment",
                     "max-watches-per-peer = 3  # from '", "state = /old/name  # from the environment"):
            self.assertIn("\n" + line, said)
        said = self.settings(VARIMESH_STATE="/old/name", VARIMESHD_STATE="/new/name")
        self.assertIn("\nstate = /new/name  # from the environment", said)

    def test_what_is_printed_is_a_file_with_the_same_settings(self):
        said = self.settings("--max-priority", "7", "--insecure", "--log-level", "warn", "--state", self.folder / "a b",
                             "--port-file", "both \" and '")
        self.assertIn("\nport-file = 'both \" and '''  # from", said)
        self.file.write_text(said)
        again = self.settings("--config", self.file)
        strip = lambda text: [line.split("  # from")[0] for line in text.splitlines()]
        self.assertEqual(strip(again), strip(said))

    def test_unknown_keys_and_wrong_values_are_refused(self):
        for text, words in (("max-prioritie = 1", ("Line 1 of ", "did you mean 'max-priority'?")),
                            ("threads = 1\nqqqq = 2", ("Line 2 of ", "no setting")),
                            ("max-priority = 1000", ("In the configuration file", "--max-priority")),
                            ("max-priority", ("Line 1 of ", "key = value")), ("max-priority =", ("key = value",)),
                            ("[server]", ("key = value",)), ("state = \"/a", ("key = value",)),
                            ("state = \"/a\" b", ("key = value",)), ("help = true", ("no setting",)),
                            ("config = x", ("no setting",)), ("--threads = 1", ("no setting",))):
            self.file.write_text(text)
            done = varimeshd("--config", self.file, "--print-config")
            self.assertEqual((done.returncode, done.stdout), (2, ""), text)
            for word in words:
                self.assertIn(word, done.stderr, text)
        done = varimeshd("--print-config", VARIMESHD_MAX_PRIORITIE="1")
        self.assertEqual(done.returncode, 2)
        self.assertIn("did you mean 'VARIMESHD_MAX_PRIORITY'?", done.stderr)
        of_kubernetes = {"VARIMESHD_SERVICE_HOST": "10.0.0.7", "VARIMESHD_PORT_50051_TCP": "tcp://10.0.0.7:50051"}
        self.assertEqual(varimeshd("--print-config", **of_kubernetes).returncode, 2)
        self.assertEqual(varimeshd("--print-config", KUBERNETES_SERVICE_HOST="10.0.0.1", **of_kubernetes).returncode, 0)
        done = varimeshd("--print-config", VARIMESHD_THREADS="many")
        self.assertEqual(done.returncode, 2)
        self.assertIn("In the environment", done.stderr)
        done = varimeshd("--print-config", VARIMESHD_PORT_FILE="two\nlines")
        self.assertEqual(done.returncode, 2)
        self.assertIn("'--port-file' has a line break", done.stderr)
        done = varimeshd("--config", self.folder / "none")
        self.assertEqual(done.returncode, 2)
        self.assertIn("cannot be read", done.stderr)
        self.assertEqual(varimeshd("--config", self.folder).returncode, 2)

    def test_a_server_starts_with_them(self):
        self.file.write_text(f"state = {self.folder}/state\nlog-format = json\nmax-job-iterations = 7\n")
        server = Server("--config", str(self.file))
        self.addCleanup(server.stop)
        self.assertTrue((self.folder / "state").is_dir())
        refused = run("submit", MESH, "--max-iterations", "8", "--server", server.address)
        self.assertIn("7", refused.stderr)
        self.assertNotEqual(refused.returncode, 0)


class Service(WithFolder):
    def test_systemd_is_told_how_the_server_is(self):
        path = self.folder / "notify"
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
            manager.bind(str(path))
            manager.settimeout(30)
            process = subprocess.Popen([VARIMESHD, "--listen", f"unix:{self.folder}/socket", "--log-level", "off"],
                                       stdout=subprocess.DEVNULL, env=environment(NOTIFY_SOCKET=str(path)))
            try:
                said = manager.recv(1000).decode()
                while said == "WATCHDOG=1":
                    said = manager.recv(1000).decode()
                self.assertEqual(said, f"READY=1\nSTATUS=Listens on unix:{self.folder}/socket\n")
                self.assertEqual(run("info", "--server", f"unix:{self.folder}/socket").returncode, 0)
                self.assertEqual(manager.recv(1000).decode(), "WATCHDOG=1", "every five seconds")
                process.send_signal(signal.SIGTERM)
                while (said := manager.recv(1000).decode()) == "WATCHDOG=1":
                    continue
                self.assertEqual(said, "STOPPING=1")
            finally:
                process.terminate()
                self.assertEqual(process.wait(40), 0)

    def test_the_unit_is_right_and_hardened(self):
        if shutil.which("systemd-analyze") is None:
            self.skipTest("systemd-analyze is missing (Debian package systemd)")
        with open(UNIT) as file:
            text = file.read()
        self.assertIn("\nExecStart=/usr/bin/varimeshd\n", text)
        here = self.folder / "varimeshd.service"
        here.write_text(text.replace("ExecStart=/usr/bin/varimeshd\n", f"ExecStart={VARIMESHD}\n"))
        checked = subprocess.run(["systemd-analyze", "verify", here], capture_output=True, text=True, timeout=60)
        self.assertEqual((checked.returncode, checked.stderr), (0, ""))
        rated = subprocess.run(["systemd-analyze", "security", "--offline=true", here], capture_output=True, text=True,
                               timeout=60)
        level = re.search(r"Overall exposure level for varimeshd.service: ([\d.]+)", rated.stdout)
        self.assertLess(float(level[1]), 2.0)
        # What it sets must be settings.
        variables = dict(word.split("=", 1) for line in re.findall(r"^Environment=(.*)$", text, re.MULTILINE)
                         for word in line.split())
        self.assertIn("VARIMESHD_STATE", variables)
        done = varimeshd("--print-config", **variables)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stdout.count("# from the environment"), len(variables))


if __name__ == "__main__":
    unittest.main(verbosity=2)
