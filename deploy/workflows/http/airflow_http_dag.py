"""A DAG for Airflow 2.4 or later with the package apache-airflow-providers-http. Nothing of VariMesh is needed on Airflow's
side. The connection "varimesh" (of the type HTTP) has the server's address, and in its extra field the token:
{"Authorization": "Bearer TOKEN"}.

The job does not occupy a worker: `submit` puts it into the server's queue, a sensor waits for it and frees its slot between
two questions, and `fetch` downloads the result. Airflow may retry safely, because the request id contains the ids of the DAG and of the run."""
from __future__ import annotations

import hashlib
import json

import pendulum
from airflow.decorators import dag, task
from airflow.providers.http.hooks.http import HttpHook
from airflow.providers.http.operators.http import HttpOperator
from airflow.providers.http.sensors.http import HttpSensor

CONNECTION = "varimesh"


def has_ended(response) -> bool:
    """Whether the job has ended; an error if it has no result."""
    job = response.json()["job"]
    if job["state"] in ("JOB_STATE_FAILED", "JOB_STATE_CANCELLED"):
        raise ValueError(f"{job['name']}: {job.get('error', {}).get('message', job['state'])}")
    return job["state"] == "JOB_STATE_SUCCEEDED"


@dag(start_date=pendulum.datetime(2026, 1, 1), schedule=None, params={"mesh": "in.msh", "out": "out.vtu"})
def optimise_mesh_by_http():
    @task(task_id="send", retries=5)
    def send(params=None):
        with open(params["mesh"], "rb") as mesh:
            body = mesh.read()
        digest = hashlib.sha256(body).hexdigest()
        HttpHook("POST", http_conn_id=CONNECTION).run(
            f"/v1/meshes?digest={digest}", data=body, headers={"Content-Type": "application/octet-stream"})
        return digest

    submit = HttpOperator(
        task_id="submit",
        http_conn_id=CONNECTION,
        method="POST",
        endpoint="/v1/jobs?requestId={{ ('airflow-' ~ dag.dag_id ~ '-' ~ run_id)[-128:] | urlencode }}",
        headers={"Content-Type": "application/json"},
        data='{"mesh": {"digest": "{{ ti.xcom_pull(task_ids=\'send\') }}"}, "outputs": ["MESH_FORMAT_VTU"]}',
        response_filter=lambda response: response.json()["job"]["name"],
        retries=5)

    wait = HttpSensor(
        task_id="wait",
        http_conn_id=CONNECTION,
        method="GET",
        endpoint="/v1/{{ ti.xcom_pull(task_ids='submit') }}",
        response_check=has_ended,
        poke_interval=30,
        mode="reschedule")

    @task(task_id="fetch", retries=5)
    def fetch(name, params=None):
        hook = HttpHook("GET", http_conn_id=CONNECTION)
        with open(params["out"], "wb") as out:
            out.write(hook.run(f"/v1/{name}/result").content)
        metrics = json.loads(hook.run(f"/v1/{name}").text)["job"]["metrics"]
        left = int(metrics["mesh"]["elements"]) - int(metrics["after"]["certified"].get("valid", 0))
        if left:
            raise ValueError(f"{name}: {left} elements are left that are not certified valid")

    send() >> submit >> wait >> fetch(submit.output)


optimise_mesh_by_http()
