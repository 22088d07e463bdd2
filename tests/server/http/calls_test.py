"""Calls over HTTP with JSON (--http): the same answers as by gRPC, and the limits of both count together.
ctest runs it with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in the environment."""
import json
import os
import re
import shutil
import subprocess
import unittest
from pathlib import Path

from over_http import JSON, UNKNOWN, WithHttp
from programs import ENDLESS, LARGER, MESH, run


class Calls(WithHttp):
    def test_a_job_from_its_submission_to_its_end(self):
        first = self.wait(self.submit(), "JOB_STATE_SUCCEEDED")
        code, submitted = self.ask("POST", "/v1/jobs?requestId=once", first["spec"])
        self.assertEqual(code, 200, submitted)
        name = submitted["job"]["name"]
        self.assertEqual(self.ask("POST", "/v1/jobs?requestId=once", first["spec"])[1]["job"]["name"], name, "the same request")
        again = self.wait(name.removeprefix("jobs/"), "JOB_STATE_SUCCEEDED")
        self.assertEqual([result["digest"] for result in again["results"]], [result["digest"] for result in first["results"]])
        listed = self.ask("GET", "/v1/jobs?states=JOB_STATE_SUCCEEDED&pageSize=1")[1]
        self.assertEqual([job["name"] for job in listed["jobs"]], [name])
        more = self.ask("GET", f"/v1/jobs?states=JOB_STATE_SUCCEEDED&pageSize=1&pageToken={listed['nextPageToken']}")[1]
        self.assertEqual([job["name"] for job in more["jobs"]], [first["name"]])
        self.assertEqual(self.ask("GET", "/v1/jobs?states=JOB_STATE_RUNNING")[1], {})
        self.assertEqual(self.ask("DELETE", f"/v1/{name}"), (200, {}))
        self.assertEqual(self.reason("GET", f"/v1/{name}"), (404, "JOB_NOT_FOUND"))

    def test_labels_choose_jobs(self):
        spec = self.wait(self.submit(), "JOB_STATE_SUCCEEDED")["spec"]
        spec["labels"] = {"wing": "left & right"}
        name = self.ask("POST", "/v1/jobs", spec)[1]["job"]["name"]
        self.assertEqual([job["name"] for job in self.ask("GET", "/v1/jobs?labels.wing=left+%26%20right")[1]["jobs"]], [name])
        self.assertEqual(self.ask("GET", "/v1/jobs?labels.wing=none")[1], {})

    def test_cancels(self):
        job = self.submit(LARGER, *ENDLESS)
        self.wait(job, "JOB_STATE_RUNNING")
        self.assertEqual(self.ask("POST", f"/v1/jobs/{job}/cancel")[0], 200)
        self.wait(job, "JOB_STATE_CANCELLED")

    def test_says_what_the_server_is(self):
        code, info, headers = self.ask("GET", "/v1/info", raw=True)
        self.assertEqual(code, 200)
        self.assertIn("MESH_FORMAT_VTU", info["outputFormats"])
        self.assertEqual(headers["X-Content-Type-Options"], "nosniff")
        self.assertIsNone(headers["Access-Control-Allow-Origin"])

    def test_says_the_sentences_of_grpc(self):
        by_grpc = run("cancel", UNKNOWN, "--server", self.server.address).stderr
        code, document = self.ask("POST", f"/v1/{UNKNOWN}/cancel")
        self.assertEqual((code, document["code"]), (404, 5))
        self.assertIn(document["message"].rstrip("."), by_grpc)
        self.assertEqual(document["details"][0]["@type"], "type.googleapis.com/google.rpc.ErrorInfo")
        spec = {"mesh": {"digest": "a" * 64}}
        self.assertEqual(self.reason("POST", "/v1/jobs", spec), (400, "MESH_NOT_FOUND"))
        self.assertEqual(self.reason("POST", "/v1/jobs", {**spec, "options": {"maxIterations": -5}})[0], 400)

    def test_checks_without_submitting(self):
        spec = self.wait(self.submit(), "JOB_STATE_SUCCEEDED")["spec"]
        self.assertEqual(self.ask("POST", "/v1/jobs?validateOnly=true", spec)[0], 200)
        self.assertEqual(len(self.ask("GET", "/v1/jobs")[1]["jobs"]), 1)

    def test_the_lines_of_the_page(self):
        if shutil.which("curl") is None or shutil.which("jq") is None:
            self.skipTest("there is no curl or no jq")
        page = (Path(os.environ["VARIMESH_SOURCE_DIR"]) / "docs" / "http.md").read_text()
        lines = [line for block in re.findall(r"```sh\n(.*?)```", page, re.S)[1:] for line in block.splitlines()]
        self.assertGreater(len(lines), 11)
        shutil.copy(MESH, self.folder / "mesh.msh")
        script = "\n".join(["set -e -o pipefail", "set -x", *(line.replace("curl ", "curl --fail-with-body ") for line in lines)])
        done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, cwd=self.folder, timeout=60,
                              env={**os.environ, "HTTP": self.url})
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        local = self.folder / "local.vtu"
        self.assertEqual(run("optimise", MESH, "-o", local).returncode, 0)
        self.assertEqual((self.folder / "better.vtu").read_bytes(), local.read_bytes())

    def test_with_curl(self):
        if shutil.which("curl") is None:
            self.skipTest("there is no curl")
        spec = self.wait(self.submit(), "JOB_STATE_SUCCEEDED")["spec"]

        def curl(*arguments):
            done = subprocess.run(["curl", "-sS", "--fail-with-body", *arguments], capture_output=True, text=True, timeout=30)
            return done.returncode, json.loads(done.stdout)

        code, submitted = curl("--json", json.dumps(spec), f"{self.url}/v1/jobs")
        self.assertEqual(code, 0, submitted)
        self.assertEqual(curl(f"{self.url}/v1/{submitted['job']['name']}")[0], 0)
        self.assertEqual(curl("-X", "POST", self.url.replace("127.0.0.1", "localhost") + f"/v1/{UNKNOWN}/cancel")[0], 22)


class Limits(WithHttp):
    def flags(self):
        return ("--max-submissions-per-peer", "3")

    def test_the_limits_of_a_peer_count_both_ways(self):
        spec = self.wait(self.submit(), "JOB_STATE_SUCCEEDED")["spec"]
        for _ in range(2):
            self.assertEqual(self.ask("POST", "/v1/jobs", spec)[0], 200)
        code, document, headers = self.ask("POST", "/v1/jobs", spec, raw=True)
        self.assertEqual((code, document["details"][0]["reason"]), (429, "PEER_LIMIT"))
        self.assertGreater(int(headers["Retry-After"]), 0)
        forged = {**JSON, "varimesh-address": "10.0.0.1", "X-Forwarded-For": "10.0.0.1"}
        self.assertEqual(self.ask("POST", "/v1/jobs", spec, forged)[0], 429)


if __name__ == "__main__":
    unittest.main(verbosity=2)
