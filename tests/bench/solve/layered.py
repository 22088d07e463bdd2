"""Layer meshes at curved walls, and solutions that vary with the distance from the wall.

The heights of the layers are in geometric progression. The boundary is exact, and no program takes part in making the meshes
but this one."""
import gmsh
import numpy as np
import plain
from scipy.special import erf

# By the letter of a shape: the vertices of its cells in the box (i, j, k), as offsets; i is around, j across, k along.
SPLITS = {
    "q": [[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]],
    "t": [[(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(1, 1, 0), (0, 1, 0), (1, 0, 0)]],
    "h": [[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]],
    "p": [[(0, 0, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0), (0, 1, 1), (1, 1, 0)],
          [(1, 0, 1), (1, 0, 0), (0, 0, 1), (1, 1, 1), (1, 1, 0), (0, 1, 1)]],
    "s": [[(0, 0, 0), *np.cumsum(np.eye(3, dtype=int)[list(turn)], axis=0)]
          for turn in ((0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2))],
}
NAMES = {"q": "Quadrangle", "t": "Triangle", "h": "Hexahedron", "p": "Prism", "s": "Tetrahedron"}
CORNERS = {"q": [(-1, -1), (1, -1), (1, 1), (-1, 1)]}
CORNERS["h"] = [(*ends, z) for z in (-1, 1) for ends in CORNERS["q"]]


class Ring:
    """Between the circles of radius 1 and 3; a quarter of it if not `whole`."""
    boxes, flat, top = (20, 1), True, 2.0

    def __init__(self, whole=True):
        self.whole = whole
        if not whole:
            self.boxes = (5, 1)

    def at(self, around, along, height):
        angle = 2 * np.pi * around / (1 if self.whole else 4)
        return (1 + height) * np.array([np.sin(angle), np.cos(angle), 0])

    def distance(self, x):
        """n, its gradient and its Laplacian at points: the distance from the wall."""
        r = np.linalg.norm(x[:, :2], axis=1)[:, None]
        normal = np.zeros_like(x)
        normal[:, :2] = x[:, :2] / r
        return r - 1, normal, 1 / r

    def is_fixed(self, around, along):
        """Whether nodes of this column are on a part of the boundary that no node leaves."""
        return False


class Pipe(Ring):
    """A quarter of a pipe; its ends are planes."""
    boxes, flat = (5, 2), False

    def __init__(self):
        super().__init__(whole=False)
        self.boxes = (5, 2)

    def at(self, around, along, height):
        return super().at(around, along, height) + [0, 0, 0.6 * along]

    def is_fixed(self, around, along):
        return along in (0, 1)


class Curve:
    """A wall that is a curve w(t) with the normal to the left of −w′, from t = 0 to 1."""
    flat, whole, top = True, False, 0.5
    boxes = (12, 1)

    def at(self, around, along, height):
        wall, slope, _ = self.curve(np.array([around]))
        normal = np.array([-slope[0, 1], slope[0, 0]]) / np.hypot(*slope[0])
        return np.array([*(wall[0] + height * normal), 0])

    def distance(self, x):
        at = np.linspace(0, 1, 400)
        t = at[((x[:, None, :2] - self.curve(at)[0]) ** 2).sum(axis=2).argmin(axis=1)]
        for _ in range(30):
            wall, slope, bend = self.curve(t)
            away = wall - x[:, :2]
            t = t - (away * slope).sum(axis=1) / ((slope**2).sum(axis=1) + (away * bend).sum(axis=1))
        wall, slope, bend = self.curve(t)
        speed = np.hypot(slope[:, 0], slope[:, 1])
        normal = np.stack([-slope[:, 1], slope[:, 0]], axis=1) / speed[:, None]
        n = ((x[:, :2] - wall) * normal).sum(axis=1)
        bending = -(bend * normal).sum(axis=1) / speed**2
        return n[:, None], normal, (bending / (1 + bending * n))[:, None]

    def is_fixed(self, around, along):
        return False


class Bump(Curve):
    """A plate with a bump of height .1, and layers up to .5."""

    def curve(self, t):
        x = 2 * t - 1
        y = 0.1 * np.exp(-((x / 0.35) ** 2))
        slope, bend = -2 * x / 0.35**2 * y, ((2 * x / 0.35**2) ** 2 - 2 / 0.35**2) * y
        return np.stack([x, y], 1), np.stack([2 + 0 * x, 2 * slope], 1), np.stack([0 * x, 4 * bend], 1)


class Ellipse(Curve):
    """Round an ellipse with the half axes 1 and .25, as blunt as the nose of an aerofoil, and layers up to .5."""
    whole, boxes = True, (32, 1)

    def curve(self, t):
        c, s = np.cos(-2 * np.pi * t), np.sin(-2 * np.pi * t)
        turn = 2 * np.pi
        return (np.stack([c, 0.25 * s], 1), turn * np.stack([s, -0.25 * c], 1), turn**2 * np.stack([-c, -0.25 * s], 1))


class Sphere:
    """Above a part of the unit sphere that four planes through its centre bound, up to the radius 2."""
    boxes, flat, whole, top = (4, 4), False, False, 1.0

    def at(self, around, along, height):
        way = np.array([np.tan(0.8 * (around - 0.5)), np.tan(0.8 * (along - 0.5)), 1])
        return (1 + height) * np.array([way[1], way[0], way[2]]) / np.linalg.norm(way)

    def distance(self, x):
        r = np.linalg.norm(x, axis=1)[:, None]
        return r - 1, x / r, 2 / r

    def is_fixed(self, around, along):
        return around in (0, 1) or along in (0, 1)


BODIES = {"ring": Ring(), "quarter": Ring(whole=False), "pipe": Pipe(), "bump": Bump(), "ellipse": Ellipse(), "sphere": Sphere()}


def heights(layers, ratio, top):
    """Distances of the levels from the wall. `ratio`: of the last layer's height to the first one's."""
    steps = ratio ** (np.arange(layers) / max(layers - 1, 1))
    return np.concatenate([[0], np.cumsum(steps)]) / steps.sum() * top


class Maker:
    """`inside`: exact (nodes on parallel surfaces, graded like the layers), equal (on parallel surfaces, equally spaced in each
    cell), wall (only the wall is curved) or best (as equal, but the boundary is that of wall, to which the last layer fades)."""

    def __init__(self, body, letter, order, layers, ratio, inside):
        self.body, self.order, self.inside = body, order, inside
        self.levels, self.growth = heights(layers, ratio, body.top), ratio ** (1 / max(layers - 1, 1))
        self.numbers, self.nodes, self.cells = {}, [], []
        self.kind = gmsh.model.mesh.getElementType(NAMES[letter], order)
        if self.kind in plain.PRISMS:
            points = plain.tables_of_prisms(order)[0]
        else:
            points = np.reshape(gmsh.model.mesh.getElementProperties(self.kind)[4], (-1, 2 if letter in "qt" else 3))
        for box in np.ndindex(body.boxes[0], layers, body.boxes[1]):
            for corners in SPLITS[letter]:
                self.cells.append([self.node(box, corners, letter, point) for point in points])

    def node(self, box, corners, letter, point):
        if letter in "ts":
            weights = np.array([1 - point.sum(), *point])
        elif letter == "p":
            weights = np.outer([(1 - point[2]) / 2, (1 + point[2]) / 2], [1 - point[0] - point[1], point[0], point[1]]).ravel()
        else:
            weights = np.prod((1 + np.array(CORNERS[letter]) * point) / 2, axis=1)
        at = np.rint(self.order * (weights @ (np.array(corners) + box))).astype(int)
        if self.body.whole:
            at[0] %= self.body.boxes[0] * self.order
        key = tuple(at)
        if key not in self.numbers:
            self.numbers[key] = len(self.nodes) + 1
            self.nodes.append(self.place(*at, letter))
        return self.numbers[key]

    def height(self, j):
        level = j / self.order
        below = min(int(level), len(self.levels) - 2)
        linear = self.levels[below] + (level - below) * (self.levels[below + 1] - self.levels[below])
        if self.inside != "exact" or self.growth <= 1 + 1e-9:
            return linear
        return (self.growth**level - 1) / (self.growth ** (len(self.levels) - 1) - 1) * self.body.top

    def place(self, i, j, k, letter):
        height, (around, along) = self.height(j), self.body.boxes
        i, k = i / self.order, k / self.order
        curved = self.body.at(i / around, k / along, height)
        if self.inside in ("exact", "equal") or j == 0 or self.body.is_fixed(i / around, k / along):
            return curved
        straight = sum(weight * self.body.at(a / around, b / along, height) for weight, a, b in blend(i, k, letter))
        share = 1 if self.inside == "wall" else max(0, j / self.order - (len(self.levels) - 2))
        return share * straight + (1 - share) * curved

    def walls(self, letter):
        """The elements of the wall, for shapes that have an opposite side: their kind in Gmsh and their nodes."""
        name = {"q": "Line", "h": "Quadrangle", "p": "Triangle"}[letter]
        kind = gmsh.model.mesh.getElementType(name, self.order)
        dimension = 1 if letter == "q" else 2
        points = np.reshape(gmsh.model.mesh.getElementProperties(kind)[4], (-1, dimension))
        weights = {"q": lambda s: [1 - s[0], s[0]], "p": lambda s: [1 - s[0] - s[1], s[0], s[1]],
                   "h": lambda s: np.prod((1 + np.array(CORNERS["q"]) * s) / 2, axis=1)}[letter]
        if letter != "p":
            points = (points + 1) / 2 if letter == "q" else points
        elements = []
        for box in np.ndindex(self.body.boxes[0], 1, self.body.boxes[1]):
            for corners in SPLITS[letter]:
                bottom = {"q": [0, 1], "h": [0, 1, 5, 4], "p": [0, 1, 2]}[letter]
                corners = np.array(corners)[bottom] + box
                nodes = []
                for point in points:
                    at = np.rint(self.order * (np.array(weights(point)) @ corners)).astype(int)
                    if self.body.whole:
                        at[0] %= self.body.boxes[0] * self.order
                    nodes.append(self.numbers[tuple(at)])
                elements.append(nodes)
        return kind, elements

    def write(self, path, walls=None):
        """`walls`: (kind, elements), which become the group 2, named "wall"."""
        kind, elements = walls or (0, [])
        with open(path, "w", encoding="ascii") as file:
            file.write("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n")
            if walls:
                dimension = 1 if self.body.flat else 2
                file.write(f'$PhysicalNames\n1\n{dimension} 2 "wall"\n$EndPhysicalNames\n')
            file.write(f"$Nodes\n{len(self.nodes)}\n")
            for number, x in enumerate(self.nodes, 1):
                file.write(f"{number} {x[0]:.17g} {x[1]:.17g} {x[2]:.17g}\n")
            file.write(f"$EndNodes\n$Elements\n{len(elements) + len(self.cells)}\n")
            for number, nodes in enumerate(elements, len(self.cells) + 1):
                file.write(f"{number} {kind} 2 2 2 {' '.join(map(str, nodes))}\n")
            for number, nodes in enumerate(self.cells, 1):
                file.write(f"{number} {self.kind} 2 1 1 {' '.join(map(str, nodes))}\n")
            file.write("$EndElements\n")


def blend(i, k, letter):
    """The columns between which a node lies, with weights: (weight, around, along). Boxes whose walls are triangles are cut
    along the diagonal that their cells have."""
    a, b = int(np.floor(i)), int(np.floor(k))
    s, t = i - a, k - b
    if letter in "hqt":
        corners = [((1 - s) * (1 - t), 0, 0), (s * (1 - t), 1, 0), ((1 - s) * t, 0, 1), (s * t, 1, 1)]
    elif letter == "p":
        corners = ([(1 - s - t, 0, 0), (s, 1, 0), (t, 0, 1)] if s + t <= 1
                   else [(s + t - 1, 1, 1), (1 - t, 1, 0), (1 - s, 0, 1)])
    else:
        corners = [(1 - max(s, t), 0, 0), (abs(s - t), int(s > t), int(t > s)), (min(s, t), 1, 1)]
    return [(weight, a + x, b + y) for weight, x, y in corners if weight > 0]


def make(path, body, letter, order, layers=8, ratio=1000.0, inside="equal"):
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    Maker(BODIES[body], letter, order, layers, ratio, inside).write(path)
    gmsh.finalize()


def make_thick(path, body, letter, order, layers=1):
    """The same with thick layers of equal height, and a group of wall elements."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    maker = Maker(BODIES[body], letter, order, layers, 1, "equal")
    maker.write(path, maker.walls(letter))
    gmsh.finalize()


class Layer:
    """u = f(n/δ) for several δ, plus .3 sin(1.6 e·x) if `wave`. n is the distance from the wall. f is exp(−s), tanh s or erf s,
    the last being close to the profile of Blasius."""

    def __init__(self, body, profile, deltas, wave=False):
        self.body, self.profile, self.deltas, self.wave = BODIES[body], profile, np.asarray(deltas, float), wave

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

    def waves(self, x):
        k = np.zeros(x.shape[1])
        k[:2] = 0.96, 1.28
        return k, (x @ k)[:, None]

    def values(self, x):
        value = self.profiles(self.body.distance(x)[0] / self.deltas)[0]
        return value + (0.3 * np.sin(self.waves(x)[1]) if self.wave else 0)

    def gradients(self, x):
        n, normal, _ = self.body.distance(x)
        result = (self.profiles(n / self.deltas)[1] / self.deltas)[:, None, :] * normal[:, :, None]
        if self.wave:
            k, phase = self.waves(x)
            result = result + 0.3 * (np.cos(phase) * k)[:, :, None]
        return result

    def sources(self, x):
        n, _, laplacian = self.body.distance(x)
        _, slope, bend = self.profiles(n / self.deltas)
        result = -(bend / self.deltas**2 + slope / self.deltas * laplacian)
        if self.wave:
            k, phase = self.waves(x)
            result = result + 0.3 * (k @ k) * np.sin(phase)
        return result


DELTAS = (0.3, 0.1, 0.03, 0.01)
# Profile, and whether a wave is added.
SOLUTIONS = {"exp": ("exp", False), "tanh": ("tanh", False), "erf": ("erf", False), "tanh + wave": ("tanh", True)}


def h1_errors(path, body):
    """By kind of solution, "waves" included: the H1 errors of a solver, for layers one for each of DELTAS."""
    mesh = plain.Plain(path)
    errors = {name: np.sqrt(mesh.squared_errors(Layer(body, profile, DELTAS, wave))[1])
              for name, (profile, wave) in SOLUTIONS.items()}
    errors["waves"] = np.sqrt(mesh.squared_errors(plain.Waves(mesh.dimension, mesh.volume))[1].mean(keepdims=True))
    return errors
