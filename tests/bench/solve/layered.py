"""Layer meshes on a ring, a quarter of it and a pipe, and solutions that vary with the distance from their inner wall.

The inner wall is the circle or cylinder of radius 1, and the outer one has radius 3. The heights of the layers are in
geometric progression. The boundary is exact, and no program takes part in making the meshes but this one."""
import gmsh
import numpy as np
from scipy.special import erf

INNER, OUTER = 1.0, 3.0
AROUND = {"ring": 20, "quarter": 5, "pipe": 5}  # cells along the wall
ALONG = 2  # of the pipe
# By the letter of a shape: the vertices of its cells in the box (i, j, k), as offsets; i is around, j across, k along.
SPLITS = {
    "q": [[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]],
    "t": [[(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(1, 1, 0), (0, 1, 0), (1, 0, 0)]],
    "h": [[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]],
}
NAMES = {"q": "Quadrangle", "t": "Triangle", "h": "Hexahedron"}


def heights(layers, ratio):
    """Distances of the levels from the wall. `ratio`: of the last layer's height to the first one's."""
    steps = ratio ** (np.arange(layers) / max(layers - 1, 1))
    return np.concatenate([[0], np.cumsum(steps)]) / steps.sum() * (OUTER - INNER)


class Maker:
    """`inside`: exact (nodes on circles, graded like the layers), equal (on circles, equally spaced in each cell) or wall
    (only the inner wall is curved)."""

    def __init__(self, body, letter, order, layers, ratio, inside):
        self.body, self.order, self.inside, self.around = body, order, inside, AROUND[body]
        self.levels, self.growth = heights(layers, ratio), ratio ** (1 / max(layers - 1, 1))
        self.numbers, self.nodes, self.cells = {}, [], []
        kind = gmsh.model.mesh.getElementType(NAMES[letter], order)
        points = np.reshape(gmsh.model.mesh.getElementProperties(kind)[4], (-1, 2 if letter in "qt" else 3))
        self.kind = kind
        for box in np.ndindex(self.around, layers, ALONG if body == "pipe" else 1):
            for corners in SPLITS[letter]:
                self.cells.append([self.node(box, corners, letter, point) for point in points])

    def node(self, box, corners, letter, point):
        if letter == "t":
            weights = np.array([1 - point.sum(), *point])
        else:
            ends = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
            ends = ends if letter == "q" else [(*e, z) for z in (-1, 1) for e in ends]
            weights = np.prod((1 + np.array(ends) * point) / 2, axis=1)
        at = np.rint(self.order * (weights @ (np.array(corners) + box))).astype(int)
        if self.body == "ring":
            at[0] %= self.around * self.order
        key = tuple(at)
        if key not in self.numbers:
            self.numbers[key] = len(self.nodes) + 1
            self.nodes.append(self.place(*at))
        return self.numbers[key]

    def place(self, i, j, k):
        level, z = j / self.order, 0.3 * k / self.order
        below = min(int(level), len(self.levels) - 2)
        linear = self.levels[below] + (level - below) * (self.levels[below + 1] - self.levels[below])
        graded = (self.growth**level - 1) / (self.growth ** (len(self.levels) - 1) - 1) * (OUTER - INNER)
        height = graded if self.inside == "exact" and self.growth > 1 + 1e-9 else linear

        def on_circle(around):
            angle = 2 * np.pi * around / self.around / (1 if self.body == "ring" else 4)
            return (INNER + height) * np.array([np.sin(angle), np.cos(angle), 0]) + [0, 0, z]
        end = self.body == "pipe" and k in (0, ALONG * self.order)  # a plane whose nodes are fixed
        if self.inside != "wall" or j == 0 or end:
            return on_circle(i / self.order)
        cell, part = divmod(i / self.order, 1)
        return (1 - part) * on_circle(cell) + part * on_circle(cell + 1)

    def write(self, path):
        with open(path, "w", encoding="ascii") as file:
            file.write(f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{len(self.nodes)}\n")
            for number, x in enumerate(self.nodes, 1):
                file.write(f"{number} {x[0]:.17g} {x[1]:.17g} {x[2]:.17g}\n")
            file.write(f"$EndNodes\n$Elements\n{len(self.cells)}\n")
            for number, nodes in enumerate(self.cells, 1):
                file.write(f"{number} {self.kind} 2 1 1 {' '.join(map(str, nodes))}\n")
            file.write("$EndElements\n")


def make(path, body, letter, order, layers=8, ratio=1000.0, inside="equal"):
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    Maker(body, letter, order, layers, ratio, inside).write(path)
    gmsh.finalize()


class Layer:
    """u = f((r − 1)/δ) for several δ, plus .3 sin(1.6 n·x) if `wave`. f is exp(−s), tanh s or erf s, the last being close to
    the profile of Blasius."""

    def __init__(self, profile, deltas, wave=False):
        self.profile, self.deltas, self.wave = profile, np.asarray(deltas, float), wave

    def profiles(self, s):
        """f, f′ and f″."""
        if self.profile == "exp":
            value = np.exp(-s)
            return value, -value, value
        if self.profile == "tanh":
            value = np.tanh(s)
            return value, 1 - value**2, -2 * value * (1 - value**2)
        slope = 2 / np.sqrt(np.pi) * np.exp(-(s**2))
        return erf(s), slope, -2 * s * slope

    def parts(self, x):
        r = np.linalg.norm(x[:, :2], axis=1)[:, None]
        return r, self.profiles((r - INNER) / self.deltas)

    def waves(self, x):
        k = np.zeros(x.shape[1])
        k[:2] = 0.96, 1.28
        return k, (x @ k)[:, None]

    def values(self, x):
        return self.parts(x)[1][0] + (0.3 * np.sin(self.waves(x)[1]) if self.wave else 0)

    def gradients(self, x):
        r, (_, slope, _) = self.parts(x)
        outward = np.zeros_like(x)
        outward[:, :2] = x[:, :2] / r
        result = (slope / self.deltas)[:, None, :] * outward[:, :, None]
        if self.wave:
            k, phase = self.waves(x)
            result = result + 0.3 * (np.cos(phase) * k)[:, :, None]
        return result

    def sources(self, x):
        r, (_, slope, bend) = self.parts(x)
        result = -(bend / self.deltas**2 + slope / self.deltas / r)
        if self.wave:
            k, phase = self.waves(x)
            result = result + 0.3 * (k @ k) * np.sin(phase)
        return result
