"""How the page of --http reads the meshes of the server, with the page's own scripts in a headless Chromium.
ctest runs it with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in the environment."""
import base64
import http.client
import unittest

from with_page import SOURCE, WithPage

from programs import CASES, MESH

OWN = SOURCE / "server" / "http" / "page"


class Scenes(WithPage):
    """How the page reads meshes of the server and finds the nodes on the sides of cells."""

    def setUp(self):
        super().setUp()
        names = ("wire.js", "shapes.js", "mesh_cells.js", "scene_2d.js")
        self.page.value("\n".join((OWN / name).read_text() for name in names) + "; 1")

    def result(self, job, format):
        connection = http.client.HTTPConnection(self.http, timeout=20)
        self.addCleanup(connection.close)
        connection.request("GET", f"/v1/{job}/result?format={format}")
        return connection.getresponse().read()

    def test_cells_that_share_a_side_have_the_same_nodes_on_it(self):
        published = CASES / "published"
        for mesh in (MESH, CASES / "aerofoil_p4.msh", CASES / "sphere_p3.msh", published / "palace__cylinder_hex.msh",
                     published / "palace__cylinder_prism.msh", published / "nektar__cube_tet_p6_v40_parametric.msh"):
            job = "jobs/" + self.submit(mesh, "--output-format", "parts", "--output-format", "cell-quality", "--max-iterations", "0")
            self.wait(job.removeprefix("jobs/"), "JOB_STATE_SUCCEEDED")
            parts, quality = (base64.b64encode(self.result(job, f"MESH_FORMAT_{one}")).decode() for one in ("PARTS", "CELL_QUALITY"))
            shared, wrong = self.page.value(f"""(() => {{
                const bytes = (text) => Uint8Array.from(atob(text), (one) => one.charCodeAt(0));
                const cells = new MeshCells(readMesh(bytes('{parts}')), readQuality(bytes('{quality}')));
                const {{first, opposite}} = joinSides(cells);
                const nodes = [];
                for (let cell = 0; cell < cells.count; ++cell)
                  for (const side of sideNodes(cells.shapes[cell], cells.mesh.order))
                    nodes.push(side.map((local) => cells.node(cell, local)).sort((a, b) => a - b).join());
                const pairs = [...opposite.keys()].filter((side) => opposite[side] >= 0);
                return [pairs.length, pairs.filter((side) => nodes[side] !== nodes[opposite[side]]).length];
              }})()""")
            self.assertGreater(shared, 0, mesh.name)
            self.assertEqual(wrong, 0, mesh.name)

    def test_lattices_have_all_nodes(self):
        for shape, counts in ((3, (3, 6, 10, 15, 21)), (4, (4, 9, 16, 25, 36)), (5, (4, 10, 20, 35, 56)), (6, (5, 14, 30, 55, 91)),
                              (7, (6, 18, 40, 75, 126)), (8, (8, 27, 64, 125, 216))):
            for order, count in enumerate(counts, 1):
                self.assertEqual(self.page.value(f"new Set(latticeOf({shape}, {order}).map(String)).size"), count, (shape, order))
                self.assertTrue(self.page.value(f"sideNodes({shape}, {order}).flat().every((node) => node >= 0)"), (shape, order))

    def test_weights_reproduce_polynomials_of_the_order(self):
        for corners, power in ((3, "(x + y / 2) ** order"), (4, "(x * y + x / 2) ** order")):
            worst = self.page.value(f"""Math.max(...[1, 2, 3, 4].map((order) => {{
                const points = (steps) => {{
                  const all = [];
                  for (let j = 0; j <= steps; ++j) for (let i = 0; i <= ({corners} === 3 ? steps - j : steps); ++i) all.push([i / steps, j / steps]);
                  return all;
                }};
                const f = ([x, y]) => (1 + x) ** order - 2 * {power};
                const [nodes, fine] = [points(order).map(f), points(7).map(f)];
                return Math.max(...faceWeights({corners}, order, 7).map((row, k) => Math.abs(row.reduce((sum, w, i) => sum + w * nodes[i], 0) - fine[k])));
              }}))""")
            self.assertLess(worst, 1e-11, corners)


if __name__ == "__main__":
    unittest.main()
