"""VariMesh from Python: optimises high-order meshes on a server.

    import varimesh

    result = varimesh.optimise((nodes, cells))             # numpy arrays; result.nodes are the new coordinates

    with varimesh.local() as client:                       # or varimesh.Client("HOST:PORT")
        result = client.optimise("in.msh", "out.msh", min_js=0.2)
        print(result)

The manual is docs/python.md.
"""
from .requirements import check as _check

_check()

from .adapters import from_gmsh, from_meshio, from_pyvista, to_meshio, update_gmsh
from .aio import AsyncClient, AsyncJob
from .client import Client
from .errors import (
    BadMesh,
    BadOption,
    BadOutput,
    JobCancelled,
    JobFailed,
    Refused,
    ServerUnreachable,
    Stopped,
    VarimeshError,
)
from .events import Event, Iteration, Work
from .job import Job, Result
from .local import LocalClient, local
from .mesh import Block, Mesh
from .options import Geometry, GeometryReport, Layers, LayersReport, Options, SurfaceDistance, TargetField
from .progress import Progress
from .reports import (
    CellQuality,
    Certified,
    Metrics,
    Quality,
    Remedy,
    RepairStep,
    ServerInfo,
    SlideTrial,
    Unrepairable,
    WhatIsLeft,
)
from .shared import optimise, optimize, quality
from .version import __version__

__all__ = [
    "AsyncClient", "AsyncJob", "BadMesh", "BadOption", "BadOutput", "Block", "CellQuality", "Certified", "Client", "Event", "Geometry", "GeometryReport", "Iteration", "Job",
    "JobCancelled", "JobFailed", "Layers", "LayersReport", "LocalClient", "Mesh", "Metrics", "Options", "Progress", "Quality", "Refused",
    "Remedy", "RepairStep", "Result", "ServerInfo", "ServerUnreachable", "SlideTrial", "Stopped", "SurfaceDistance", "TargetField", "Unrepairable", "VarimeshError",
    "WhatIsLeft", "Work", "__version__",
    "from_gmsh", "from_meshio", "from_pyvista", "local", "optimise", "optimize", "quality", "to_meshio", "update_gmsh",
]  # fmt: skip
