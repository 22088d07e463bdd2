"""The checks find planted faults: an upward arrow, a circle, a file without a room, a forbidden house, a second order of
meshes, a flag in the core."""
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

HERE = pathlib.Path(__file__).resolve().parent
TREE = HERE.parents[1]


def plant(tree, file, line):
    path = tree / file
    path.write_text(line + "\n" + (path.read_text() if path.exists() else ""))


class Planted(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.tree = pathlib.Path(self.folder.name)
        for house in ("core", "server", "client"):
            shutil.copytree(TREE / house, self.tree / house, ignore=shutil.ignore_patterns("python", "third_party"))

    def tearDown(self):
        self.folder.cleanup()

    def check(self, check="check_includes"):
        run = subprocess.run([sys.executable, HERE / check, self.tree], capture_output=True, text=True)
        return run.returncode, run.stdout

    def expect(self, sentence, check="check_includes"):
        status, output = self.check(check)
        self.assertEqual(status, 1, output)
        self.assertIn(sentence, output)

    def test_the_tree_as_it_is_passes(self):
        status, output = self.check()
        self.assertEqual(status, 0, output)

    def test_an_upward_arrow_is_found(self):
        plant(self.tree, "core/mesh/check.cpp", '#include "core/optimise/optimiser.h"')
        self.expect("core/mesh/check.cpp includes core/optimise/optimiser.h: core/optimise/ stands above core/mesh/")

    def test_a_circle_inside_a_room_is_found(self):
        plant(self.tree, "core/mesh/high_order_mesh.h", '#include "core/mesh/connectivity.h"')
        self.expect("files include each other in a circle")

    def test_a_circle_of_folders_is_found(self):
        plant(self.tree, "core/formats/common/new.h", '#include "core/formats/gmsh/types.h"')
        self.expect("folders include each other in a circle: core/formats/common/ -> core/formats/gmsh/")

    def test_a_file_without_a_room_is_found(self):
        (self.tree / "core/drawer").mkdir()
        plant(self.tree, "core/drawer/things.h", "#pragma once")
        self.expect("core/drawer/things.h is in no room of core/ROOMS")

    def test_an_upward_arrow_in_angle_brackets_is_found(self):
        plant(self.tree, "core/mesh/check.h", "#include <core/optimise/optimiser.h>")
        self.expect("core/mesh/check.h includes core/optimise/optimiser.h")

    def test_a_dear_header_is_found(self):
        plant(self.tree, "client/commands/wait.cpp", "#include <CLI/CLI.hpp>")
        self.expect("client/commands/wait.cpp includes CLI/CLI.hpp: it takes seconds to compile")

    def test_a_relative_path_is_found(self):
        plant(self.tree, "core/mesh/check.h", '#include "../optimise/optimiser.h"')
        self.expect("write the path from the root of the repository")

    def test_the_core_knows_no_network(self):
        plant(self.tree, "core/base/error.h", '#include "varimesh/v1/service.pb.h"')
        self.expect("core knows no network")

    def test_the_core_knows_no_server(self):
        plant(self.tree, "core/mesh/check.cpp", '#include "server/server.h"')
        self.expect("core knows nothing of server")

    def test_the_client_knows_no_server(self):
        plant(self.tree, "client/client.cpp", '#include "server/server.h"')
        self.expect("client knows nothing of server")

    def test_one_place_compares_meshes(self):
        status, output = self.check("check_merit")
        self.assertEqual(status, 0, output)

    def test_a_second_order_of_meshes_is_found(self):
        for line in ("bool is_better(const Result& a, const Result& b);",
                     "return a.after.uncertified.size() < b.after.uncertified.size();",
                     "if (now->loss <= before->loss) return;",
                     "return now.smallest < before.smallest && now.mean < before.mean;",
                     "auto operator<=>(const Badness&) const = default;",
                     "return std::tuple(a.weak, a.left) < std::tuple(b.weak, b.left);"):
            with self.subTest(line):
                file = self.tree / "core/slide/slide.cpp"
                before = file.read_text()
                plant(self.tree, "core/slide/slide.cpp", line)
                self.expect("core/slide/slide.cpp:1 ", "check_merit")
                file.write_text(before)

    def test_a_second_list_of_thresholds_is_found(self):
        plant(self.tree, "client/client.cpp", "constexpr double kWeak = 0.02;  // a smaller scaled Jacobian is low")
        self.expect("client/client.cpp:1 has a threshold of quality", "check_merit")

    def test_a_check_that_finds_no_order_is_blind(self):
        (self.tree / "core/merit/merit.cpp").write_text("")
        (self.tree / "core/merit/merit.h").write_text("")
        (self.tree / "core/merit/thresholds.h").write_text("")
        self.expect("this check is blind", "check_merit")

    def test_one_place_adds_up_over_a_mesh(self):
        status, output = self.check("check_sums")
        self.assertEqual(status, 0, output)

    def test_another_sum_over_a_mesh_is_found(self):
        loop = "void f() {\n  double sum = 0;\n  for (const CellSet& set : sets)\n"
        for code in ("double f() { return std::accumulate(parts.begin(), parts.end(), 0.0); }",
                     "double f() { return std::reduce(energies.begin(), energies.end(), 0.,\n  std::plus<>()); }",
                     "std::atomic<double> energy{0};",
                     loop + "    for (std::int32_t cell = 0; cell < set.count; ++cell) sum += scans[cell].energy;\n}",
                     "void f() {\n  for (const Visit& visit : visits_) {\n    if (visit.made)\n      norm += visit.step;\n  }\n}",
                     "void f() {\n  double sum = 0;\n  for (const double part : parts) sum += part;\n}"):
            with self.subTest(code):
                file = self.tree / "core/slide/slide.cpp"
                before = file.read_text()
                plant(self.tree, "core/slide/slide.cpp", code)
                self.expect("core/slide/slide.cpp:", "check_sums")
                file.write_text(before)

    def test_the_core_knows_no_flags(self):
        status, output = self.check("check_words")
        self.assertEqual(status, 0, output)

    def test_a_flag_in_the_core_is_found(self):
        for text in ('"try --objective worst"', '"; \'varimesh curve IN\' curves a mesh."', 'R"(--order N)"'):
            with self.subTest(text):
                file = self.tree / "core/slide/slide.cpp"
                before = file.read_text()
                plant(self.tree, "core/slide/slide.cpp", f"const char* kText = {text};")
                self.expect("core/slide/slide.cpp:1 has words of the command", "check_words")
                file.write_text(before)

    def test_a_sum_of_one_cell_is_none_over_a_mesh(self):
        plant(self.tree, "core/slide/slide.cpp",
              "void f() {\n  for (std::int32_t cell = 0; cell < set.count; ++cell) {\n    double sum = 0;\n"
              "    for (int q = 0; q < set.points; ++q) sum += weights[q];\n    of[cell] = sum;\n  }\n}")
        status, output = self.check("check_sums")
        self.assertEqual(status, 0, output)

    def test_a_tree_without_the_sums_makes_the_check_blind(self):
        (self.tree / "core/base/reduction.h").unlink()
        self.expect("this check is blind", "check_sums")


if __name__ == "__main__":
    unittest.main()
