"""The options of a job, with the names of the contract, and what came of layers and of the CAD model."""
from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, Literal, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from .errors import BadOption
from .names import spellings, suggestion
from .numbering import Numbering
from .v1 import job_pb2, optimise_pb2

if TYPE_CHECKING:
    from .reports import Quality


@dataclass(frozen=True)
class TargetField:
    """Sizes, metrics or strains for target="size" and target="strain". `values` has one row for each cell, or vertex, in
    the mesh's order, or for each of `numbers`. A row is one number or a symmetric tensor: xx xy yy (xz yz zz)."""

    values: ArrayLike
    per: Literal["cell", "vertex"] = "cell"
    numbers: ArrayLike | None = None


@dataclass(frozen=True)
class Geometry:
    """What boundary nodes slide on: the CAD model in a STEP, IGES or BREP file, or, with slide_on="boundary" and without a
    file, the mesh's own curved boundary. docs/geometry.md describes the flags of the command, which have the same names."""

    file: str | os.PathLike[str] | None = None
    slide: Literal["none", "surfaces", "all", "coupled", "auto"] = "auto"
    snap: bool = False
    smooth_angle: float = 0.0
    tolerance: float = 0.0  #: that of --geometry-tolerance, only with slide="coupled"
    slide_on: Literal["model", "boundary"] = "model"
    growth: float = 1.5  #: with repair="refine": most elements of the mesh, divided by their number in the input
    order: int = 0  #: if set, the mesh is of order 1, and is first curved with this order, as by 'varimesh curve'

    def to_message(self) -> job_pb2.Geometry:
        """The message without the digest of the file. BadOption names a value that does not exist."""
        message = job_pb2.Geometry()
        for field in fields(self):
            if field.name != "file":
                _set(message, field.name, getattr(self, field.name))
        return message


@dataclass(frozen=True)
class Layers:
    """Thin layers into which thick cells above walls are split once the mesh is optimised. docs/layers.md describes the flags of
    the command, which have the same names. Give two of `layers`, `first` and `growth`, or all three, or `heights`."""

    walls: str | Iterable[str]  #: groups of boundary elements, by name or by tag
    layers: int = 0
    first: float = 0.0  #: height of the layer at the wall, in the mesh's unit of length
    growth: float = 0.0  #: height of each layer divided by the height of the layer below it
    heights: Iterable[float] = ()
    rows: int = 1
    spacing: Literal["even", "graded"] = "graded"
    grow: float = 0.0  #: first grow a row of thick cells of this thickness on the walls
    simplices: bool = False

    def to_message(self) -> job_pb2.Layers:
        """BadOption names a value that does not exist."""
        message = job_pb2.Layers()
        for field in fields(self):
            _set(message, field.name, getattr(self, field.name))
        return message


@dataclass(frozen=True)
class LayersReport:
    """What came of the layers of a job. Pairs are the smallest and the largest value; heights are in the mesh's unit of length."""

    wall_elements: int
    columns: int  # edges that rise from the wall
    layers: int  # in each column, not counting a cell that remains above them
    leaves_cells: bool  # whether a part of each thick cell remains above the layers, as one more cell
    split: int  # cells that were split
    split_beside: int  # of these, cells beside the wall, split so that the mesh conforms
    elements_before: int
    elements_after: int
    first_height: tuple[float, float]
    last_height: tuple[float, float]
    growth: tuple[float, float]
    same_shares: bool  # layers have the same share of each edge: with the same heights, elements would have been invalid
    stretched: float  # by how much of its height a layer differs from what was wanted, with several rows
    thick: Quality  # the quality of the mesh before it was split
    grown: tuple[float, float] | None  # the thickness of the row of cells that was grown; None: none was
    full_share: float  # the share of the walls' area with the thickness that was asked for


def layers_report_of(message: optimise_pb2.LayersReport, thick: Quality) -> LayersReport:
    values: dict[str, Any] = {name: getattr(message, name) for name in LayersReport.__dataclass_fields__}
    for name in ("first_height", "last_height", "growth", "grown"):
        values[name] = (values[name].least, values[name].most)
    values["grown"] = values["grown"] if message.HasField("grown") else None
    values["thick"] = thick
    return LayersReport(**values)


class Options(TypedDict, total=False):
    """docs/options.md describes the options and their defaults."""

    energy: Literal["hyperelastic", "linear-elastic", "winslow", "distortion"]
    strain: Literal["green-lagrange", "small"]
    volumetric: Literal["log", "trace"]
    winslow: Literal["true", "paper"]
    constants: Literal["standard", "reference"]
    mu: float
    lambda_: float  # `lambda` is a keyword of Python
    kappa: float
    regularisation: Literal["element", "patch"]
    method: Literal["auto", "sweeps", "newton"]
    colouring: Literal["group", "node"]
    tolerance: float
    max_iterations: int
    threads: int
    device: Literal["cpu", "gpu", "auto"]
    quadrature_degree: int
    target: Literal["straight-sided", "ideal", "size", "strain"]
    target_field: TargetField
    fix: Iterable[str]
    free: Iterable[str]
    fix_nodes: Iterable[int]
    free_nodes: Iterable[int]
    region_below: float
    rings: int
    objective: Literal["energy", "worst", "accuracy", "auto"]
    min_js: float
    layer_spacing: Literal["keep", "even", "graded"]
    p_norm: float
    order: int
    active_set: bool
    until: Literal["tolerance", "valid"]
    until_js: float
    time_limit: float
    orient: bool
    repair: Literal["none", "report", "split", "straighten", "refine", "topology"]


def _set_target_field(message: Any, field: object) -> None:
    if not isinstance(field, TargetField):
        field = TargetField(field)  # type: ignore[arg-type]
    values = np.asarray(field.values, dtype=np.float64)
    if values.ndim not in (1, 2):
        raise BadOption(f"The target field has {values.ndim} dimensions; give one row for each cell or vertex.")
    message.per = optimise_pb2.PER_VERTEX if field.per == "vertex" else optimise_pb2.PER_CELL
    message.components = 1 if values.ndim == 1 else values.shape[1]
    message.values.extend(values.ravel().tolist())
    if field.numbers is not None:
        message.numbers.extend(np.asarray(field.numbers, dtype=np.int64).ravel().tolist())


def _as_list(value: Any) -> list[Any]:
    return [value] if isinstance(value, (str, int)) else [item.item() if hasattr(item, "item") else item for item in value]


_NUMBERED = ("fix_nodes", "free_nodes")


def numbered_from_one(options: Mapping[str, Any]) -> dict[str, Any]:
    """The options for a mesh in arrays, whose elements and nodes the caller numbers from 0 and the server from 1."""
    shifted = dict(options)
    for name in _NUMBERED:
        if shifted.get(name) is not None:
            shifted[name] = [number + 1 for number in _as_list(shifted[name])]
    field = shifted.get("target_field")
    if isinstance(field, TargetField) and field.numbers is not None:
        shifted["target_field"] = replace(field, numbers=np.asarray(field.numbers, dtype=np.int64) + 1)
    return shifted


def _set(message: Any, name: str, value: Any) -> None:
    """Sets the field of an option. BadOption names an option or a value that does not exist."""
    known_fields = message.DESCRIPTOR.fields_by_name
    field = known_fields.get(name.removesuffix("_"))
    if field is None:
        raise BadOption(f"There is no option '{name}'; {suggestion(name, known_fields)}")
    if value is None:
        return
    try:
        if field.enum_type is not None:
            known = spellings(field.enum_type)
            if value not in known:
                raise BadOption(f"{name} cannot be {value!r}; {suggestion(str(value), known)}")
            setattr(message, field.name, known[value])
        elif field.message_type is not None:
            _set_target_field(message.target_field, value)
        elif field.label == field.LABEL_REPEATED:
            getattr(message, field.name).extend(_as_list(value))
        else:
            setattr(message, field.name, value.item() if hasattr(value, "item") else value)
    except (TypeError, ValueError) as error:
        if isinstance(error, BadOption):
            raise
        raise BadOption(f"{name} cannot be {value!r} ({error}).") from None


def to_message(options: Mapping[str, Any]) -> optimise_pb2.Options:
    """The options as a message. None means the default. BadOption names an option or a value that does not exist."""
    message = optimise_pb2.Options()
    for name, value in options.items():
        _set(message, name, value)
    return message


@dataclass(frozen=True)
class SurfaceDistance:
    """A surface of the CAD model, and how far the boundary elements that were made on it lie from it."""

    surface: int  # its number in the model, from 1
    name: str  # in the STEP or IGES file; empty: it has none
    tags: tuple[int, ...]  # of the mesh's surfaces that matched it
    elements: int
    folded_before: int  # elements that are folded over
    folded_after: int
    largest_before: float  # nan if the job curved the mesh
    largest_after: float
    rms_before: float
    rms_after: float


@dataclass(frozen=True)
class GeometryReport:
    """What came of the CAD model of a job. Lengths are in the mesh's unit."""

    nodes: int  # that slid
    farthest: float  # how far a node slid at most
    folded_before: int  # boundary elements that are folded over
    folded_after: int
    largest_before: float  # distance between the curved boundary and the model; nan if sliding was cut short
    largest_after: float
    rms_before: float
    rms_after: float
    sentences: tuple[str, ...]  # what matched and what moved
    surfaces: tuple[SurfaceDistance, ...] = ()  # the largest distance afterwards first; at most 1000
    straight_elements: int = 0  # if the mesh was curved: boundary elements that stay straight, since their place is not sure


def distances_of(message: optimise_pb2.SurfaceDistance | optimise_pb2.GeometryReport) -> tuple[float, float, float, float]:
    """The largest distances before and after, and the rms of both."""
    before, after = (
        (one.largest, one.rms) if message.HasField(name) else (math.nan, math.nan)
        for name, one in (("before", message.before), ("after", message.after)))  # fmt: skip
    return before[0], after[0], before[1], after[1]


def surface_distance_of(message: optimise_pb2.SurfaceDistance) -> SurfaceDistance:
    return SurfaceDistance(message.surface, message.name, tuple(message.tags), message.elements, message.folded_before,
                           message.folded_after, *distances_of(message))  # fmt: skip


def geometry_report_of(message: optimise_pb2.GeometryReport, numbering: Numbering) -> GeometryReport:
    return GeometryReport(
        message.nodes, message.farthest, message.folded_before, message.folded_after, *distances_of(message),
        tuple(numbering.sentence(one) for one in message.sentences),
        tuple(surface_distance_of(one) for one in message.surfaces), message.straight_elements)  # fmt: skip
