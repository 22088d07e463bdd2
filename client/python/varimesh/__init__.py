"""VariMesh from Python: optimises high-order meshes on a server.

    import varimesh

    with varimesh.local() as client:                       # or varimesh.Client("HOST:PORT")
        result = client.optimise("in.msh", "out.msh", energy="hyperelastic")
        print(result)

The manual is docs/python.md.
"""
from .adapters import from_gmsh, from_meshio, update_gmsh
from .aio import AsyncClient, AsyncJob
from .client import Client
from .errors import (
    BadMesh,
    BadOption,
    JobCancelled,
    JobFailed,
    Refused,
    ServerUnreachable,
    Stopped,
    VarimeshError,
)
from .job import Job, Result
from .local import LocalClient, local
from .mesh import Block, Mesh
from .options import Options, TargetField
from .progress import Progress
from .reports import Certified, Event, Iteration, Metrics, Quality, RepairStep, ServerInfo, Unrepairable
from .version import __version__

__all__ = [
    "AsyncClient", "AsyncJob", "BadMesh", "BadOption", "Block", "Certified", "Client", "Event", "Iteration", "Job",
    "JobCancelled", "JobFailed", "LocalClient", "Mesh", "Metrics", "Options", "Progress", "Quality", "Refused",
    "RepairStep", "Result", "ServerInfo", "ServerUnreachable", "Stopped", "TargetField", "Unrepairable", "VarimeshError", "__version__",
    "from_gmsh", "from_meshio", "local", "update_gmsh",
]  # fmt: skip
