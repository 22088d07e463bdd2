"""A DAG for Airflow 2.4 or later that optimises many meshes. Its workers need the package `varimesh`. The tests only compile
it, because Debian has no Airflow.

One task submits all meshes, a sensor waits for all jobs without occupying a worker, and one mapped task per job fetches its
result. Airflow may retry safely, because the request ids contain the ids of the DAG and of the run."""
from __future__ import annotations

from pathlib import Path

import pendulum
from airflow.decorators import dag, task
from airflow.sensors.base import PokeReturnValue

SERVER = "varimesh.example:50051"


@dag(start_date=pendulum.datetime(2026, 1, 1), schedule=None, params={"meshes": "/data/meshes", "into": "/data/results"})
def optimise_many_meshes():
    @task(retries=5)
    def submit(params=None, run_id=None, dag=None):
        import varimesh

        with varimesh.Client(SERVER) as client:
            return [client.submit(mesh, outputs=["msh41-binary"], labels={"airflow": run_id},
                                  request_id=f"airflow-{dag.dag_id}-{run_id}-{mesh.name}"[-128:]).name
                    for mesh in sorted(Path(params["meshes"]).glob("*.msh"))]

    @task.sensor(poke_interval=30, mode="reschedule")
    def wait(names):
        import varimesh

        with varimesh.Client(SERVER) as client:
            return PokeReturnValue(is_done=all(client.job(name).ended for name in names), xcom_value=names)

    @task(retries=5)
    def fetch(name, params=None):
        import varimesh

        with varimesh.Client(SERVER) as client:
            job = client.job(name)
            result = job.result()  # raises an error if the job failed
            result.save(Path(params["into"]) / job.file)
            if not result.valid:
                raise ValueError(f"{name}: elements are left that are not certified valid")
            return result.after.min_scaled_jacobian

    fetch.expand(name=wait(submit()))


optimise_many_meshes()
