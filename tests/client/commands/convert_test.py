"""varimesh convert: a mesh is the same in another format."""
import json
import unittest

from programs import MESH, WithFolder, WithServer, clockwise, run


LEFT_OUT = "varimesh: MFEM's format has no place for the numbers of nodes and elements; the file leaves them out.\n"


def two_orders(middle):
    """A triangle of order 2 beside one of order 1; `middle` is the middle of the side between them."""
    return ("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n7\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 1 1 0\n"
            f"5 0.5 0 0\n6 {middle} 0\n7 0 0.5 0\n$EndNodes\n$Elements\n2\n1 9 2 1 1 1 2 3 5 6 7\n"
            "2 2 2 1 1 2 4 3\n$EndElements\n")  # fmt: skip


class Convert(WithFolder):
    def test_changes_the_format_and_nothing_else(self):
        binary, back = self.folder / "binary.msh", self.folder / "back.msh"
        self.assertEqual(run("convert", MESH, binary, "--format", "msh41-binary").returncode, 0)
        self.assertTrue(binary.read_bytes().startswith(b"$MeshFormat\n4.1 1 8"))
        self.assertEqual(run("convert", binary, back, "--format", "msh22").returncode, 0)
        one, other = (json.loads(run("quality", path, "--json").stdout) for path in (MESH, back))
        self.assertEqual(one, other)

    def test_to_other_formats_and_back_keeps_the_quality_and_says_what_is_left_out(self):
        for name, start, left_out in (
            ("there.mesh", b"MFEM mesh v1.", LEFT_OUT),
            ("there.xml", b'<?xml version="1.0" encoding="utf-8" ?>\n<NEKTAR>', LEFT_OUT.replace("MFEM", "Nektar++")),
            ("there.vtu", b'<?xml version="1.0"?>\n<VTKFile', ""),
        ):
            there, back = self.folder / name, self.folder / "back.msh"
            done = run("convert", MESH, there)
            self.assertEqual((done.returncode, done.stderr), (0, left_out))
            self.assertTrue(there.read_bytes().startswith(start))
            self.assertEqual(run("convert", there, back, "--format", "msh22").returncode, 0)
            one, other = (json.loads(run("quality", path, "--json").stdout)["quality"] for path in (MESH, back))
            for key in ("valid", "invalid", "undecided"):
                self.assertEqual(one["certified"][key], other["certified"][key])
            self.assertAlmostEqual(one["min_scaled_jacobian"], other["min_scaled_jacobian"], 12)

    def test_for_su2_the_curved_sides_are_left_out(self):
        out = self.folder / "out.su2"
        done = run("convert", MESH, out)
        self.assertEqual(done.returncode, 0)
        self.assertIn("curved sides", done.stderr)
        self.assertTrue(out.read_text().startswith("NDIME= 2\nNELEM= 9\n"))

    def test_turns_clockwise_elements_if_asked_to(self):
        mirrored, out = self.folder / "mirrored.msh", self.folder / "out.msh"
        mirrored.write_text(clockwise(MESH, (8, 12)))
        for flags, expected in (([], mirrored), (["--orient"], MESH)):
            self.assertEqual(run("convert", mirrored, out, *flags).returncode, 0)
            self.assertEqual(out.read_text(), expected.read_text())
        mirrored.write_text(mirrored.read_text().replace("\n1 0 0 0\n", "\n1 nan 0 0\n"))
        done = run("convert", mirrored, out, "--orient")
        self.assertEqual(done.returncode, 3)
        self.assertIn("node 1 has a coordinate that is not a finite number", done.stderr)

    def test_joins_coincident_nodes_if_asked_to(self):
        apart, out = self.folder / "apart.msh", self.folder / "out.msh"
        apart.write_text("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n8\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 1 0 0\n"
                         "6 2 0 0\n7 2 1 0\n8 1 1 0\n$EndNodes\n$Elements\n2\n1 3 2 1 1 1 2 3 4\n2 3 2 1 1 5 6 7 8\n"
                         "$EndElements\n")  # fmt: skip
        self.assertIn("2 nodes of the boundary lie where another node lies, for example node 5 on node 2",
                      run("quality", apart).stderr)  # fmt: skip
        done = run("convert", apart, out, "--merge-nodes", "1e-9")
        self.assertEqual((done.returncode, done.stderr), (0, "varimesh: 2 nodes were joined to others.\n"))
        self.assertIn("2 3 2 1 1 2 6 7 3", out.read_text())
        self.assertEqual(run("quality", out).stderr, "")

    def test_the_output_is_named_by_place_or_by_o(self):
        plain, by_flag = (self.folder / name for name in ("plain.msh", "flag.msh"))
        square = self.folder / "square.msh"
        square.write_text("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n$EndNodes\n"
                          "$Elements\n1\n1 3 2 1 1 1 2 3 4\n$EndElements\n")  # fmt: skip
        self.assertEqual(run("convert", square, plain).returncode, 0)
        self.assertEqual(run("convert", square, "-o", by_flag).returncode, 0)
        self.assertEqual(plain.read_bytes(), by_flag.read_bytes())
        self.assertIn("varimesh convert IN -o OUT", run("convert", square).stderr)
        self.assertIn("give one of them", run("convert", square, plain, "-o", by_flag).stderr)

    def test_nodes_in_the_order_of_another_program(self):
        words = {"msh": "0 1 2 3 4 5 6 7 01 03 04 12 15 23 26 37 45 47 56 67 0123 0145 0347 1256 2367 4567 01234567",
                 "exodus": "0 1 2 3 4 5 6 7 01 12 23 30 04 15 26 37 45 56 67 74 01234567 0123 4567 0347 1256 0145 2367"}
        corners = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)]

        def mesh(order):
            number, elements = {}, []
            for shift in (0, 2):
                nodes = []
                for word in words[order].split():
                    at = [sum(corners[int(v)][k] for v in word) // len(word) for k in range(3)]
                    nodes.append(number.setdefault((at[0] + shift, at[1], at[2]), len(number) + 1))
                elements.append(f"{shift // 2 + 1} 12 2 1 1 " + " ".join(map(str, nodes)))
            nodes = "\n".join(f"{n} {x} {y} {z}" for (x, y, z), n in number.items())
            return (f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{len(number)}\n{nodes}\n$EndNodes\n$Elements\n2\n" +
                    "\n".join(elements) + "\n$EndElements\n")

        right, wrong, out = (self.folder / name for name in ("right.msh", "wrong.msh", "out.msh"))
        right.write_text(mesh("msh"))
        wrong.write_text(mesh("exodus"))
        self.assertIn("certified valid                    2", run("quality", right).stdout)
        hint = "The elements fit together if their nodes are in the order of exodus; give --node-order exodus."
        self.assertIn(hint, run("quality", wrong).stderr)
        self.assertIn(hint, run("optimise", wrong, "-o", out).stderr)
        self.assertIn(hint, run("optimise", wrong, "--into", self.folder / "into").stderr)
        self.assertIn("certified valid                    2", run("quality", wrong, "--node-order", "exodus").stdout)
        self.assertEqual(run("optimise", wrong, "-o", out, "--node-order", "exodus", "--quiet").returncode, 0)
        self.assertIn("certified valid                    2", run("quality", out).stdout)
        self.assertIn("There is no order of nodes 'x'", run("quality", wrong, "--node-order", "x").stderr)

    def test_nodes_are_joined_before_an_optimisation(self):
        apart, out = self.folder / "apart.msh", self.folder / "out.msh"
        apart.write_text("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n8\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 1 0 0\n"
                         "6 2 0 0\n7 2 1 0\n8 1 1 0\n$EndNodes\n$Elements\n2\n1 3 2 1 1 1 2 3 4\n2 3 2 1 1 5 6 7 8\n"
                         "$EndElements\n")  # fmt: skip
        done = run("optimise", apart, "-o", out, "--merge-nodes", "1e-9")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("2 nodes were joined to others.", done.stderr)
        self.assertEqual(run("quality", out).stderr, "")

    def test_serendipity_elements_come_back_as_they_were(self):
        eight, out, mfem = (self.folder / name for name in ("eight.msh", "out.msh", "out.mesh"))
        eight.write_text("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n8\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 0.5 -0.125 0\n"
                         "6 1 0.5 0\n7 0.5 1 0\n8 0 0.5 0\n$EndNodes\n$Elements\n1\n1 16 2 1 1 1 2 3 4 5 6 7 8\n$EndElements\n")  # fmt: skip
        done = run("convert", eight, out)
        self.assertEqual(done.returncode, 0)
        self.assertIn("1 quadrilateral of order 2. One new node has the number 9.", done.stderr)
        self.assertEqual(out.read_text(), eight.read_text())
        self.assertIn("because the format has no others", run("convert", eight, mfem).stderr)

    def test_elements_of_lower_order_are_written_so_again_if_asked_to(self):
        two, bent, out, mfem = (self.folder / name for name in ("two.msh", "bent.msh", "out.msh", "out.mesh"))
        two.write_text(two_orders("0.5 0.5"))
        bent.write_text(two_orders("0.53 0.53"))
        raised = run("convert", two, out)
        self.assertIn("1 triangle of order 1. The 2 new nodes", raised.stderr)
        self.assertIn(" 9 2 1 1 2 4 3 ", out.read_text())
        kept = run("convert", two, out, "--keep-orders")
        self.assertIn("1 element has its own lower order again.", kept.stderr)
        self.assertEqual(out.read_text(), two.read_text())
        self.assertIn("because its own order would lose", run("convert", bent, out, "--keep-orders").stderr)
        self.assertIn("has no such elements beside others", run("convert", two, mfem, "--keep-orders").stderr)
        done = run("optimise", two, "-o", out, "--keep-orders")
        self.assertIn("1 element has its own lower order again.", done.stderr)
        self.assertEqual(out.read_text(), two.read_text())
        self.assertIn("1 element that came at a lower order stays at order 2",
                      run("optimise", bent, "-o", out, "--keep-orders").stderr)
        self.assertIn("has no such elements beside others", run("optimise", two, "-o", mfem, "--keep-orders").stderr)
        self.assertIn("so there are no orders to keep", run("optimise", MESH, "-o", out, "--keep-orders").stderr)
        self.assertIn("No element keeps its own order, because all get order 3. Without an order for the result, elements keep "
                      "their own orders.",
                      run("optimise", two, "-o", out, "--keep-orders", "--order", "3").stderr)
        self.assertNotIn("keeps its own", run("optimise", two, "-o", out, "--keep-orders", "--order", "2").stderr)

    def test_a_format_that_contradicts_the_ending_is_refused(self):
        for name, form in (("out.vtu", "msh22"), ("out.msh", "vtu")):
            done = run("convert", MESH, self.folder / name, "--format", form)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn("contradicts", done.stderr)
        self.assertEqual(list(self.folder.iterdir()), [])


class OrdersOnAServer(WithServer):
    def test_jobs_keep_them(self):
        two, out = self.folder / "two.msh", self.folder / "out.msh"
        two.write_text(two_orders("0.5 0.5"))
        job = self.remote("submit", two, "--keep-orders").stdout.strip()
        self.assertEqual(self.remote("wait", job).returncode, 0)
        self.assertEqual(self.remote("result", job, "-o", out).returncode, 0)
        self.assertEqual(out.read_text(), two.read_text())
        self.assertIn("1 element has its own lower order again.", self.remote("logs", job).stdout)
        out.unlink()
        self.assertEqual(self.remote("optimise", two, "-o", out, "--keep-orders").returncode, 0)
        self.assertEqual(out.read_text(), two.read_text())


if __name__ == "__main__":
    unittest.main(verbosity=2)
