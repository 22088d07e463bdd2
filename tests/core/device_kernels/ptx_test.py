"""What a card gets: no slow memory, exact rounding, no atomics, few enough registers, and no load too many. The last test
asks NVIDIA's assembler where there is one."""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import unittest

import ptx

MODULES = sorted(pathlib.Path(os.environ["VARIMESH_PTX"]).glob("*.ptx"))
ORDERS = {10: 2, 20: 3, 35: 4, 56: 5}  # of tetrahedra, by nodes
# As core/device_kernels/kernels/splits.h splits cells: for each order, parts and nodes per part.
SPLITS = {"energy": {2: (1, 10), 3: (2, 10), 4: (2, 18), 5: (4, 14)},
          "gradient": {2: (2, 5), 3: (2, 10), 4: (4, 9), 5: (8, 7)},
          "product": {2: (1, 10), 3: (2, 10), 4: (4, 9), 5: (8, 7)}}
# The most registers that may be alive at once. A thread has 255, and an assembler orders the instructions anew.
MOST_ALIVE = 290


def modules():
    """For each module: what its cells are (nodes of a tetrahedron, or the dimension of cells of any shape times -1, or
    "solver" if it works on no cells), its text and its kernels."""
    for file in MODULES:
        text = file.read_text()
        cells = re.search(r"cell_nodes = (-?\d+)", text)
        yield int(cells[1]) if cells else "solver", text, ptx.kernels(text)


def solver_kernels():
    """The names of the kernels that work on no cells, by the file that defines them."""
    text = (pathlib.Path(__file__).parents[3] / "core/device_kernels/kernels/solver_kernels.h").read_text()
    return set(re.findall(r"(?m)^(?:EACH|EACH_PART|ADD|LARGEST)\((\w+),", text))


def tetrahedra():
    """For each module of tetrahedra: the order and the kernels."""
    for nodes, _, kernels in modules():
        if nodes != "solver" and nodes > 0:
            yield ORDERS[nodes], kernels


def words(kernel, kind):
    """How many numbers are loaded by instructions of this kind; a vector counts as all its numbers."""
    vector = {"v2": 2, "v4": 4}
    return sum(count * next((vector[part] for part in name.split(".") if part in vector), 1)
               for name, count in kernel.kinds.items() if name.startswith(kind))


class Modules(unittest.TestCase):
    def test_there_are_tetrahedra_of_four_orders_and_cells_of_any_shape(self):
        cells = [nodes for nodes, _, _ in modules() if nodes != "solver"]
        self.assertEqual(sorted(cells), [-3, -2, 10, 20, 35, 56])
        self.assertEqual(len(MODULES) - len(cells), 2)
        sums = {"add_up_gradients", "add_up_products", "keep_cell_gradients", "along_cell_gradients", "add_norm_terms"}
        for nodes, _, kernels in modules():
            if nodes == "solver":
                self.assertEqual(set(kernels), solver_kernels())
                continue
            own = {"energy", "gradient", "linearise", "product"}
            if nodes < 0:
                own = {"deform", "scan", "range", "stress", "linearise", "gradient", "change_stress", "product",
                       "node_block", "mean_tensor"}
            self.assertEqual(set(kernels), own | sums)

    def test_run_on_the_oldest_cards_and_drivers_that_are_promised(self):
        for _, text, _ in modules():
            self.assertRegex(text, r"(?m)^\.version 6\.3$")
            self.assertRegex(text, r"(?m)^\.target sm_70")

    def test_call_nothing_and_use_no_local_memory(self):
        for order, text, kernels in modules():
            self.assertNotRegex(text, r"\bcall\b")
            for kernel in kernels.values():
                self.assertEqual(kernel.local_bytes, 0, (order, kernel.name))
                self.assertFalse([kind for kind in kernel.kinds if ".local" in kind])

    def test_round_exactly_and_in_one_order(self):
        for order, _, kernels in modules():
            for kernel in kernels.values():
                for kind in kernel.kinds:
                    self.assertNotRegex(kind, r"approx|ftz|\.full|^atom|^red", (order, kernel.name))
                    if re.match(r"(add|sub|mul|fma|div|rcp|sqrt)\..*f(32|64)$", kind):
                        self.assertIn(".rn", kind, (order, kernel.name))

    def test_need_no_more_registers_than_a_thread_has(self):
        for order, _, kernels in modules():
            for kernel in kernels.values():
                self.assertLessEqual(kernel.most_alive, MOST_ALIVE, (order, kernel.name))

    def test_load_each_number_of_the_table_once_per_use(self):
        for order, kernels in tetrahedra():
            def row(kernel):
                return 3 * SPLITS[kernel][order][1]

            def turns(kernel):
                return min(SPLITS[kernel][order][0], 4)

            # Energy: G. Gradient: G and the sums. Linearise: the mean of F, the range of F, then as the gradient.
            expected = {"energy": turns("energy") * row("energy"), "gradient": 2 * turns("gradient") * row("gradient"),
                        "linearise": row("gradient") + 3 * turns("gradient") * row("gradient"),
                        "product": 2 * turns("product") * row("product")}
            for name, count in expected.items():
                self.assertEqual(words(kernels[name], "ld.shared"), count, (order, name))

    def test_multiply_as_often_as_the_formulas_say(self):
        for order, kernels in tetrahedra():
            for name in ("energy", "gradient", "product"):
                parts, nodes = SPLITS[name][order]
                operators = 1 if name == "energy" else 2
                least = operators * 9 * nodes * min(parts, 4)
                fused = sum(count for kind, count in kernels[name].kinds.items() if kind.startswith("fma"))
                self.assertGreaterEqual(fused, least, (order, name))

    def test_read_each_number_of_a_vector_once(self):
        """Loads of floats and doubles in the kernels that only stream vectors."""
        expected = {"advance": 4, "turn": 3, "take_direction": 1, "clear_step": 0, "scale_residual": 1, "keep_residual": 1,
                    "add_residual": 2, "along_step": 2, "square_of_gradient": 1, "size_of_gradient": 1}
        for nodes, _, kernels in modules():
            for name, count in expected.items() if nodes == "solver" else ():
                self.assertEqual(words(kernels[name], "ld.global"), count, name)

    def test_do_not_spill_by_nvidias_assembler(self):
        ptxas = shutil.which("ptxas")
        if ptxas is None:
            self.skipTest("there is no ptxas")
        for file in MODULES:
            said = subprocess.run([ptxas, "-arch=sm_90", "-v", file, "-o", os.devnull], stderr=subprocess.PIPE, text=True,
                                  check=True).stderr
            self.assertEqual(set(re.findall(r"(\d+) bytes spill", said)), {"0"}, said)


class Reader(unittest.TestCase):
    """The reader of PTX itself."""

    def kernel(self, body):
        return ptx.kernels(".visible .entry k(\n)\n{\n" + body + "\n}\n")["k"]

    def test_counts_what_is_alive_at_once(self):
        self.assertEqual(self.kernel("mov.u32 %r1, 1;\nmov.u32 %r2, 2;\nadd.s32 %r3, %r1, %r2;\nst.global.u32 [%rd1], %r3;\nret;").most_alive, 4)

    def test_keeps_alive_what_the_next_round_of_a_loop_reads(self):
        loop = "mov.f64 %fd1, 0;\nmov.f64 %fd2, 1;\n$L1:\nadd.rn.f64 %fd1, %fd1, %fd2;\n@%p1 bra $L1;\nst.global.f64 [%rd1], %fd1;\nret;"
        self.assertEqual(self.kernel(loop).most_alive, 6)

    def test_sees_vectors_and_local_memory(self):
        kernel = self.kernel(".local .align 8 .b8 depot[512];\nld.shared.v2.f64 {%fd1, %fd2}, [%r1];\nst.local.f64 [%rd1], %fd1;\nret;")
        self.assertEqual((kernel.local_bytes, words(kernel, "ld.shared")), (512, 2))


if __name__ == "__main__":
    if not MODULES:
        print("SKIPPED: this build has no kernels for cards, because there was no clang")
        sys.exit(77)
    unittest.main(verbosity=2)
