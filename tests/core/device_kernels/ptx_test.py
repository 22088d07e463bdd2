"""What a card gets: no slow memory, exact rounding, no atomics, few enough registers, and no load too many. The last test
asks NVIDIA's assembler where there is one."""
import functools
import os
import pathlib
import re
import shutil
import subprocess
import sys
import unittest

import ptx

MODULES = sorted(pathlib.Path(os.environ["VARIMESH_PTX"]).glob("*.ptx"))
# Kinds of cells (number_of() in core/device_kernels/kernels/splits.h): dimension, columns, layers, and for each kernel into
# how many parts it splits a cell and how many columns a part has.
KINDS = {
    2106: (2, 6, 1, {"energy": (1, 6), "gradient": (1, 6), "product": (1, 6)}),
    2110: (2, 10, 1, {"energy": (1, 10), "gradient": (1, 10), "product": (1, 10)}),
    2115: (2, 15, 1, {"energy": (1, 15), "gradient": (1, 15), "product": (1, 15)}),
    2121: (2, 21, 1, {"energy": (1, 21), "gradient": (2, 11), "product": (1, 21)}),
    2303: (2, 3, 3, {"energy": (1, 3), "gradient": (1, 3), "product": (1, 3)}),
    2404: (2, 4, 4, {"energy": (1, 4), "gradient": (2, 2), "product": (1, 4)}),
    2505: (2, 5, 5, {"energy": (1, 5), "gradient": (2, 3), "product": (2, 3)}),
    3110: (3, 10, 1, {"energy": (1, 10), "gradient": (2, 5), "product": (1, 10)}),
    3120: (3, 20, 1, {"energy": (2, 10), "gradient": (4, 5), "product": (2, 10)}),
    3135: (3, 35, 1, {"energy": (2, 18), "gradient": (4, 9), "product": (4, 9)}),
    3156: (3, 56, 1, {"energy": (4, 14), "gradient": (8, 7), "product": (8, 7)}),
    3306: (3, 6, 3, {"energy": (1, 6), "gradient": (4, 2), "product": (2, 3)}),
    3410: (3, 10, 4, {"energy": (1, 10), "gradient": (8, 2), "product": (4, 3)}),
    3515: (3, 15, 5, {"energy": (2, 8), "gradient": (8, 2), "product": (8, 2)}),
    3309: (3, 9, 3, {"energy": (1, 9), "gradient": (8, 2), "product": (4, 3)}),
    3416: (3, 16, 4, {"energy": (2, 8), "gradient": (8, 2), "product": (8, 2)}),
    3525: (3, 25, 5, {"energy": (4, 7), "gradient": (16, 2), "product": (16, 2)}),
}
ENERGIES = {2: 7, 3: 8}  # kernels/energies.h, by dimension
# The most registers that may be alive at once. A thread has 255, and an assembler orders the instructions anew.
MOST_ALIVE = 290


@functools.cache
def modules():
    """For each module its name, text and kernels."""
    texts = [(file.stem, file.read_text()) for file in MODULES]
    return [(name, text, ptx.kernels(text)) for name, text in texts]


def number(text, name):
    """The number that a module has by this name; None if it has none."""
    found = re.search(rf"{name} = (\d+)", text)
    return int(found[1]) if found else None


def listed_kernels(file):
    """The names of the kernels of a solver, by the file that lists them."""
    text = (pathlib.Path(__file__).parents[3] / "core/device_kernels/kernels" / file).read_text()
    return set(re.findall(r"(?m)^(?:EACH|EACH_PART|ADD|LARGEST)\((\w+),", text))


def split_cells():
    """For each module of cells that are kept in registers: its name, kind and kernels."""
    for name, text, kernels in modules():
        if number(text, "cell_kind"):
            yield name, KINDS[number(text, "cell_kind")], kernels


def words(kernel, kind):
    """How many numbers are loaded by instructions of this kind; a vector counts as all its numbers."""
    vector = {"v2": 2, "v4": 4}
    return sum(count * next((vector[part] for part in name.split(".") if part in vector), 1)
               for name, count in kernel.kinds.items() if name.startswith(kind))


class Modules(unittest.TestCase):
    def test_there_are_all_kinds_and_energies_with_all_kernels(self):
        kinds, energies, solvers = [], [], []
        lists = {"solver_dimension": "solver_kernels.h", "descent_dimension": "descent/kernels.h",
                 "judge_dimension": "judge/kernels.h"}
        sums = {"add_up_gradients", "add_up_products", "keep_cell_gradients", "along_cell_gradients", "add_norm_terms"}
        for _, text, kernels in modules():
            if number(text, "cell_kind"):
                kinds.append(number(text, "cell_kind"))
                self.assertEqual(set(kernels), {"energy", "gradient", "linearise", "product"} | sums)
            elif number(text, "any_cells"):
                energies.append((number(text, "any_cells"), number(text, "energy_number")))
                self.assertEqual(set(kernels), {"deform", "scan", "range", "stress", "linearise", "gradient",
                                                "change_stress", "product", "node_block", "mean_tensor",
                                                "keep_convex_part"} | sums)
            else:
                mark = next(mark for mark in lists if number(text, mark))
                solvers.append((mark, number(text, mark)))
                self.assertEqual(set(kernels), listed_kernels(lists[mark]))
        self.assertEqual(sorted(kinds), sorted(KINDS))
        self.assertEqual(sorted(energies), [(d, energy) for d in (2, 3) for energy in range(1, ENERGIES[d] + 1)])
        self.assertEqual(sorted(solvers), [(mark, d) for mark in sorted(lists) for d in (2, 3)])

    def test_run_on_the_oldest_cards_and_drivers_that_are_promised(self):
        for _, text, _ in modules():
            self.assertRegex(text, r"(?m)^\.version 6\.3$")
            self.assertRegex(text, r"(?m)^\.target sm_70")

    def test_call_nothing_and_use_no_local_memory(self):
        for module, text, kernels in modules():
            self.assertNotRegex(text, r"\bcall\b")
            for kernel in kernels.values():
                self.assertEqual(kernel.local_bytes, 0, (module, kernel.name))
                self.assertFalse([kind for kind in kernel.kinds if ".local" in kind])

    def test_round_exactly_and_in_one_order(self):
        for module, _, kernels in modules():
            for kernel in kernels.values():
                for kind in kernel.kinds:
                    self.assertNotRegex(kind, r"approx|ftz|\.full|^atom|^red", (module, kernel.name))
                    if re.match(r"(add|sub|mul|fma|div|rcp|sqrt)\..*f(32|64)$", kind):
                        self.assertIn(".rn", kind, (module, kernel.name))

    def test_need_no_more_registers_than_a_thread_has(self):
        for module, _, kernels in modules():
            for kernel in kernels.values():
                self.assertLessEqual(kernel.most_alive, MOST_ALIVE, (module, kernel.name))

    def test_load_each_number_of_the_tables_once_per_use(self):
        # How often a kernel takes derivatives (of the range of F, of F) and gathers what nodes get.
        passes = {"energy": (1, 0), "gradient": (1, 1), "linearise": (2, 1), "product": (1, 1)}
        for module, (d, _, layers, splits), kernels in split_cells():
            for name, (up, down) in passes.items():
                parts, columns = splits["gradient" if name == "linearise" else name]
                base, line = min(parts, 4) * d * columns, 2 * layers if layers > 1 else 0
                self.assertEqual(words(kernels[name], "ld.shared"), (up + down) * (base + line), (module, name))

    def test_multiply_as_often_as_the_formulas_say(self):
        for module, (d, _, layers, splits), kernels in split_cells():
            for name, operators in ("energy", 1), ("gradient", 2), ("product", 2):
                parts, columns = splits[name]
                line = 2 * layers * d * columns if layers > 1 else 0
                least = operators * (d * d * columns * min(parts, 4) + line)
                fused = sum(count for kind, count in kernels[name].kinds.items() if kind.startswith("fma"))
                self.assertGreaterEqual(fused, least, (module, name))

    def test_read_each_number_of_a_vector_once(self):
        """Loads of floats and doubles in the kernels that only stream vectors."""
        both = {"advance": 4, "turn": 3, "take_direction": 1, "keep_residual": 1, "along_step": 2, "square_of_gradient": 1}
        expected = {"solver": both | {"clear_step": 0, "scale_residual": 1, "add_residual": 2, "size_of_gradient": 1},
                    "descent": both | {"begin_system": 1, "round_direction": 1, "subtract_kept": 2}}
        for module, _, kernels in modules():
            for name, count in expected.get(module.split("_")[0], {}).items():
                self.assertEqual(words(kernels[name], "ld.global"), count, (module, name))

    def test_load_each_value_of_a_cell_once_for_several_rows(self):
        """A column of the descent's matrices: d values, and an entry in each of four rows, in every copy of the loop."""
        for module, _, kernels in modules():
            if not module.startswith("descent"):
                continue
            d = int(module[-2])
            kernel = kernels["multiply_cells"]
            fused = sum(count for kind, count in kernel.kinds.items() if kind.startswith("fma.rn.f64"))
            self.assertGreater(fused, 0)
            self.assertEqual(fused % (4 * d), 0)
            self.assertEqual(words(kernel, "ld.global"), fused // (4 * d) * (4 + d), module)

    def test_load_each_number_of_a_term_once(self):
        """A term of a coefficient of J and of those before it: as many loads for each copy of the loop."""
        modules_of_judge = [entry for entry in modules() if entry[0].startswith("judge")]
        self.assertEqual(len(modules_of_judge), 2)
        for module, _, kernels in modules_of_judge:
            d = int(module[-2])
            # For each kernel: fused multiplications and loads of a term, and loads besides.
            expected = {"convert": (d, 1 + d, 0), "cross": (6, 6, 0), "coefficients": (d, 2 * d, 1)}
            for name, (fused_of_term, loads_of_term, others) in expected.items():
                fused = sum(count for kind, count in kernels[name].kinds.items() if kind.startswith("fma.rn.f64"))
                self.assertGreater(fused, 0)
                self.assertEqual(fused % fused_of_term, 0)
                loads = words(kernels[name], "ld.global.f64")
                self.assertEqual(loads, fused // fused_of_term * loads_of_term + others, (module, name))

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
