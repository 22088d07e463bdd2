"""Poisson's equation on a high-order mesh, solved by DOLFINx 0.5 (Debian's python3-dolfinx).

The elements are isoparametric, of the mesh's order, with Lagrange functions on the mesh's own nodes. The exact solutions are
plane waves sin(k n·x + φ) with k = 4 V^(-1/d), where V is the volume of the mesh: four directions n, and φ = 0 and π/2 for
each. One solution may by chance gain or lose by where nodes are; the root mean square over all of them does not. With
"smooth" there is one solution, sin 2x cos 3y/2, in 3-D times exp z; with "product" sin 2x cos y cos 2z, in 2-D sin 2x cos 2y.
"""
import logging

logging.disable(logging.INFO)  # FFCx logs each compilation

import basix
import basix.ufl_wrapper
import dolfinx.fem.petsc
import gmsh
import numpy as np
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI
from petsc4py import PETSc

WAVE_NUMBER = 4.0
SOLUTIONS = ("waves", "smooth", "product")
SHAPES = ("triangle", "quadrilateral", "tetrahedron", "hexahedron")


def read(path):
    """The cells of a mesh of one shape: its name, the order, reference nodes, cells × nodes, coordinates × dimension."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.open(str(path))
    dimension = gmsh.model.getDimension()
    types = gmsh.model.mesh.getElementTypes(dimension)
    if len(types) != 1:
        gmsh.finalize()
        raise NotRead(f"{path} has cells of {len(types)} shapes; DOLFINx 0.5 reads meshes of one shape")
    try:
        name, _, order, count, reference, _ = gmsh.model.mesh.getElementProperties(types[0])
    except Exception as missing:  # Gmsh has no functions for prisms of order 3 or more, and raises nothing more special
        gmsh.finalize()
        raise NotRead(f"{path} has cells that Gmsh has no functions for: {missing}") from missing
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    place = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    place[tags] = np.arange(len(tags))
    cells = place[gmsh.model.mesh.getElementsByType(types[0])[1]].reshape(-1, count)
    gmsh.finalize()
    shape = name.split()[0].lower()
    if shape not in SHAPES or (shape == "tetrahedron" and order > 3):
        raise NotRead(f"{path} has cells that DOLFINx 0.5 does not read: {name}; tetrahedra have order 3 at most")
    reference = reference.reshape(count, dimension)
    if shape in ("quadrilateral", "hexahedron"):
        reference = (reference + 1) / 2
    used, cells = np.unique(cells, return_inverse=True)
    return shape, order, reference, cells.reshape(-1, count), coordinates.reshape(-1, 3)[used, :dimension]


def build(path):
    """The DOLFINx mesh, and the space of functions on its nodes."""
    shape, order, reference, cells, coordinates = read(path)
    element = basix.create_element(basix.ElementFamily.P, getattr(basix.CellType, shape), order,
                                   basix.LagrangeVariant.equispaced)
    nodes = np.array([np.argmin(((reference - point) ** 2).sum(1)) for point in element.points])
    assert np.abs(reference[nodes] - element.points).max() < 1e-12
    domain = ufl.Mesh(ufl.VectorElement("Lagrange", shape, order, dim=coordinates.shape[1]))
    made = mesh.create_mesh(MPI.COMM_SELF, np.ascontiguousarray(cells[:, nodes]), np.ascontiguousarray(coordinates), domain)
    equispaced = basix.ufl_wrapper.create_element("P", shape, order, lagrange_variant=basix.LagrangeVariant.equispaced)
    return made, fem.FunctionSpace(made, equispaced), order


def single(name, d, at, of=np):
    """The solution "smooth" or "product" at points, by the functions of NumPy or UFL."""
    if name == "smooth":
        return of.sin(2 * at[0]) * of.cos(1.5 * at[1]) * (of.exp(at[2]) if d == 3 else 1)
    return of.sin(2 * at[0]) * (of.cos(at[1]) * of.cos(2 * at[2]) if d == 3 else of.cos(2 * at[1]))


def directions(dimension):
    if dimension == 2:
        return [np.array([np.cos(a), np.sin(a)]) for a in np.pi / 8 + np.pi / 4 * np.arange(4)]
    return [np.array(n) / np.sqrt(3) for n in ((1, 1, 1), (-1, 1, 1), (1, -1, 1), (1, 1, -1))]


def boundary_condition(made, space, value):
    d = made.topology.dim
    made.topology.create_connectivity(d - 1, d)
    facets = mesh.exterior_facet_indices(made.topology)
    return fem.dirichletbc(value, fem.locate_dofs_topological(space, d - 1, facets))


class NotRead(Exception):
    """DOLFINx 0.5 does not read such cells."""


def errors(path, solution="waves"):
    """The root mean squares of the errors of all solutions, in L2 and in the seminorm of H1. Raises NotRead."""
    made, space, order = build(path)
    d = made.topology.dim
    dx = ufl.Measure("dx", made, metadata={"quadrature_degree": 2 * order + 6})
    size = fem.assemble_scalar(fem.form(fem.Constant(made, 1.0) * dx)) ** (1 / d)
    x, u, v = ufl.SpatialCoordinate(made), ufl.TrialFunction(space), ufl.TestFunction(space)
    k, phase = fem.Constant(made, np.zeros(d)), fem.Constant(made, 0.0)
    if solution == "waves":
        exact, source = ufl.sin(ufl.dot(k, x) + phase), ufl.dot(k, k) * ufl.sin(ufl.dot(k, x) + phase)
        exact_gradient = k * ufl.cos(ufl.dot(k, x) + phase)
    else:
        exact = single(solution, d, x, ufl)
        exact_gradient, source = ufl.grad(exact), -ufl.div(ufl.grad(exact))
    on_boundary, found = fem.Function(space), fem.Function(space)
    condition = boundary_condition(made, space, on_boundary)
    left = fem.form(ufl.inner(ufl.grad(u), ufl.grad(v)) * dx)
    right = fem.form(source * v * dx)
    in_value = fem.form((found - exact) ** 2 * dx)
    in_gradient = fem.form(ufl.inner(ufl.grad(found) - exact_gradient, ufl.grad(found) - exact_gradient) * dx)
    matrix = fem.petsc.assemble_matrix(left, [condition])
    matrix.assemble()
    solver = PETSc.KSP().create(MPI.COMM_SELF)
    solver.setOperators(matrix)
    solver.setType("preonly")
    solver.getPC().setType("lu")
    solver.getPC().setFactorSolverType("mumps")
    sums = np.zeros(2)
    all_directions, phases = (directions(d), (0.0, np.pi / 2)) if solution == "waves" else ([np.zeros(d)], (0.0,))
    for direction in all_directions:
        for phase.value in phases:
            k.value[:] = WAVE_NUMBER / size * direction
            on_boundary.interpolate((lambda at: np.sin(k.value @ at[:d] + phase.value)) if solution == "waves"
                                    else lambda at: single(solution, d, at))
            vector = fem.petsc.assemble_vector(right)
            fem.petsc.apply_lifting(vector, [left], [[condition]])
            fem.petsc.set_bc(vector, [condition])
            solver.solve(vector, found.vector)
            sums += fem.assemble_scalar(in_value), fem.assemble_scalar(in_gradient)
    return np.sqrt(sums / (len(all_directions) * len(phases)))
