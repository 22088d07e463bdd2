"""The server's messages about jobs, as plain data."""
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import wire
from .errors import BadOption
from .names import counted, spelled
from .numbering import OF_FILES, Numbering
from .options import Geometry, GeometryReport, LayersReport, geometry_report_of, layers_report_of
from .v1 import job_pb2, mesh_pb2, optimise_pb2, quality_pb2, service_pb2

@dataclass(frozen=True)
class Certified:
    """The numbers of cells that are proved valid, proved invalid, or neither."""

    valid: int
    invalid: int
    undecided: int
    min_scaled_jacobian_lower_bound: float


@dataclass(frozen=True)
class Accuracy:
    """How much accuracy a solver loses because cells are curved; 0 if all are straight-sided."""

    loss: float
    modal_parts: NDArray[np.float64]  # parts of the cells' maps by degree, from degree 2 to the order of the mesh


@dataclass(frozen=True)
class LayerError:
    """How well the elements in layers hold solutions that decay from the wall, as a relative error of the gradient."""

    error: float
    cells: int  # in layers


@dataclass(frozen=True, repr=False)
class Quality:
    """The quality of a whole mesh. proto/varimesh/v1/quality.proto describes the fields."""

    min_scaled_jacobian: float
    mean_scaled_jacobian: float
    min_distortion_jacobian: float
    invalid_elements: int
    histogram: NDArray[np.int64]
    certified: Certified
    uncertified: NDArray[np.int64]  # numbers of the cells that are not certified valid; at most 1000
    accuracy: Accuracy | None  # None if a run had to end at once, and for a curved surface in space
    clockwise_elements: int
    clockwise: NDArray[np.int64]  # numbers of the cells that are numbered clockwise; at most 1000
    in_layers: LayerError | None  # of runs that treat layers; None without, and if one is invalid

    def __repr__(self) -> str:
        valid, left = self.certified.valid, self.certified.invalid + self.certified.undecided
        return (f"<quality: scaled Jacobian at least {self.min_scaled_jacobian:.4f}, {self.mean_scaled_jacobian:.4f} on average; "
                f"{valid} of {counted(valid + left, 'cell')} certified valid>")  # fmt: skip


@dataclass(frozen=True, repr=False)
class CellQuality(Quality):
    """The quality of a mesh and of each of its cells. The arrays have one entry per cell, in the mesh's order."""

    number: NDArray[np.int64]  # of the file, or from 0 for arrays
    scaled_jacobian: NDArray[np.float64]  # min J / max J; -1 if J is nowhere positive
    valid: NDArray[np.bool_]  # certified valid: the Jacobian is proved positive in the whole cell
    invalid: NDArray[np.bool_]  # certified invalid; a cell that is neither is undecided
    unrepairable: tuple[Unrepairable, ...] = ()  # only if quality() was asked to diagnose


@dataclass(frozen=True)
class Unrepairable:
    """Elements that stay invalid wherever the free nodes go."""

    elements: tuple[int, ...]
    vertex: int | None  # node number
    sentence: str


@dataclass(frozen=True)
class RepairStep:
    """A step taken, or not taken, about unrepairable elements: split-edge, split-face, straightened, left, swapped or
    collapsed."""

    kind: str
    elements: tuple[int, ...]
    new_elements: tuple[int, ...]
    node: int | None  # the new vertex
    sentence: str


@dataclass(frozen=True)
class Remedy:
    """Something to try about elements that are not certified valid."""

    # optimise, more-time, until-valid, raise-order, split, slide or other-boundary; unspecified from an older server
    kind: str
    arguments: dict[str, Any]  # of optimise(), which do it; empty if no argument does
    elements: int  # how many it could help
    sentence: str


@dataclass(frozen=True)
class WhatIsLeft:
    """The elements that are not certified valid, in figures. An element of an unrepairable group that is certified
    counts nowhere."""

    uncertified: int
    proved: int  # of these, proved to be beyond repair by movement of nodes
    unproved: int  # of these, in an unrepairable group, but without a proof about this element
    remedies: tuple[Remedy, ...]  # what to try next, the likeliest first
    sentence: str  # the figures in words; empty if nothing is left


@dataclass(frozen=True)
class SlideTrial:
    """Another way to slide than the first of a job. The result of the job is the best mesh."""

    slide: str  # none or coupled
    outcome: str  # running, taken, no-better, failed or stopped
    left_before: int  # elements of the best mesh before that are not certified valid
    min_scaled_jacobian_before: float
    left: int  # the same of the mesh of the trial, if it is taken or no better
    min_scaled_jacobian: float
    error: str  # if it failed: why


@dataclass(frozen=True, repr=False)
class Metrics:
    """The result of a job in figures."""

    elements: int
    nodes: int
    free_nodes: int
    energy: str
    method: str
    iterations: int
    seconds: float
    residual: float
    converged: bool
    stop_reason: str
    before: Quality
    after: Quality
    unrepairable: tuple[Unrepairable, ...]
    repairs: tuple[RepairStep, ...]
    left: WhatIsLeft
    kept_as_it_came: str  # why a mesh that came in valid was left as it was; empty if it was not
    substitute_targets: tuple[int, ...]  # elements whose straight-sided shape could not be their target; at most 1000
    notes: tuple[str, ...]  # which elements came numbered clockwise, and why nothing was moved; mostly empty
    objective: str  # that of the run, never auto
    geometry: GeometryReport | None = None  # only if the job has a CAD model; `before` is then the mesh that has slid
    slide_trials: tuple[SlideTrial, ...] = ()  # the other ways to slide that were tried, in order
    layers: LayersReport | None = None  # only if thick cells were split into layers, whose quality is `after` then
    device: str = ""  # on which steps of Newton's method were made; empty: the processor

    def __repr__(self) -> str:
        return f"<metrics of {counted(self.elements, 'element')}: {self.stop_reason}; before {self.before}, after {self.after}>"

    @property
    def remedies(self) -> tuple[str, ...]:
        """What to try next about elements that are not certified valid, in sentences."""
        return tuple(one.sentence for one in self.left.remedies)


@dataclass(frozen=True)
class ServerInfo:
    """The server's version, its limits and what it accepts."""

    version: str
    threads: int
    max_mesh_bytes: int
    max_pending_jobs: int
    input_formats: tuple[str, ...]
    output_formats: tuple[str, ...]
    energies: tuple[str, ...]
    pending_jobs: int
    running_jobs: int
    takes_geometries: bool  #: whether boundary nodes may slide on CAD models in jobs of this server
    takes_layers: bool  #: whether jobs of this server split thick cells into layers
    keeps_orders: bool  #: whether jobs of this server write elements at their own orders again
    device: str  #: the graphics card that jobs may have there; empty: none, unless the operator has given jobs devices
    devices: int = 0  #: how many of these devices there are
    busy_devices: int = 0  #: how many of them a job has now
    jobs_on_devices: int = 0  #: how many jobs have one now

    def check(self, *, geometry: bool = False, layers: bool = False, keep_orders: bool = False) -> None:
        """Raises BadOption if a job asks for what the server does not know. An old server would leave it out without a word."""
        if geometry and not self.takes_geometries:
            raise BadOption("This server takes no geometries: it has no OpenCASCADE, runs jobs in its own process, or is too "
                            "old for them. Use another one, or let 'varimesh optimise --geometry' slide the nodes.")  # fmt: skip
        if layers and not self.takes_layers:
            raise BadOption("This server is too old for layers. Use another one, or split the result with 'varimesh layers'.")
        if keep_orders and not self.keeps_orders:
            raise BadOption("This server is too old for keep_orders. Use another one, or 'varimesh optimise --keep-orders'.")


def state_name(number: int) -> str:
    return spelled(job_pb2.JobState.DESCRIPTOR, number)


#: The formats that have the ending of their files for themselves.
FORMAT_OF_ENDING = {".vtu": "vtu", ".mesh": "mfem", ".xml": "nektar", ".su2": "su2", ".h5": "hopr",
                    ".cgns": "cgns", ".pyfrm": "pyfr"}


def format_name(number: int) -> str:
    return spelled(mesh_pb2.MeshFormat.DESCRIPTOR, number)


def quality_of(message: quality_pb2.QualityReport, numbering: Numbering = OF_FILES) -> Quality:
    certified = message.certified
    return Quality(
        message.min_scaled_jacobian, message.mean_scaled_jacobian, message.min_distortion_jacobian,
        message.invalid_elements, np.array(message.histogram, dtype=np.int64),
        Certified(certified.valid, certified.invalid, certified.undecided, certified.min_scaled_jacobian_lower_bound),
        np.array(numbering.numbers(one.number for one in certified.uncertified), dtype=np.int64),
        Accuracy(message.accuracy.loss, np.array(message.accuracy.modal_parts, dtype=np.float64))
        if message.HasField("accuracy") else None,
        message.clockwise_elements, np.array(numbering.numbers(message.clockwise), dtype=np.int64),
        LayerError(message.in_layers.error, message.in_layers.cells) if message.HasField("in_layers") else None)  # fmt: skip


def cell_quality_of(report: Quality, parts: bytes, numbering: Numbering,
                    unrepairable: tuple[Unrepairable, ...] = ()) -> CellQuality:  # fmt: skip
    """The report, with the arrays of MESH_FORMAT_CELL_QUALITY."""
    lists: dict[int, list[NDArray[Any]]] = {1: [], 2: [], 3: []}
    for message in wire.messages(memoryview(parts)):
        for _, part in wire.fields(message):
            assert isinstance(part, memoryview)
            for key, packed in wire.fields(part):
                assert isinstance(packed, memoryview)
                lists[key].append(np.frombuffer(bytes(packed), "<f8") if key == 2 else wire.unpack(bytes(packed)))
    found, scaled, answers = (np.concatenate(lists[key]) if lists[key] else np.zeros(0) for key in (1, 2, 3))
    of_file: Any = found.tolist()
    numbers = np.array(numbering.numbers(of_file), dtype=np.int64)
    return CellQuality(**{name: getattr(report, name) for name in Quality.__dataclass_fields__}, number=numbers,
                       scaled_jacobian=scaled, valid=answers == mesh_pb2.CELL_ANSWER_VALID,
                       invalid=answers == mesh_pb2.CELL_ANSWER_INVALID, unrepairable=unrepairable)  # fmt: skip


def remedy_of(message: quality_pb2.Remedy, numbering: Numbering) -> Remedy:
    """A remedy in the words of this package. An older server names no kind, and its sentence stays."""
    arguments: dict[str, dict[str, Any]] = {
        "until-valid": {"until": "valid"},
        "raise-order": {"order": message.order},
        "split": {"repair": "split"},
        "slide": {"geometry": Geometry(slide_on="boundary")},
    }
    what_to_do = {
        "optimise": "Try optimise()",
        "more-time": "Give the run more time",
        "until-valid": 'Try until="valid"',
        "raise-order": f"Try order={message.order}",
        "split": 'Try repair="split"',
        "slide": "Let boundary nodes slide on the CAD model (geometry=FILE) or on the boundary as it came "
                 '(geometry=varimesh.Geometry(slide_on="boundary"))',
        "other-boundary": "Mesh the boundary anew or refine it",
    }  # fmt: skip
    kind = spelled(quality_pb2.Remedy.Kind.DESCRIPTOR, message.kind)
    sentence = f"{what_to_do[kind]}: {message.reason}" if kind in what_to_do else message.sentence
    return Remedy(kind, arguments.get(kind, {}), message.elements, numbering.sentence(sentence))


def left_of(message: quality_pb2.WhatIsLeft, numbering: Numbering) -> WhatIsLeft:
    remedies = tuple(remedy_of(one, numbering) for one in message.remedies)
    return WhatIsLeft(message.uncertified, message.proved, message.unproved, remedies, numbering.sentence(message.sentence))


def slide_trial_of(message: optimise_pb2.SlideTrial) -> SlideTrial:
    return SlideTrial(spelled(optimise_pb2.SlideTrial.Slide.DESCRIPTOR, message.slide),
                      spelled(optimise_pb2.SlideTrial.Outcome.DESCRIPTOR, message.outcome), message.left_before,
                      message.min_scaled_jacobian_before, message.left, message.min_scaled_jacobian, message.error)  # fmt: skip


def metrics_of(message: optimise_pb2.Metrics, numbering: Numbering = OF_FILES) -> Metrics:
    return Metrics(
        message.mesh.elements, message.mesh.nodes, message.mesh.free_nodes,
        spelled(optimise_pb2.Energy.DESCRIPTOR, message.energy), spelled(optimise_pb2.Method.DESCRIPTOR, message.method),
        message.iterations, message.seconds, message.residual, message.converged,
        spelled(optimise_pb2.StopReason.DESCRIPTOR, message.stop_reason),
        quality_of(message.before, numbering), quality_of(message.after, numbering),
        tuple(Unrepairable(numbering.numbers(one.elements), numbering.number_or_none(one.vertex),
                           numbering.sentence(one.sentence)) for one in message.unrepairable),
        tuple(RepairStep(spelled(optimise_pb2.RepairStep.Kind.DESCRIPTOR, one.kind), numbering.numbers(one.elements),
                         numbering.numbers(one.new_elements), numbering.number_or_none(one.node),
                         numbering.sentence(one.sentence)) for one in message.repairs),
        left_of(message.left, numbering),
        numbering.sentence(message.kept_as_it_came), numbering.numbers(message.substitute_targets.elements),
        tuple(numbering.sentence(note) for note in message.notes),
        spelled(optimise_pb2.Objective.DESCRIPTOR, message.objective),
        geometry_report_of(message.geometry, numbering) if message.HasField("geometry") else None,
        tuple(slide_trial_of(one) for one in message.slide_trials),
        layers_report_of(message.layers, quality_of(message.layers.thick, numbering))
        if message.HasField("layers") else None, message.device)  # fmt: skip


def info_of(message: service_pb2.GetServerInfoResponse) -> ServerInfo:
    limits = message.limits
    return ServerInfo(
        message.version, limits.threads, limits.max_mesh_bytes, limits.max_pending_jobs,
        tuple(format_name(one) for one in message.input_formats),
        tuple(format_name(one) for one in message.output_formats),
        tuple(spelled(optimise_pb2.Energy.DESCRIPTOR, one) for one in message.energies),
        message.pending_jobs, message.running_jobs, message.takes_geometries,
        message.takes_layers, message.keeps_orders, message.device, message.devices, message.busy_devices,
        message.jobs_on_devices)  # fmt: skip
