#!/usr/bin/python3
"""check.py MODEL MESH: whether a mesh fits the model of which it was made, by Gmsh and OpenCASCADE. Prints a JSON object:

measure   the volume (of faces alone, the area) of the mesh over that of the model, minus 1
area      the same for the area of all faces, those between bodies once
off       the largest distance of nodes on surfaces from the faces of the model, over its size
doubled   how many facets of cells lie on each other without being one
folded    how many cells have a Jacobian determinant that is not positive at a point of quadrature
"""
import json
import math
import sys
from collections import Counter

import gmsh
import numpy as np

NODES_OF_A_FACE = 60  # at most this number of a face's nodes is projected
CORNERS = {2: 3, 3: 4}  # of triangles and tetrahedra


def measured(dimension):
    """The measure of all elements of this dimension, and how many of them are folded."""
    total, folded = 0.0, 0
    for _, entity in gmsh.model.getEntities(dimension):
        for kind in gmsh.model.mesh.getElementTypes(dimension, entity):
            points, weights = gmsh.model.mesh.getIntegrationPoints(kind, "Gauss8")
            determinants = gmsh.model.mesh.getJacobians(kind, points, entity)[1].reshape(-1, len(weights))
            total += float((determinants @ weights).sum())
            folded += int((determinants.min(axis=1) <= 0).sum())
    return total, folded


def doubled_facets(dimension, places):
    """Outer facets with the same corners."""
    facets, corners = Counter(), CORNERS[dimension]
    for _, entity in gmsh.model.getEntities(dimension):
        for kind, _, nodes in zip(*gmsh.model.mesh.getElements(dimension, entity)):
            for cell in np.reshape(nodes, (-1, gmsh.model.mesh.getElementProperties(kind)[3]))[:, :corners]:
                for without in range(corners):
                    facets[tuple(sorted(int(node) for k, node in enumerate(cell) if k != without))] += 1
    outer = Counter(tuple(sorted(tuple(places[node]) for node in facet)) for facet, count in facets.items() if count == 1)
    return sum(count > 1 for count in outer.values())


def nodes_on_faces(places):
    """By tag of a surface, places of some of its nodes."""
    found = {}
    for _, surface in gmsh.model.getEntities(2):
        tags = np.unique(np.concatenate([np.zeros(0, dtype=int), *(nodes.astype(int) for nodes in gmsh.model.mesh.getElements(2, surface)[2])]))
        step = max(1, len(tags) // NODES_OF_A_FACE)
        found[surface] = np.array([places[int(tag)] for tag in tags[::step]])
    return found


def distance(points, surfaces):
    """The largest distance of points from the nearest of the surfaces."""
    feet = [gmsh.model.getClosestPoint(2, tag, points.ravel())[0].reshape(-1, 3) for tag in surfaces]
    return float(np.min([np.linalg.norm(foot - points, axis=1) for foot in feet], axis=0).max())


def main():
    model, mesh = sys.argv[1:]
    gmsh.initialize(["", "-v", "0"])
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.open(mesh)
    dimension = 3 if gmsh.model.getEntities(3) else 2
    tags, x, _ = gmsh.model.mesh.getNodes()
    places = dict(zip(map(int, tags), np.reshape(x, (-1, 3))))
    size = math.dist(np.min(list(places.values()), axis=0), np.max(list(places.values()), axis=0))
    rounded = {tag: np.round(place / size, 12) for tag, place in places.items()}
    (measure, folded), (area, _) = measured(dimension), measured(2)
    doubled, on_faces = doubled_facets(dimension, rounded), nodes_on_faces(places)

    gmsh.clear()
    occ = gmsh.model.occ
    occ.importShapes(model, highestDimOnly=False)
    occ.synchronize()
    sides = {tag for _, tag in gmsh.model.getBoundary(gmsh.model.getEntities(3), False, False)}
    pieces = gmsh.model.getEntities(3) + [face for face in gmsh.model.getEntities(2) if face[1] not in sides]
    if len(pieces) > 1:
        occ.fragment(pieces[:1], pieces[1:])
        occ.synchronize()
    faces = [tag for _, tag in gmsh.model.getEntities(2)]
    off = 0.0
    for tag, points in on_faces.items():
        own = distance(points, [tag]) if tag in faces else math.inf
        off = max(off, own if own < 1e-6 * size else min(own, distance(points, faces)))
    true_area = sum(occ.getMass(2, tag) for tag in faces)
    true_measure = sum(occ.getMass(3, tag) for _, tag in gmsh.model.getEntities(3)) if dimension == 3 else true_area
    print(json.dumps({"measure": measure / true_measure - 1, "area": area / true_area - 1, "off": off / size, "doubled": doubled,
                      "folded": folded}))


if __name__ == "__main__":
    main()
