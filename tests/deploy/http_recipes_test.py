"""Runs the recipes of deploy/workflows/http with a real server: the requests that they make are made as they stand. Airflow,
Nextflow and GitHub's runner are played by this test: it reads the files as they do, and does what these steps say."""
import http.server
import json
import os
import re
import shutil
import subprocess
import sys
import threading
import types
import unittest
import urllib.parse
import urllib.request
from pathlib import Path

import support
from support import MESH, SOURCE, VARIMESH, VARIMESHD

sys.path.insert(0, str(SOURCE / "tests" / "server" / "http"))
os.environ.setdefault("VARIMESH_SOURCE_DIR", str(SOURCE))
from over_http import WithHttp

RECIPES = SOURCE / "deploy" / "workflows" / "http"


class WithRecipes(WithHttp):
    def flags(self):
        tokens = self.folder / "tokens"
        self.token = subprocess.run([VARIMESHD, "token", "ann", "--tokens", tokens], capture_output=True, text=True, timeout=20).stdout.strip()
        return ("--tokens", str(tokens))

    def setUp(self):
        super().setUp()
        self.environment = {**os.environ, "HTTP": f"http://{self.http}", "VARIMESH_TOKEN": self.token}

    def jobs(self):
        return self.ask("GET", "/v1/jobs", headers={"Authorization": f"Bearer {self.token}"})[1].get("jobs", [])

    def check_result(self, file):
        self.assertIn(b"VTKFile", file.read_bytes()[:200])
        done = subprocess.run([VARIMESH, "quality", file, "--certify"], capture_output=True, text=True, timeout=50)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)


class Curl(WithRecipes):
    def shell(self, *arguments, **environment):
        return subprocess.run([RECIPES / "bin" / "optimise-http.sh", *map(str, arguments)], cwd=self.folder, env={**self.environment, **environment},
                              capture_output=True, text=True, timeout=100)

    def test_statuses(self):
        out = self.folder / "out.vtu"
        done = self.shell(MESH, out)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.check_result(out)
        self.assertIn(f"http://{self.http}/#/jobs/", done.stderr)
        self.assertEqual(self.shell(MESH, out).returncode, 0)
        self.assertEqual(len(self.jobs()), 1, "the same mesh with the same spec is the same job")
        spec = self.folder / "spec.json"
        spec.write_text('{"outputs": ["MESH_FORMAT_MSH22"], "options": {"maxIterations": 0}}')
        self.assertEqual(self.shell(MESH, self.folder / "out.msh", spec).returncode, 4)
        spec.write_text('{"options": {"maxIterationen": 0}}')
        done = self.shell(MESH, out, spec)
        self.assertEqual((done.returncode, "maxIterationen" in done.stderr), (3, True), done.stderr)
        bad = self.folder / "bad.msh"
        bad.write_text("solid cube\n")
        self.assertEqual(self.shell(bad, out).returncode, 3)
        self.assertEqual(self.shell(self.folder / "none", out).returncode, 3)
        self.assertEqual(self.shell(MESH, out, VARIMESH_TOKEN="of-somebody").returncode, 3)
        self.assertNotIn(self.token, done.stdout + done.stderr)

    def test_what_passes_is_worth_another_try(self):
        """A server that refuses for now; curl's own repetitions are left out here, since they take half a minute."""
        curl = self.folder / "bin" / "curl"
        curl.parent.mkdir()
        curl.write_text(f'#!/bin/sh\nexec {shutil.which("curl")} "$@" --retry 0\n')
        curl.chmod(0o755)
        answers = []

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_PUT(self):
                self.rfile.read(int(self.headers["Content-Length"]))
                code = answers[0]
                text = b'{"message": "The server says so."}'
                if code == 0:
                    return self.connection.shutdown(2)
                self.send_response(code)
                self.send_header("Content-Length", str(len(text) + (code == 200)))  # 200: the answer is cut
                self.end_headers()
                self.wfile.write(text)

            def log_message(self, *_):
                pass

        with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
            threading.Thread(target=server.serve_forever, daemon=True).start()
            self.addCleanup(server.shutdown)
            path = f"{curl.parent}{os.pathsep}{os.environ['PATH']}"
            for code, status in ((408, 5), (409, 5), (429, 5), (500, 5), (503, 5), (504, 5), (0, 5), (200, 5), (400, 3), (401, 3), (404, 3), (413, 3)):
                answers[:] = [code]
                done = self.shell(MESH, self.folder / "out.vtu", HTTP=f"http://127.0.0.1:{server.server_address[1]}", PATH=path)
                self.assertEqual(done.returncode, status, f"{code}: {done.stderr}")
                self.assertEqual("The server says so." in done.stderr, code != 0, f"{code}: {done.stderr}")
            server.shutdown()


class Actions(WithRecipes):
    def test_steps_run_as_they_stand(self):
        import yaml
        workflow = yaml.safe_load((RECIPES / "github-actions.yml").read_text())
        self.assertEqual(workflow[True]["push"]["paths"], ["meshes/**"])  # "on" is a boolean of YAML 1.1
        job, = workflow["jobs"].values()
        contexts = {"vars.VARIMESH_HTTP": f"http://{self.http}", "secrets.VARIMESH_TOKEN": self.token}
        fill = lambda text: re.sub(r"\$\{\{\s*(\S+?)\s*\}\}", lambda found: contexts[found[1]], text)
        environment = {**os.environ, **{name: fill(value) for name, value in job["env"].items()}}
        (self.folder / "meshes").mkdir()
        (self.folder / "tools").mkdir()
        shutil.copy(RECIPES / "bin" / "optimise-http.sh", self.folder / "tools")
        for name in ("a", "b"):
            shutil.copy(MESH, self.folder / "meshes" / f"{name}.msh")

        def run():
            codes = []
            for step in job["steps"]:
                self.assertEqual(len({"run", "uses"} & step.keys()), 1, step)
                if "run" in step:  # as GitHub runs it
                    done = subprocess.run(["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", fill(step["run"])], cwd=self.folder, env=environment,
                                          capture_output=True, text=True, timeout=100)
                    codes.append((done.returncode, done.stdout + done.stderr))
            return codes

        self.assertEqual([code for code, _ in run()], [0, 0])
        for name in ("a", "b"):
            self.check_result(self.folder / "results" / f"{name}.vtu")
        (self.folder / "meshes" / "c.msh").write_text("solid cube\n")
        (_, _), (code, text) = run()
        self.assertEqual(code, 3, text)
        self.assertIn("::error file=meshes/c.msh::", text)


class Nextflow(WithRecipes):
    def test_the_script_runs_as_it_stands(self):
        text = (RECIPES / "main.nf").read_text()
        text = re.sub(r"^//.*$|\s//\s.*$", "", text, flags=re.M)
        params = dict(re.findall(r"^params\.(\w+) = '([^']*)'$", text, re.M))
        self.assertEqual(set(params), {"http", "meshes", "results"})
        process = re.search(r"^process (\w+) \{\n(.*?)^\}", text, re.M | re.S)
        self.assertIn(f"{process[1]}(Channel.fromPath(params.meshes))", text)
        self.assertEqual(text.count("{") - text.count("}"), 0)
        script = re.search(r'script:\s*"""\n(.*?)"""', process[2], re.S)[1]
        output = re.search(r'output:\s*path "([^"]*)"', process[2])[1]
        params["http"] = f"http://{self.http}"
        values = {**{f"params.{name}": value for name, value in params.items()}, "mesh": "nine_triangles.msh", "mesh.baseName": "nine_triangles"}
        fill = lambda words: re.sub(r"\$\{([^}]*)\}", lambda found: values[found[1]], words)
        shutil.copy(MESH, self.folder)
        environment = {**self.environment, "PATH": f"{RECIPES / 'bin'}{os.pathsep}{os.environ['PATH']}"}  # Nextflow adds bin/
        done = subprocess.run(["bash", "-ue", "-c", fill(script)], cwd=self.folder, env=environment, capture_output=True, text=True, timeout=100)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.check_result(self.folder / fill(output))


class Airflow(WithRecipes):
    """The operators, the sensor and the hook of apache-airflow-providers-http, as its documentation describes them."""

    def request(self, method, endpoint, data, headers):
        address = f"http://{self.http}" + (endpoint if endpoint.startswith("/") else "/" + endpoint)
        if method == "GET" and data:
            address, data = address + "?" + urllib.parse.urlencode(data), None
        body = data.encode() if isinstance(data, str) else data
        request = urllib.request.Request(address, body, {"Authorization": f"Bearer {self.token}", **(headers or {})}, method=method)
        with urllib.request.urlopen(request, timeout=30) as answer:
            content = answer.read()
        self.requests.append((method, endpoint))
        return types.SimpleNamespace(content=content, text=content.decode(errors="replace"), json=lambda: json.loads(content))

    def render(self, text):
        import jinja2
        context = {"run_id": "manual__2026-01-01T00:00:00+00:00", "dag": types.SimpleNamespace(dag_id=self.dag), "ti": types.SimpleNamespace(xcom_pull=lambda task_ids: self.results[task_ids])}
        return jinja2.Environment(undefined=jinja2.StrictUndefined).from_string(text).render(context)

    def test_tasks_run_in_their_order(self):
        test, order = self, []
        self.dag = "wing"
        self.requests, self.results, params = [], {}, {"mesh": str(MESH), "out": str(self.folder / "out.vtu")}

        class Task:
            def __init__(self, task_id, run):
                self.task_id, self.run, self.output = task_id, run, ("xcom", task_id)

            def __rshift__(self, other):
                order.extend(one for one in (self, other) if one not in order)
                return other

        def http_operator(task_id, http_conn_id, method, endpoint, headers, data, response_filter, retries):
            return Task(task_id, lambda: response_filter(test.request(method, test.render(endpoint), test.render(data), headers)))

        def http_sensor(task_id, http_conn_id, method, endpoint, response_check, poke_interval, mode):
            def poke():
                while not response_check(test.request(method, test.render(endpoint), None, None)):
                    pass
            return Task(task_id, poke)

        class HttpHook:
            def __init__(self, method, http_conn_id):
                self.method = method

            def run(self, endpoint, data=None, headers=None):
                return test.request(self.method, endpoint, data, headers)

        def task(task_id, retries):
            def decorate(function):
                def call(*arguments):
                    def run():
                        given = [test.results[one[1]] if isinstance(one, tuple) and one[0] == "xcom" else one for one in arguments]
                        return function(*given, params=params)
                    return Task(task_id, run)
                return call
            return decorate

        def module(name, **members):
            made = types.ModuleType(name)
            vars(made).update(members)
            sys.modules[name] = made
            self.addCleanup(sys.modules.pop, name)

        module("pendulum", datetime=lambda *_: None)
        for name in ("airflow", "airflow.providers", "airflow.providers.http", "airflow.providers.http.hooks", "airflow.providers.http.operators",
                     "airflow.providers.http.sensors"):
            module(name)
        module("airflow.decorators", dag=lambda **_: lambda function: function, task=task)
        module("airflow.providers.http.hooks.http", HttpHook=HttpHook)
        module("airflow.providers.http.operators.http", HttpOperator=http_operator)
        module("airflow.providers.http.sensors.http", HttpSensor=http_sensor)
        exec(compile((RECIPES / "airflow_http_dag.py").read_text(), "airflow_http_dag.py", "exec"), {"__name__": "dag"})
        self.assertEqual([one.task_id for one in order], ["send", "submit", "wait", "fetch"])
        for again in range(2):  # The second time is a retry of the whole run.
            for one in order:
                self.results[one.task_id] = one.run()
            self.check_result(self.folder / "out.vtu")
            self.assertEqual(len(self.jobs()), 1, again)
        self.dag = "tail"  # Airflow gives runs of several DAGs the same id.
        for one in order:
            self.results[one.task_id] = one.run()
        self.assertEqual(sorted(one["requestId"] for one in self.jobs()), [f"airflow-{dag}-manual__2026-01-01T00:00:00+00:00" for dag in ("tail", "wing")])
        self.dag = "a" * 200
        self.results["submit"] = order[1].run()
        self.assertEqual(len(self.jobs()), 3, "a long name is cut to what the server takes")


if __name__ == "__main__":
    missing = [name for name in ("curl", "jq") if not shutil.which(name)]
    if missing:
        support.skip(f"{', '.join(missing)} missing (deploy/setup test)")
    unittest.main(verbosity=2)
