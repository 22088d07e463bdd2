"""An Airflow DAG (2.4 or later) with the package `varimesh` on its workers. The tests compile it and no more: Debian has
no Airflow.

The job does not hold a worker: `submit` puts it in the server's queue, a sensor that gives its slot back between looks
waits for it, and `fetch` takes the result. Airflow's retries are safe, because the run's id is the request's."""
from __future__ import annotations

import pendulum
from airflow.decorators import dag, task
from airflow.sensors.base import PokeReturnValue

SERVER = "varimesh.example:50051"


@dag(start_date=pendulum.datetime(2026, 1, 1), schedule=None, params={"mesh": "in.msh", "out": "out.msh"})
def optimise_mesh():
    @task(retries=5)
    def submit(params=None, run_id=None):
        import varimesh

        with varimesh.Client(SERVER) as client:
            job = client.submit(params["mesh"], outputs=["msh41-binary"], request_id=f"airflow-{run_id}"[:128],
                                labels={"airflow": run_id}, energy="hyperelastic")
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
            result = client.job(name).result()  # raises where it failed
            result.save(params["out"])
            if not result.valid:
                raise ValueError(f"{name}: elements are left that are not certified valid")
            return result.after.min_scaled_jacobian

    fetch(wait(submit()))


optimise_mesh()
