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
MOST_FACTORED = 60_000  # unknowns; a factor of a larger matrix in 3-D takes many GB
PRISMS = {90: 3, 91: 4, 106: 5, 107: 6}  # Gmsh's numbers of the prisms that it has no functions for, and their orders
RESIDUAL = 1e-11  # of conjugate gradients, relative to the right side: far below every error of the tables
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
        if kind in PRISMS:
            self.shape, self.dimension, order = "prism", 3, PRISMS[kind]
            reference, points, self.weights, self.values, gradients = tables_of_prisms(order)
        else:
            name, self.dimension, order, count, reference, _ = gmsh.model.mesh.getElementProperties(kind)
            self.shape = name.split()[0].lower()
            reference = np.reshape(reference, (count, self.dimension))
            points, self.weights = gmsh.model.mesh.getIntegrationPoints(kind, f"Gauss{2 * order + 6}")
            values = gmsh.model.mesh.getBasisFunctions(kind, points, "Lagrange")[1]
            gradients = gmsh.model.mesh.getBasisFunctions(kind, points, "GradLagrange")[1]
            self.values = np.reshape(values, (-1, count))
            gradients = np.reshape(gradients, (-1, count, 3))[:, :, : self.dimension]
        count = len(reference)
        self.nodes = nodes.reshape(-1, count)
        self.linear = linear_functions(self.shape.capitalize(), reference)
        self.slopes = gradients.transpose(0, 2, 1).reshape(-1, count)  # (points × reference directions) × nodes
        self.facets = [np.flatnonzero(np.abs(reference @ np.array(normal) - offset) < 1e-9)
                       for normal, offset in FACETS[self.shape]]

    def chunks(self, x):
        """(nodes, points, matrices ∂ξ_j/∂x_i at [j][i], weights) of a few cells at a time."""
        d = self.dimension
        for begin in range(0, len(self.nodes), CELLS_AT_ONCE):
            nodes = self.nodes[begin : begin + CELLS_AT_ONCE]
            jacobians = np.matmul(self.slopes, x[nodes]).reshape(len(nodes), len(self.weights), d, d)  # [j][i] = ∂x_i/∂ξ_j
            cofactors, determinants = cofactors_of(jacobians)
            yield nodes, self.values @ x[nodes], cofactors / determinants[..., None, None], np.abs(determinants) * self.weights


def tables_of_prisms(order):
    """Reference nodes, points of quadrature, weights, and functions and gradients there, for prisms of order 3 or more: Gmsh
    4.8 makes them, but has no functions for them. The nodes are those of a straight prism that Gmsh makes."""
    here, mesh = gmsh.model.getCurrent(), gmsh.model.mesh
    gmsh.model.add("one prism")
    corners = [gmsh.model.geo.addPoint(x, y, -1) for x, y in ((0, 0), (1, 0), (0, 1))]
    lines = [gmsh.model.geo.addLine(a, b) for a, b in zip(corners, corners[1:] + corners[:1])]
    gmsh.model.geo.extrude([(2, gmsh.model.geo.addPlaneSurface([gmsh.model.geo.addCurveLoop(lines)]))], 0, 0, 2, [1], [], True)
    gmsh.model.geo.synchronize()
    gmsh.option.setNumber("Mesh.ElementOrder", order)
    mesh.generate(3)
    tags, coordinates, _ = mesh.getNodes()
    place = dict(zip(tags, coordinates.reshape(-1, 3)))
    kind = {order: kind for kind, order in PRISMS.items()}[order]
    x = np.array([place[tag] for tag in mesh.getElementsByType(kind)[1][: (order + 1) ** 2 * (order + 2) // 2]])
    gmsh.model.remove()
    gmsh.model.setCurrent(here)
    frame = np.stack([x[1] - x[0], x[2] - x[0], (x[3] - x[0]) / 2])
    reference = (x - x[0]) @ np.linalg.inv(frame) - (0, 0, 1)
    degree = f"Gauss{2 * order + 6}"
    flat, of_flat = mesh.getIntegrationPoints(mesh.getElementType("Triangle", 1), degree)
    along, of_along = mesh.getIntegrationPoints(mesh.getElementType("Line", 1), degree)
    points = np.array([(a, b, c) for a, b in flat.reshape(-1, 3)[:, :2] for c in along.reshape(-1, 3)[:, 0]])
    powers = np.array([(i, j, k) for i in range(order + 1) for j in range(order + 1 - i) for k in range(order + 1)])

    def monomials(at, exponents):
        return (at[:, None, :] ** np.maximum(exponents, 0)).prod(axis=2)

    of_nodes = np.linalg.inv(monomials(reference, powers))
    slopes = [(monomials(points, powers - np.eye(3, dtype=int)[k]) * powers[:, k]) @ of_nodes for k in range(3)]
    return reference, points, np.outer(of_flat, of_along).ravel(), monomials(points, powers) @ of_nodes, np.stack(slopes, axis=2)


def linear_functions(family, points):
    """Points × vertices: the functions of order 1 on a reference cell. The vertices are its first nodes."""
    kind = gmsh.model.mesh.getElementType({"Quadrilateral": "Quadrangle"}.get(family, family), 1)
    at = np.zeros((len(points), 3))
    at[:, : points.shape[1]] = points
    return np.reshape(gmsh.model.mesh.getBasisFunctions(kind, at.ravel(), "Lagrange")[1], (len(points), -1))


def cofactors_of(matrices):
    """The cofactors and determinants of many 1 × 1, 2 × 2 or 3 × 3 matrices; the transposed inverse is their quotient."""
    if matrices.shape[-1] == 1:
        return np.ones_like(matrices), matrices[..., 0, 0]
    if matrices.shape[-1] == 2:
        a, b, c, d = (matrices[..., i, j] for i in range(2) for j in range(2))
        return np.stack([d, -c, -b, a], axis=-1).reshape(matrices.shape), a * d - b * c
    a, b, c = (matrices[..., i, :] for i in range(3))
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=-2)
    return cofactors, (a * cofactors[..., 0, :]).sum(axis=-1)


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
        """A sparse matrix; of_chunk(cells, inverses, weights) gives the matrices of the cells."""
        rows, columns, numbers = [], [], []
        for cells in self.sets:
            count = cells.nodes.shape[1]
            for nodes, _, inverses, weights in cells.chunks(self.x):
                numbers.append(of_chunk(cells, inverses, weights).ravel())
                rows.append(np.repeat(nodes, count, axis=1).ravel().astype(np.int32))
                columns.append(np.tile(nodes, (1, count)).ravel().astype(np.int32))
        size = (len(self.x),) * 2
        return scipy.sparse.coo_matrix((np.concatenate(numbers), (np.concatenate(rows), np.concatenate(columns))), size).tocsr()

    def stiffness(self):
        def of_chunk(cells, inverses, weights):
            slopes = cells.slopes.reshape(len(cells.weights), cells.dimension, -1)
            metric = (weights[..., None, None] * inverses) @ inverses.transpose(0, 1, 3, 2)  # weights may be negative
            return np.matmul(cells.slopes.T, np.matmul(metric, slopes).reshape(len(weights), *cells.slopes.shape))
        return self.assemble(of_chunk)

    def masses(self):
        return self.assemble(lambda cells, _, weights: (cells.values.T * weights[:, None]) @ cells.values)

    def solver(self):
        inside = self.matrix[self.free][:, self.free]
        if len(self.free) <= MOST_FACTORED or self.dimension == 2:
            return direct_solver(inside)
        return iterative_solver(inside, self.from_vertices())

    def from_vertices(self):
        """Free nodes × free vertices: the functions of order 1 at the nodes."""
        spread = scipy.sparse.lil_matrix((len(self.x), len(self.x)))
        for cells in self.sets:
            for node, values in enumerate(cells.linear):
                for vertex in np.flatnonzero(np.abs(values) > 1e-12):
                    spread[cells.nodes[:, node], cells.nodes[:, vertex]] = values[vertex]
        vertices = np.unique(np.concatenate([cells.nodes[:, : cells.linear.shape[1]].ravel() for cells in self.sets]))
        return spread.tocsr()[self.free][:, np.setdiff1d(vertices, self.fixed)]

    def spectrum(self):
        """The largest eigenvalue of the wave operator M⁻¹K, and the condition number of K with fixed boundary values.

        K is the stiffness matrix and M the mass matrix. Explicit central differences are stable for time steps up to
        2/√(largest eigenvalue)."""
        start = np.sin(np.arange(len(self.x)) + 1.0)
        largest = largest_eigenvalue(self.matrix, self.masses(), start)
        inside = self.matrix[self.free][:, self.free].tocsc()
        smallest = scipy.sparse.linalg.eigsh(inside, 1, sigma=0.0, v0=start[: len(self.free)], tol=1e-6,
                                             return_eigenvectors=False)[0]
        return largest, largest_eigenvalue(inside, None, start[: len(self.free)]) / smallest

    def errors(self, solution="waves"):
        """The root mean squares of the errors of all solutions, in L2 and in the seminorm of H1."""
        solutions = Waves(self.dimension, self.volume) if solution == "waves" else Single(self.dimension, solution)
        return np.sqrt(self.squared_errors(solutions).mean(axis=1))

    def squared_errors(self, solutions):
        """2 × solutions: the squares of the errors of each solution in L2 and in the seminorm of H1."""
        found = solutions.values(self.x)
        right = np.zeros_like(found)
        for cells in self.sets:
            for nodes, points, _, weights in cells.chunks(self.x):
                source = solutions.sources(points.reshape(-1, self.dimension)).reshape(*points.shape[:2], -1)
                np.add.at(right, nodes, cells.values.T @ (weights[..., None] * source))
        right -= self.matrix[:, self.fixed] @ found[self.fixed]
        found[self.free] = self.solver()(right[self.free])
        squares = np.zeros((2, found.shape[1]))
        for cells in self.sets:
            for nodes, points, inverses, weights in cells.chunks(self.x):
                at, shape = points.reshape(-1, self.dimension), points.shape[:2]
                values = cells.values @ found[nodes]
                squares[0] += np.einsum("cq,cqs->s", weights, (values - solutions.values(at).reshape(*shape, -1)) ** 2)
                slopes = np.matmul(cells.slopes, found[nodes]).reshape(*shape, self.dimension, -1)
                slopes = np.matmul(inverses.transpose(0, 1, 3, 2), slopes)
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


class Single:
    """One product of functions of x, y and z. smooth: sin 2x cos 3y/2, in 3-D times exp z. product: sin 2x cos y cos 2z, in
    2-D sin 2x cos 2y."""

    def __init__(self, dimension, name):
        self.dimension, self.grows = dimension, name == "smooth"
        self.k = np.array([2, 1.5, 1] if self.grows else [2, 1, 2] if dimension == 3 else [2, 2])[:dimension]

    def factors(self, x):
        """The function of each coordinate, and its derivative."""
        k, at = self.k, x * self.k
        values, slopes = np.cos(at), -k * np.sin(at)
        values[:, 0], slopes[:, 0] = np.sin(at[:, 0]), k[0] * np.cos(at[:, 0])
        if self.grows and self.dimension == 3:
            values[:, 2] = slopes[:, 2] = np.exp(x[:, 2])
        return values, slopes

    def values(self, x):
        return self.factors(x)[0].prod(axis=1)[:, None]

    def gradients(self, x):
        values, slopes = self.factors(x)
        others = [np.delete(values, axis, axis=1).prod(axis=1) for axis in range(self.dimension)]
        return np.stack([slopes[:, axis] * others[axis] for axis in range(self.dimension)], axis=1)[:, :, None]

    def sources(self, x):
        """−Δu."""
        signs = np.where(self.grows & (np.arange(self.dimension) == 2), -1, 1)
        return (signs * self.k**2).sum() * self.values(x)


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


def iterative_solver(matrix, from_vertices):
    """The same by conjugate gradients for all columns at once. The preconditioner is the diagonal and, added to it, the
    problem of order 1 on the vertices."""
    to_vertices = from_vertices.T.tocsr()
    coarse = scipy.sparse.linalg.splu((to_vertices @ matrix @ from_vertices).tocsc())
    inverse = 1 / matrix.diagonal()[:, None]

    def precondition(r):
        return inverse * r + from_vertices @ coarse.solve(to_vertices @ r)

    def solve(columns):
        found, r = np.zeros_like(columns), columns.copy()
        z = precondition(r)
        p, product = z.copy(), (r * z).sum(axis=0)
        end = RESIDUAL * np.linalg.norm(columns, axis=0)
        while (np.linalg.norm(r, axis=0) > end).any():
            image = matrix @ p
            step = product / (p * image).sum(axis=0)
            found += step * p
            r -= step * image
            z = precondition(r)
            before, product = product, (r * z).sum(axis=0)
            p = z + product / before * p
        return found
    return solve


def largest_eigenvalue(matrix, masses, start):
    return scipy.sparse.linalg.eigsh(matrix.tocsc(), 1, None if masses is None else masses.tocsc(), which="LM", v0=start,
                                     tol=1e-6, return_eigenvectors=False)[0]


def errors(path, solution="waves"):
    return Plain(path).errors(solution)
