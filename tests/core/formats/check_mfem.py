#!/usr/bin/python3
"""check_mfem.py FILE VOLUME AREA: reads an MFEM mesh with nodes in an H1 space, and compares two integrals with exact values.

This reader shares nothing with VariMesh's. It numbers edges and faces as mfem.org describes it ("Mesh formats",
"Finite elements"), finds the nodes on each face of each element, and integrates over the faces: x . n / 3, which adds up to
the elements' volumes, and 1 over the boundary elements, which is the boundary's area. peers_test.cpp runs it.
"""
import sys

import numpy as np

EDGES = {
    4: [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)],
    5: [(0, 1), (1, 2), (3, 2), (0, 3), (4, 5), (5, 6), (7, 6), (4, 7), (0, 4), (1, 5), (2, 6), (3, 7)],
    6: [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)],
    7: [(0, 1), (1, 2), (3, 2), (0, 3), (0, 4), (1, 4), (2, 4), (3, 4)],
}
FACES = {
    4: [(1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1)],
    5: [(3, 2, 1, 0), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (4, 5, 6, 7)],
    6: [(0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)],
    7: [(3, 2, 1, 0), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)],
}
VERTICES = {2: 3, 3: 4, 4: 4, 5: 8, 6: 6, 7: 5}


def inner(corners, p):
    """The number of nodes inside a face."""
    return (p - 1) * (p - 2) // 2 if corners == 3 else (p - 1) ** 2


def lobatto(p):
    """The Gauss-Lobatto points on [0, 1]."""
    derivative = np.polynomial.legendre.Legendre.basis(p).deriv()
    return np.concatenate([[0.0], np.sort((1 + derivative.roots()) / 2) if p > 1 else [], [1.0]])


class Mesh:
    def __init__(self, path):
        words = [line.split("#")[0].split() for line in open(path)]
        words = iter([word for line in words for word in line])

        def find(word):
            while next(words) != word:
                pass

        def elements():
            found = []
            for _ in range(int(next(words))):
                next(words)
                geometry = int(next(words))
                found.append((geometry, [int(next(words)) for _ in range(VERTICES[geometry])]))
            return found

        find("dimension")
        assert next(words) == "3"
        find("elements")
        self.elements = elements()
        find("boundary")
        self.boundary = elements()
        find("vertices")
        self.vertices = int(next(words))
        find("FiniteElementCollection:")
        name = next(words)
        assert name.startswith("H1_3D_P"), name
        self.order = int(name[7:])
        find("Ordering:")
        assert next(words) == "1"
        numbers = [word for word in words if word != "mfem_mesh_end"]
        self.x = np.array(numbers, dtype=float).reshape(-1, 3)
        self.number()

    def number(self):
        self.edge, self.face, self.rules = {}, {}, {}
        for geometry, v in self.elements:
            for a, b in EDGES[geometry]:
                self.edge.setdefault(frozenset((v[a], v[b])), len(self.edge))
        first, p = self.vertices + len(self.edge) * (self.order - 1), self.order
        for geometry, v in self.elements:
            for face in FACES[geometry]:
                corners = [v[i] for i in face]
                if frozenset(corners) not in self.face:
                    self.face[frozenset(corners)] = (corners, first)
                    first += inner(len(corners), p)
        inside = {4: (p - 1) * (p - 2) * (p - 3) // 6, 5: (p - 1) ** 3, 6: (p - 1) * inner(3, p), 7: (p - 1) ** 3}
        total = first + sum(inside[geometry] for geometry, _ in self.elements)
        assert total == len(self.x), f"{len(self.x)} nodes, not {total}"

    def face_nodes(self, corners):
        """The points of a face by weights at its corners: {lattice position along the two directions: coordinates}."""
        p, n = self.order, len(corners)
        sides = [(corners[i], corners[(i + 1) % n]) for i in range(n)]
        if n == 3:
            place = {corners[0]: (0, 0), corners[1]: (p, 0), corners[2]: (0, p)}
        else:
            place = {corners[0]: (0, 0), corners[1]: (p, 0), corners[2]: (p, p), corners[3]: (0, p)}

        def between(a, b, i):
            return tuple(s + (t - s) // p * i for s, t in zip(place[a], place[b]))

        nodes = {place[c]: self.x[c] for c in corners}
        for a, b in sides:
            low, high = min(a, b), max(a, b)
            base = self.vertices + self.edge[frozenset((a, b))] * (p - 1)
            for i in range(1, p):
                nodes[between(low, high, i)] = self.x[base + i - 1]
        own, node = self.face[frozenset(corners)]
        for j in range(1, p):
            for i in range(1, p - j if n == 3 else p):
                u, w = between(own[0], own[1], i), between(own[0], own[-1], j)
                o = place[own[0]]
                nodes[(u[0] + w[0] - o[0], u[1] + w[1] - o[1])] = self.x[node]
                node += 1
        return nodes

    def rule(self, places, corners):
        """Weights, and matrices that give values and both derivatives at the points of a rule from those at `places`."""
        p, c, key = self.order, lobatto(self.order), (corners, tuple(places))
        if key not in self.rules:
            triangle = corners == 3
            powers = [(a, b) for a in range(p + 1) for b in range(p + 1 - a if triangle else p + 1)]
            sums = [c[i] + c[j] + c[p - i - j] if triangle else 1.0 for i, j in places]
            at = np.array([(c[i] / s, c[j] / s) for (i, j), s in zip(places, sums)])
            points, weights = np.polynomial.legendre.leggauss(2 * p + 6)
            s, t = (x.ravel() for x in np.meshgrid((1 + points) / 2, (1 + points) / 2))
            w = np.outer(weights / 2, weights / 2).ravel()
            u, w = (s * (1 - t), w * (1 - t)) if triangle else (s, w)
            basis = [np.polynomial.legendre.Legendre.basis(a, domain=[0, 1]) for a in range(p + 1)]
            slope = [each.deriv() for each in basis]

            def table(f, g, x, y):
                return np.array([f[a](x) * g[b](y) for a, b in powers]).T

            to_modes = np.linalg.inv(table(basis, basis, at[:, 0], at[:, 1]))
            self.rules[key] = (w, *(table(f, g, u, t) @ to_modes
                                    for f, g in ((basis, basis), (slope, basis), (basis, slope))))  # fmt: skip
        return self.rules[key]

    def integrals(self, corners):
        """Integrals of x . n / 3 and of 1 over a face."""
        nodes = sorted(self.face_nodes(corners).items())
        w, value, along_u, along_v = self.rule([place for place, _ in nodes], len(corners))
        x = np.array([point for _, point in nodes])
        normal = np.cross(along_u @ x, along_v @ x)
        return w @ np.sum((value @ x) * normal, axis=1) / 3, w @ np.linalg.norm(normal, axis=1)


mesh = Mesh(sys.argv[1])
volumes = [sum(mesh.integrals([v[i] for i in face])[0] for face in FACES[g]) for g, v in mesh.elements]
area = sum(mesh.integrals(v)[1] for _, v in mesh.boundary)
print(f"volume {sum(volumes):.15g}, smallest {min(volumes):.3g}, area {area:.15g}")
if len(sys.argv) > 2:
    assert min(volumes) > 0
    for found, wanted in ((sum(volumes), float(sys.argv[2])), (area, float(sys.argv[3]))):
        assert abs(found - wanted) < 1e-9 * wanted, f"{found}, not {wanted}"
