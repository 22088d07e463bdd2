"""A DAG for Airflow 2.4 or later. Its workers need the package `varimesh`. The tests only compile it, because Debian has no
Airflow.

The job does not occupy a worker: `submit` puts it into the server's queue, a sensor waits for it and frees its slot between
two checks, and `fetch` downloads the result. Airflow may retry safely, because the request id contains the ids of the DAG and of the run."""
from __future__ import annotations

import pendulum
from airflow.decorators import dag, task
from airflow.sensors.base import PokeReturnValue

SERVER = "varimesh.example:50051"


@dag(start_date=pendulum.datetime(2026, 1, 1), schedule=None, params={"mesh": "in.msh", "out": "out.msh"})
def optimise_mesh():
    @task(retries=5)
    def submit(params=None, run_id=None, dag=None):
        import varimesh

        with varimesh.Client(SERVER) as client:
            job = client.submit(params["mesh"], outputs=["msh41-binary"], request_id=f"airflow-{dag.dag_id}-{run_id}"[-128:],
                                labels={"airflow": run_id})
            return job.name

    @task.sensor(poke_interval=30, mode="reschedule")
    def wait(name):
        import varimesh

        with varimesh.Client(SERVER) as client:
            return PokeReturnValue(is_done=client.job(name).ended, xcom_value=name)

    @task(retries=5)
    def fetch(name, params=None):
        import varimesh

        with varimesh.Client(SERVER) as client:
            result = client.job(name).result()  # raises an error if the job failed
            result.save(params["out"])
            if not result.valid:
                raise ValueError(f"{name}: elements are left that are not certified valid")
            return result.after.min_scaled_jacobian

    fetch(wait(submit()))


optimise_mesh()
