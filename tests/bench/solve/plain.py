"""Poisson's equation on a high-order mesh of any shapes and orders, solved with Gmsh's own basis functions.

The same equation, elements, solutions and errors as poisson.py, which needs DOLFINx and does not read quartic tetrahedra,
prisms, pyramids or meshes of several shapes. On meshes that both read, `solve --check` compares the two: the errors agree to
eight digits, on tetrahedra of order 3 with a scaled Jacobian of .2 to four, because the rules of quadrature differ."""
import gmsh
import numpy as np
import scipy.sparse
import scipy.sparse.linalg

WAVE_NUMBER = 4.0
CELLS_AT_ONCE = 64
# The facets of a reference cell in Gmsh's coordinates: the points with normal · ξ = offset.
FACETS = {
    "line": [((1,), -1), ((1,), 1)],
    "triangle": [((1, 0), 0), ((0, 1), 0), ((1, 1), 1)],
    "quadrilateral": [((1, 0), -1), ((1, 0), 1), ((0, 1), -1), ((0, 1), 1)],
    "tetrahedron": [((1, 0, 0), 0), ((0, 1, 0), 0), ((0, 0, 1), 0), ((1, 1, 1), 1)],
    "hexahedron": [(tuple(int(i == k) for i in range(3)), side) for k in range(3) for side in (-1, 1)],
    "prism": [((1, 0, 0), 0), ((0, 1, 0), 0), ((1, 1, 0), 1), ((0, 0, 1), -1), ((0, 0, 1), 1)],
    "pyramid": [((0, 0, 1), 0), ((1, 0, 1), 1), ((-1, 0, 1), 1), ((0, 1, 1), 1), ((0, -1, 1), 1)],
}


class Cells:
    """The cells of one shape: nodes, and basis functions and gradients at the points of quadrature."""

    def __init__(self, kind, nodes):
        name, self.dimension, order, count, reference, _ = gmsh.model.mesh.getElementProperties(kind)
        self.shape = name.split()[0].lower()
        self.nodes = nodes.reshape(-1, count)
        points, self.weights = gmsh.model.mesh.getIntegrationPoints(kind, f"Gauss{2 * order + 6}")
        values = gmsh.model.mesh.getBasisFunctions(kind, points, "Lagrange")[1]
        gradients = gmsh.model.mesh.getBasisFunctions(kind, points, "GradLagrange")[1]
        self.values = np.reshape(values, (-1, count))
        self.gradients = np.reshape(gradients, (-1, count, 3))[:, :, : self.dimension]
        reference = np.reshape(reference, (count, self.dimension))
        self.facets = [np.flatnonzero(np.abs(reference @ np.array(normal) - offset) < 1e-9)
                       for normal, offset in FACETS[self.shape]]

    def chunks(self, x):
        """(cells, points, gradients of the basis functions, weights) of a few cells at a time."""
        for begin in range(0, len(self.nodes), CELLS_AT_ONCE):
            nodes = self.nodes[begin : begin + CELLS_AT_ONCE]
            jacobians = np.einsum("cni,qnj->cqij", x[nodes], self.gradients, optimize=True)
            gradients = np.matmul(self.gradients[None], np.linalg.inv(jacobians))  # cells × points × nodes × d
            yield nodes, self.values @ x[nodes], gradients, np.abs(np.linalg.det(jacobians)) * self.weights


class Plain:
    """A mesh, its stiffness matrix and which nodes lie on the boundary."""

    def __init__(self, path):
        gmsh.initialize()
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(str(path))
        self.dimension = gmsh.model.getDimension()
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        place = np.zeros(int(tags.max()) + 1, dtype=np.int64)
        place[tags] = np.arange(len(tags))
        self.sets = [Cells(kind, place[gmsh.model.mesh.getElementsByType(kind)[1]])
                     for kind in gmsh.model.mesh.getElementTypes(self.dimension)]
        gmsh.finalize()
        used = np.unique(np.concatenate([cells.nodes.ravel() for cells in self.sets]))
        for cells in self.sets:
            cells.nodes = np.searchsorted(used, cells.nodes)
        self.x = coordinates.reshape(-1, 3)[used, : self.dimension]
        self.volume = sum(weights.sum() for cells in self.sets for *_, weights in cells.chunks(self.x))
        self.fixed = self.boundary()
        self.free = np.setdiff1d(np.arange(len(self.x)), self.fixed)
        self.matrix = self.stiffness()

    def boundary(self):
        """Nodes on facets that one cell has."""
        seen = {}
        for cells in self.sets:
            for facet in cells.facets:
                for nodes in np.sort(cells.nodes[:, facet], axis=1):
                    seen[nodes.tobytes()] = None if nodes.tobytes() in seen else nodes
        return np.unique(np.concatenate([nodes for nodes in seen.values() if nodes is not None]))

    def assemble(self, of_chunk):
        """A sparse matrix; of_chunk(values, gradients, weights) gives the matrices of the cells."""
        rows, columns, numbers = [], [], []
        for cells in self.sets:
            count = cells.nodes.shape[1]
            for nodes, _, gradients, weights in cells.chunks(self.x):
                numbers.append(of_chunk(cells.values, gradients, weights).ravel())
                rows.append(np.repeat(nodes, count, axis=1).ravel().astype(np.int32))
                columns.append(np.tile(nodes, (1, count)).ravel().astype(np.int32))
        size = (len(self.x),) * 2
        return scipy.sparse.coo_matrix((np.concatenate(numbers), (np.concatenate(rows), np.concatenate(columns))), size).tocsr()

    def stiffness(self):
        def of_chunk(_, gradients, weights):
            cells, points, nodes, d = gradients.shape
            flat = gradients.transpose(0, 2, 1, 3).reshape(cells, nodes, points * d)
            return (flat * np.repeat(weights, d, axis=1)[:, None]) @ flat.transpose(0, 2, 1)  # weights may be negative
        return self.assemble(of_chunk)

    def masses(self):
        return self.assemble(lambda values, _, weights: np.einsum("cq,qn,qm->cnm", weights, values, values, optimize=True))

    def solver(self):
        return direct_solver(self.matrix[self.free][:, self.free])

    def errors(self, solution="waves"):
        """The root mean squares of the errors of all solutions, in L2 and in the seminorm of H1."""
        solutions = Smooth(self.dimension) if solution == "smooth" else Waves(self.dimension, self.volume)
        return np.sqrt(self.squared_errors(solutions).mean(axis=1))

    def squared_errors(self, solutions):
        """2 × solutions: the squares of the errors of each solution in L2 and in the seminorm of H1."""
        found = solutions.values(self.x)
        right = np.zeros_like(found)
        for cells in self.sets:
            for nodes, points, _, weights in cells.chunks(self.x):
                source = solutions.sources(points.reshape(-1, self.dimension)).reshape(*points.shape[:2], -1)
                part = np.einsum("cq,qn,cqs->cns", weights, cells.values, source, optimize=True)
                np.add.at(right, nodes, part)
        right -= self.matrix[:, self.fixed] @ found[self.fixed]
        found[self.free] = self.solver()(right[self.free])
        squares = np.zeros((2, found.shape[1]))
        for cells in self.sets:
            for nodes, points, gradients, weights in cells.chunks(self.x):
                at, shape = points.reshape(-1, self.dimension), points.shape[:2]
                values = np.einsum("qn,cns->cqs", cells.values, found[nodes], optimize=True)
                squares[0] += np.einsum("cq,cqs->s", weights, (values - solutions.values(at).reshape(*shape, -1)) ** 2)
                slopes = np.einsum("cqnd,cns->cqds", gradients, found[nodes], optimize=True)
                exact = solutions.gradients(at).reshape(*shape, self.dimension, -1)
                squares[1] += np.einsum("cq,cqds->s", weights, (slopes - exact) ** 2)
        return squares


class Waves:
    """The eight plane waves sin(k n·x + φ) of poisson.py."""

    def __init__(self, dimension, volume):
        if dimension == 2:
            angles = np.pi / 8 + np.pi / 4 * np.arange(4)
            directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        else:
            directions = np.array([(1, 1, 1), (-1, 1, 1), (1, -1, 1), (1, 1, -1)]) / np.sqrt(3)
        self.k = WAVE_NUMBER / volume ** (1 / dimension) * np.repeat(directions, 2, axis=0)
        self.phases = np.tile([0.0, np.pi / 2], 4)

    def values(self, x):
        return np.sin(x @ self.k.T + self.phases)

    def gradients(self, x):
        """Points × d × solutions."""
        return np.cos(x @ self.k.T + self.phases)[:, None, :] * self.k.T[None]

    def sources(self, x):
        """−Δu."""
        return (self.k**2).sum(axis=1) * self.values(x)


class Smooth:
    """sin 2x cos 3y/2, in 3-D times exp z."""

    def __init__(self, dimension):
        self.dimension = dimension

    def parts(self, x):
        a, b = 2 * x[:, 0], 1.5 * x[:, 1]
        return np.sin(a), np.cos(a), np.cos(b), np.sin(b), np.exp(x[:, 2]) if self.dimension == 3 else np.ones(len(x))

    def values(self, x):
        sine, _, cosine, _, growth = self.parts(x)
        return (sine * cosine * growth)[:, None]

    def gradients(self, x):
        sine, slope, cosine, other, growth = self.parts(x)
        of_axes = [2 * slope * cosine * growth, -1.5 * sine * other * growth, sine * cosine * growth]
        return np.stack(of_axes[: self.dimension], axis=1)[:, :, None]

    def sources(self, x):
        """−Δu."""
        return (4 + 2.25 - (self.dimension == 3)) * self.values(x)


def direct_solver(matrix):
    """A function that solves with a symmetric positive definite matrix: MUMPS if PETSc is installed, or else SciPy."""
    try:
        from petsc4py import PETSc
    except ImportError:
        factor = scipy.sparse.linalg.splu(matrix.tocsc())
        return factor.solve
    wrapped = PETSc.Mat().createAIJ(matrix.shape, csr=(matrix.indptr, matrix.indices, matrix.data))
    wrapped.setOption(PETSc.Mat.Option.SPD, True)
    krylov = PETSc.KSP().create()
    krylov.setOperators(wrapped)
    krylov.setType("preonly")
    krylov.getPC().setType("cholesky")
    krylov.getPC().setFactorSolverType("mumps")
    right, found = wrapped.createVecs()

    def solve(columns):
        result = np.empty_like(columns)
        for column in range(columns.shape[1]):
            right.setArray(columns[:, column])
            krylov.solve(right, found)
            result[:, column] = found.getArray()
        return result
    return solve


def errors(path, solution="waves"):
    return Plain(path).errors(solution)
