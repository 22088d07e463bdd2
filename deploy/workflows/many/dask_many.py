"""Optimises many meshes on a server from Dask: python3 dask_many.py SERVER INTO MESH...

A task per mesh waits for its job and saves the result, so that later tasks can depend on it. The work is done by the server:
Dask's workers only wait, and one machine is enough for hundreds of meshes. A task may be repeated safely, because the request
id is made from the bytes of the mesh. The workers need the package `varimesh` and the folders of the meshes and the results."""
from __future__ import annotations

import hashlib
import sys
from pathlib import Path

from distributed import Client, LocalCluster, as_completed


def optimise(server: str, mesh: str, into: str) -> tuple[str, bool, float]:
    """The file name of the mesh, whether every element is certified valid, and the smallest scaled Jacobian."""
    import varimesh

    source = Path(mesh)
    request_id = "dask-" + hashlib.sha256(source.read_bytes() + source.name.encode()).hexdigest()
    with varimesh.Client(server) as client:
        result = client.optimise(source, Path(into) / source.name, arrays=False, request_id=request_id)
        return source.name, result.valid, result.after.min_scaled_jacobian


def main(server: str, into: str, meshes: list[str]) -> int:
    Path(into).mkdir(parents=True, exist_ok=True)
    # For a cluster that exists, give its scheduler's address to Client.
    with LocalCluster(n_workers=1, threads_per_worker=32, processes=False, dashboard_address=None) as cluster:
        with Client(cluster) as dask:
            tasks = [dask.submit(optimise, server, str(Path(mesh).absolute()), str(Path(into).absolute()), pure=False)
                     for mesh in meshes]  # fmt: skip
            left = 0
            for task, (name, valid, smallest) in as_completed(tasks, with_results=True):
                print(f"{name}  min Js {smallest:.4f}  {'certified valid' if valid else 'elements are left'}", flush=True)
                left += not valid
    return 4 if left else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2], sys.argv[3:]))
