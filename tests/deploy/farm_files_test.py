#!/usr/bin/env python3
"""The files of deploy/farm, read by the tools that they are for. A tool that is missing is named, and its test is skipped.
  farm_files_test.py Compose|Kubernetes|Helm|Prometheus

Debian has no Helm. If there is none, install_helm takes it from npm's registry, into the folder VARIMESH_HELM."""
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest
import urllib.request
from pathlib import Path

try:
    import yaml
except ImportError:
    yaml = None

TREE = Path(os.environ["VARIMESH_SOURCE_DIR"])
FARM = TREE / "deploy" / "farm"
VARIMESHD = os.environ["VARIMESHD"]
PROMETHEUS = FARM / "prometheus"
TOOLS = {"Prometheus": "promtool", "Compose": "docker-compose", "Kubernetes": "kubectl", "Helm": "helm"}


def flags_of_varimeshd():
    text = subprocess.run([VARIMESHD, "--help"], capture_output=True, text=True, check=True).stdout
    return set(re.findall(r"--[a-z-]+", text))


def is_read_only(service, name, target):
    """Whether a service of `docker-compose config` has this volume there, and cannot write to it. Version 1 prints a volume as
    NAME:TARGET:ro, and version 2 as a mapping. None: it has no such volume."""
    for volume in service["volumes"]:
        if isinstance(volume, str):
            volume = dict(zip(("source", "target", "read_only"), volume.split(":")))
        if (volume["source"], volume["target"]) == (name, target):
            return volume.get("read_only") in ("ro", True)
    return None


class Compose(unittest.TestCase):
    def config(self, **environment):
        return subprocess.run(["docker-compose", "-f", str(FARM / "compose.yaml"), "--profile", "metrics", "config"],
                              capture_output=True, text=True, env={**os.environ, **environment}, timeout=60)

    def test_is_read(self):
        done = self.config(POSTGRES_PASSWORD_FILE="/secret")
        self.assertEqual(done.returncode, 0, done.stderr)
        for name in ("database", "frontend", "grafana", "migrate", "nginx", "prometheus", "worker"):
            self.assertRegex(done.stdout, rf"(?m)^  {name}:$")
        used = set(re.findall(r"--[a-z-]+(?=\n)", done.stdout)) - {"--directory"}  # a flag of install
        self.assertLessEqual(used, flags_of_varimeshd(), "varimeshd has these flags")

    def test_the_files_that_it_mounts_are_there(self):
        text = (FARM / "compose.yaml").read_text()
        mounted = re.findall(r"- \./([^:]+):", text)
        self.assertGreater(len(mounted), 3)
        for path in mounted:
            self.assertTrue((FARM / path).exists(), path)
        provisioned = "".join(file.read_text() for file in (FARM / "grafana").rglob("*.yaml"))
        self.assertIn("http://prometheus:9090", provisioned, "the service of this name")
        self.assertIn("path: /etc/varimesh}", provisioned, "where the page is mounted")
        self.assertIn("health,", text, "containers are asked how they are")

    def test_only_what_has_a_port_reaches_the_outside(self):
        done = self.config(POSTGRES_PASSWORD_FILE="/secret")
        networks = yaml.safe_load(done.stdout)["networks"]
        self.assertEqual({name for name, network in networks.items() if network.get("internal")}, {"servers"})
        for name, service in yaml.safe_load(done.stdout)["services"].items():
            with self.subTest(name):
                if name == "meshes":
                    self.assertEqual(service["network_mode"], "none")
                else:
                    self.assertEqual("outside" in service["networks"], "ports" in service)
                for port in service.get("ports", []):
                    self.assertIn("127.0.0.1", str(port))

    def test_every_image_may_be_given_with_its_digest(self):
        digest = "@sha256:" + "a" * 64
        images = {f"{name}_IMAGE": name.lower() + digest for name in ("VARIMESH", "POSTGRES", "NGINX", "PROMETHEUS", "GRAFANA")}
        services = yaml.safe_load(self.config(POSTGRES_PASSWORD_FILE="/secret", **images).stdout)["services"]
        self.assertEqual({service["image"] for service in services.values()}, set(images.values()))

    def test_needs_a_password(self):
        environment = {key: value for key, value in os.environ.items() if key != "POSTGRES_PASSWORD_FILE"}
        done = subprocess.run(["docker-compose", "-f", str(FARM / "compose.yaml"), "config"], capture_output=True, text=True,
                              env=environment, timeout=60)
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("with a password", done.stderr)

    def test_the_password_is_in_no_environment(self):
        services = yaml.safe_load(self.config(POSTGRES_PASSWORD_FILE="/secret").stdout)["services"]
        for name, service in services.items():
            secrets = [key for key in service.get("environment", {}) if "PASSWORD" in key and not key.endswith("_FILE")]
            self.assertEqual(secrets, [], name)
        for name in ("frontend", "worker", "migrate"):
            self.assertEqual(services[name]["environment"]["PGPASSFILE"], "/password/pgpass")
            self.assertTrue(is_read_only(services[name], "password", "/password"), services[name]["volumes"])
        for name in ("frontend", "worker"):
            self.assertIs(is_read_only(services[name], "meshes", "/meshes"), False, services[name]["volumes"])
        (command,) = services["meshes"]["command"]
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "run/secrets").mkdir(parents=True)
            (Path(folder) / "run/secrets/password").write_text("pass:wo\\rd&/")
            for path in (" /meshes", " /password", " /run/secrets"):
                command = command.replace(path, f" {folder}/{path[2:]}")
            user, group = os.getuid(), os.getgid()
            command = command.replace("65532:65532", f"{user}:{group}").replace("--owner=65532 --group=65532", f"--owner={user} --group={group}")
            subprocess.run(["sh", "-c", command.replace("$$", "$")], check=True, timeout=20)
            made = Path(folder) / "password" / "pgpass"
            self.assertEqual(made.read_text().rstrip("\n"), "*:*:*:*:pass\\:wo\\\\rd&/")
            self.assertEqual(made.stat().st_mode & 0o777, 0o600)


class Kubernetes(unittest.TestCase):
    def test_is_rendered(self):
        for overlay, workers in (("small", "1"), ("keda", None), ("ingress", None), ("devices", "2")):
            done = subprocess.run(["kubectl", "kustomize", str(FARM / "kubernetes" / "overlays" / overlay)],
                                  capture_output=True, text=True, timeout=60)
            self.assertEqual(done.returncode, 0, done.stderr)
            parts = done.stdout.split("\n---\n")
            deployments = [part for part in parts if re.search("^kind: Deployment$", part, re.MULTILINE)]
            self.assertEqual(len(deployments), 2)
            for part in deployments:
                self.assertEqual(part.count("port: metrics"), 3, "probes")
                for line in ("readOnlyRootFilesystem: true", "runAsUser: 65532", "automountServiceAccountToken: false",
                             "allowPrivilegeEscalation: false", "memory:"):
                    self.assertIn(line, part)
                used = set(re.findall(r"^ +- (--[a-z-]+)$", part, re.MULTILINE))
                self.assertIn("--role", used)
                self.assertLessEqual(used, flags_of_varimeshd())
            (policy,) = (part for part in parts if re.search("^  name: varimesh$", part, re.MULTILINE) and "NetworkPolicy" in part)
            self.assertIn("- Egress", policy)
            self.assertEqual(re.findall(r"port: (\d+)", policy), ["53", "53", "5432", "443"], "what all servers may reach")
            self.assertIn("?sslmode=require", done.stdout)
            worker = next(part for part in deployments if "name: varimesh-worker" in part)
            replicas = re.search(r"^  replicas: (\d+)$", worker, re.MULTILINE)
            self.assertEqual(replicas and replicas[1], workers)
            has_devices = [re.search(words, worker) is not None for words in ("nvidia.com/gpu: 1\n", '- --devices\n +- "1"\n')]
            self.assertEqual(has_devices, [overlay == "devices"] * 2)

    def test_requests_have_the_sizes_of_nginx(self):
        if yaml is None:
            self.skipTest("python3-yaml is missing")
        sizes = {}
        for part in yaml.safe_load_all((FARM / "kubernetes" / "overlays" / "ingress" / "ingress.yaml").read_text()):
            size = int(part["metadata"]["annotations"]["nginx.ingress.kubernetes.io/proxy-body-size"])
            sizes |= {path["path"]: size for path in part["spec"]["rules"][0]["http"]["paths"]}
        nginx = (TREE / "deploy" / "nginx.conf").read_text()
        others = int(re.search(r"^  client_max_body_size (\d+);", nginx, re.MULTILINE)[1])
        self.assertEqual(sizes.pop("/"), others)
        locations = re.findall(r"location (~|=) (\S+) {\s+client_max_body_size (\d+)", nginx)
        contract = (TREE / "proto" / "varimesh" / "v1" / "service.proto").read_text()
        for service, calls in re.findall(r"^service (\w+) {\n(.*?)^}", contract, re.MULTILINE | re.DOTALL):
            for call in re.findall(r"rpc (\w+)\(", calls):
                path = f"/varimesh.v1.{service}/{call}"
                there = [int(size) for kind, name, size in locations if (re.search(name, path) if kind == "~" else name == path)]
                self.assertEqual([sizes.pop(path, others)], there or [others], path)
        self.assertEqual(sizes, {}, "there are no such calls")

    def test_the_password_is_in_a_file_that_only_its_user_can_read(self):
        if yaml is None:
            self.skipTest("python3-yaml is missing")
        text = subprocess.run(["kubectl", "kustomize", str(FARM / "kubernetes" / "overlays" / "small")], capture_output=True,
                              text=True, timeout=60, check=True).stdout
        self.assertNotIn("PGPASSWORD", text)
        pods = [part["spec"]["template"]["spec"] for part in yaml.safe_load_all(text) if part["kind"] in ("Deployment", "Job")]
        self.assertEqual(len(pods), 3)
        for pod in pods:
            (container,), (password,) = pod["containers"], pod["initContainers"]
            self.assertIn({"name": "PGPASSFILE", "value": "/password/pgpass"}, container["env"])
            self.assertNotIn("database", [mount["name"] for mount in container["volumeMounts"]])
            with tempfile.TemporaryDirectory() as folder:
                for name in ("database", "password"):
                    (Path(folder) / name).mkdir()
                (Path(folder) / "database" / "password").write_text("pass:wo\\rd&/")
                *shell, command = password["command"]
                command = command.replace("/database/", f"{folder}/database/").replace("/password/pgpass", f"{folder}/password/pgpass")
                subprocess.run([*shell, command], check=True, timeout=20)
                made = Path(folder) / "password" / "pgpass"
                self.assertEqual(made.read_text().rstrip("\n"), "*:*:*:*:pass\\:wo\\\\rd&/")
                self.assertEqual(made.stat().st_mode & 0o777, 0o600)


class Helm(unittest.TestCase):
    """The chart says the same as the overlays of kustomize."""

    def helm(self, *arguments, status=0):
        done = subprocess.run(["helm", *arguments], capture_output=True, text=True, timeout=60, cwd=FARM / "helm")
        self.assertEqual(done.returncode, status, done.stdout + done.stderr)
        return done.stdout if status == 0 else done.stdout + done.stderr

    def render(self, *arguments):
        return self.parts(self.helm("template", "varimesh", "varimesh", "--namespace", "varimesh", *arguments))

    def parts(self, text):
        """The objects by kind and name. The name of kustomize's ConfigMap ends with a sum of its content."""
        text = re.sub(r"\bvarimesh-[a-z0-9]{10}$", "varimesh", text, flags=re.MULTILINE)
        objects = [part for part in yaml.safe_load_all(text) if part]
        return {(part["kind"], part["metadata"]["name"]): part for part in objects}

    def test_has_no_faults(self):
        for values in ("small", "keda", "ingress", "devices"):
            answer = self.helm("lint", "varimesh", "--strict", "--values", f"{values}.yaml")
            self.assertIn("0 chart(s) failed", answer)

    def test_says_the_same_as_kustomize(self):
        for name in ("small", "keda", "ingress", "devices"):
            with self.subTest(name):
                chart = self.render("--values", f"{name}.yaml")
                overlay = self.parts(subprocess.run(["kubectl", "kustomize", str(FARM / "kubernetes" / "overlays" / name)],
                                                    capture_output=True, text=True, timeout=60, check=True).stdout)
                self.assertEqual(chart.keys(), overlay.keys())
                for key, part in chart.items():
                    self.assertEqual(part, overlay[key], key)

    def test_http_has_a_place_beside_grpc_if_it_is_wanted(self):
        self.assertNotIn("http", json.dumps(list(self.render().values())).replace("httpGet", ""))
        chart = self.render("--set", "http.enabled=true", "--set", "frontend.flags={--log-level,debug}")
        self.assertNotIn(("Ingress", "varimesh-http"), chart)
        server, proxy = chart["Deployment", "varimesh-frontend"]["spec"]["template"]["spec"]["containers"]
        self.assertEqual(server["args"][-4:], ["--http", "127.0.0.1:8080", "--log-level", "debug"])
        self.assertLessEqual({flag for flag in server["args"] if flag.startswith("--")} - {"--log-level"}, flags_of_varimeshd())
        self.assertEqual(proxy["image"], "nginx:1.26")
        self.assertTrue(proxy["securityContext"]["readOnlyRootFilesystem"])
        ports = [port["name"] for port in chart["Service", "varimesh"]["spec"]["ports"]]
        self.assertEqual(ports, ["grpc", "https"])
        (allowed,) = chart["NetworkPolicy", "varimesh-frontend"]["spec"]["ingress"]
        self.assertEqual([port["port"] for port in allowed["ports"]], ports)
        chart = self.render("--set", "http.enabled=true", "--set", "ingress.enabled=true")
        paths = chart["Ingress", "varimesh-http"]["spec"]["rules"][0]["http"]["paths"]
        self.assertEqual({path["backend"]["service"]["port"]["name"] for path in paths}, {"https"})
        taken = re.search(r"location ~ \^/\((\S+)\)\$", chart["ConfigMap", "varimesh-http"]["data"]["nginx.conf"])[1]
        self.assertEqual([path["path"] for path in paths if path["pathType"] == "Exact"], ["/", "/page.css", "/page.js", "/three.js"])
        for path in paths:
            self.assertRegex(path["path"].strip("/") + ("/jobs" if path["pathType"] == "Prefix" else ""), rf"^({taken})$", "the proxy takes what it gets")

    def test_meshes_in_a_bucket_need_no_volume(self):
        chart = self.render("--set", "meshes.bucket=s3://meshes/farm?region=eu-1")
        self.assertNotIn(("PersistentVolumeClaim", "varimesh-meshes"), chart)
        worker = chart["Deployment", "varimesh-worker"]["spec"]["template"]["spec"]
        self.assertEqual([volume["name"] for volume in worker["volumes"]], ["bucket", "tmp", "database", "password"])
        self.assertIn({"name": "AWS_SHARED_CREDENTIALS_FILE", "value": "/bucket/credentials"}, worker["containers"][0]["env"])

    def test_more_flags_and_other_numbers(self):
        chart = self.render("--set", "worker.flags={--traces,http://collector:4318}", "--set", "worker.replicas=7")
        worker = chart["Deployment", "varimesh-worker"]["spec"]
        self.assertEqual(worker["replicas"], 7)
        flags = worker["template"]["spec"]["containers"][0]["args"]
        self.assertEqual(flags[-2:], ["--traces", "http://collector:4318"])
        self.assertLessEqual({flag for flag in flags if flag.startswith("--")}, flags_of_varimeshd())

    def test_jobs_that_need_a_card_call_for_workers_that_have_some(self):
        for values, count in ((("keda",), True), (("keda", "devices"), False)):
            chart = self.render(*(word for name in values for word in ("--values", f"{name}.yaml")))
            for trigger in chart["ScaledObject", "varimesh-worker"]["spec"]["triggers"]:
                self.assertEqual("needs_device = 0" in trigger["metadata"]["query"], count, values)

    def test_a_digest_goes_before_the_tag(self):
        digest = "sha256:" + "a" * 64
        chart = self.render("--set", f"image.digest={digest}", "--set", "network.ports={5432}")
        for name in ("varimesh-frontend", "varimesh-worker"):
            (container,) = chart["Deployment", name]["spec"]["template"]["spec"]["containers"]
            self.assertEqual(container["image"], f"varimesh@{digest}")
        (egress,) = chart["NetworkPolicy", "varimesh"]["spec"]["egress"]
        self.assertEqual([port["port"] for port in egress["ports"]], [53, 53, 5432])

    def test_wrong_values_are_refused(self):
        for value, words in (("worker.replica=3", "replica"), ("worker.threads=many", "threads"), ("scaling.by=chance", "scaling.by"),
                             ("database.url=postgresql://farm:secret@db/x", "database.url"), ("meshes.storage=plenty", "storage"),
                             ("frontend.replicas=0", "replicas"), ("image.digest=latest", "digest"), ("network.ports={70000}", "ports"),
                             ("http.enabled=perhaps", "enabled"), ("worker.resources.limits.nvidia\\.com/gpu=some", "gpu")):
            answer = self.helm("template", "varimesh", "varimesh", "--set", value, status=1)
            self.assertIn(words, answer)
            self.assertIn("schema", answer)

    def test_every_value_is_documented(self):
        schema = json.loads((FARM / "helm" / "varimesh" / "values.schema.json").read_text())
        text = (FARM / "helm" / "varimesh" / "values.yaml").read_text()
        for group, keys in yaml.safe_load(text).items():
            self.assertEqual(set(keys), set(schema["properties"][group]["properties"]), group)
            self.assertRegex(text, rf"(?m)^# .*\n{group}:", "a comment above it")


class Prometheus(unittest.TestCase):
    def promtool(self, *arguments):
        done = subprocess.run(["promtool", *arguments], capture_output=True, text=True, timeout=60, cwd=PROMETHEUS)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_the_configuration_and_the_rules_are_read(self):
        self.promtool("check", "config", "prometheus.yml")
        self.promtool("check", "rules", "rules.yml")

    def test_alarms_ring_when_they_must(self):
        self.promtool("test", "rules", "rules_test.yml")
        alarms = set(re.findall(r"- alert: (\w+)", (PROMETHEUS / "rules.yml").read_text()))
        tests = (PROMETHEUS / "rules_test.yml").read_text()
        for alarm in alarms:
            self.assertRegex(tests, rf"alertname: {alarm}\n +exp_alerts", "a test in which it rings")
            self.assertRegex(tests, rf"alertname: {alarm}}}\n", "a test in which it does not")
            self.assertIn(f"`{alarm}`", (TREE / "docs" / "operations.md").read_text(), "what to do then")

    def names_of_a_server(self):
        """The names that /metrics has after a job and a call that failed."""
        with tempfile.TemporaryDirectory() as folder:
            server = subprocess.Popen([VARIMESHD, "--listen", f"unix:{folder}/socket", "--data", folder, "--metrics",
                                       "127.0.0.1:0"], stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
            try:
                address = None
                for line in server.stderr:
                    if found := re.search(r"http://(\S+)/metrics", line):
                        address = found[1]
                        break
                mesh = TREE / "tests" / "cases" / "nine_triangles.msh"
                for arguments, status in ((["optimise", mesh, "--output", f"{folder}/out.msh"], 0), (["cancel", "jobs/none"], None)):
                    done = subprocess.run([os.environ["VARIMESH"], *arguments, "--server", f"unix:{folder}/socket"],
                                          capture_output=True, text=True, timeout=60)
                    self.assertEqual(done.returncode if status is None else status, done.returncode, done.stderr)
                with urllib.request.urlopen(f"http://{address}/metrics", timeout=10) as answer:
                    text = answer.read().decode()
            finally:
                server.send_signal(signal.SIGTERM)
                server.communicate(timeout=40)
        return set(re.findall(r"^(\w+)[ {]", text, re.MULTILINE))

    def test_every_metric_is_one_that_a_server_gives(self):
        there = self.names_of_a_server() | {"up"}
        dashboard = json.loads((PROMETHEUS / "dashboard.json").read_text())
        asked = [target["expr"] for panel in dashboard["panels"] for target in panel["targets"]]
        rules = (PROMETHEUS / "rules.yml").read_text()
        used = set(re.findall(r"\b(?:varimesh|grpc|process)_\w+", "\n".join(asked) + rules)) - {"grpc_code", "grpc_method"}
        self.assertGreater(len(used), 10)
        self.assertLessEqual(used, there)
        self.assertEqual(there - used - {"up", "varimesh_job_run_seconds_sum"}, set(), "and each is shown somewhere")
        self.assertEqual(len({panel["id"] for panel in dashboard["panels"]}), len(dashboard["panels"]))


if __name__ == "__main__":
    tool = TOOLS[sys.argv[1]]
    if tool == "helm" and shutil.which("helm") is None and "VARIMESH_HELM" in os.environ:
        installed = subprocess.run([TREE / "tests" / "deploy" / "install_helm", os.environ["VARIMESH_HELM"]],
                                   stdout=subprocess.PIPE, text=True, timeout=110)
        print(installed.stdout, end="")
        os.environ["PATH"] += os.pathsep + os.environ["VARIMESH_HELM"]
    missing = [name for name in (tool, "kubectl" if tool == "helm" else tool) if shutil.which(name) is None]
    if yaml is None and tool in ("helm", "docker-compose"):
        missing.append("python3-yaml")
    if missing:
        print(f"SKIPPED: deploy/farm: {' and '.join(missing)} is missing")
        sys.exit(77)
    unittest.main(verbosity=2)
