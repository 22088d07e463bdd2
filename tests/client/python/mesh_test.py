"""Arrays, parts and options, without a server."""
import typing
import unittest

import support

support.need()
import numpy as np
import varimesh
from varimesh import mesh, names, options, wire
from varimesh.v1 import job_pb2, mesh_pb2, optimise_pb2

SQUARE = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])
TWO = {"triangle": [[0, 1, 2], [1, 3, 2]]}


class Wire(unittest.TestCase):
    def test_packs_numbers_as_protobuf_does(self):
        numbers = np.array([0, 1, 127, 128, 16383, 16384, 2097151, 2097152, 2**31 - 1])
        theirs = mesh_pb2.FixedNodes(nodes=numbers.tolist()).SerializeToString()
        self.assertEqual(wire.field(1, wire.pack(numbers)), theirs)
        self.assertEqual(wire.unpack(wire.pack(numbers)).tolist(), numbers.tolist())
        self.assertEqual((wire.pack(numbers[:0]), wire.unpack(b"").size), (b"", 0))

    def test_refuses_truncated_numbers(self):
        with self.assertRaises(ValueError):
            wire.unpack(b"\x01\x80")


class Arrays(unittest.TestCase):
    def test_parts_give_back_the_mesh(self):
        rng = np.random.default_rng(1)
        count = 70_000  # more nodes than one part holds
        nodes = rng.random((count, 3))
        cells = rng.integers(0, count, (150_000, 6), dtype=np.int32)
        one = varimesh.Mesh.from_arrays(nodes, [varimesh.Block("triangle", cells, 7, (3, 9)),
                                                ("line3", [[0, 1, 2]])], {(2, 3): "wing"})
        data = b"".join(mesh.to_parts(one))
        self.assertTrue(all(len(part) <= 2**20 for part in wire.messages(memoryview(data))))
        for part in wire.messages(memoryview(data)):
            mesh_pb2.MeshPart.FromString(bytes(part))
        other = mesh.from_parts(data)
        np.testing.assert_array_equal(other.nodes, one.nodes)
        np.testing.assert_array_equal(other.cells["triangle"], cells)
        self.assertEqual((other.order, other.dimension, other.groups), (2, 2, {(2, 3): "wing"}))
        self.assertEqual((other.blocks[0].entity, other.blocks[0].physical), (7, (3, 9)))
        self.assertEqual(other.blocks[-1].shape, "line")

    def test_takes_names_of_shapes_from_meshio_too(self):
        self.assertEqual([mesh.shape_name(name) for name in ("tetra10", "wedge", "quad9", "hexahedron", "vertex")],
                         ["tetrahedron", "prism", "quadrilateral", "hexahedron", "point"])

    def test_takes_short_names_of_shapes(self):
        self.assertEqual([mesh.shape_name(name) for name in ("tri", "tri6", "TET4", "hex27", "pyra")],
                         ["triangle", "triangle", "tetrahedron", "hexahedron", "pyramid"])

    def test_takes_arrays_of_objects(self):
        rows = np.empty(2, dtype=object)
        rows[0], rows[1] = TWO["triangle"]
        for cells in (rows, np.array(TWO["triangle"], dtype=object)):
            made = varimesh.Mesh.from_arrays(SQUARE, {"tri": cells})
            np.testing.assert_array_equal(made.blocks[0].nodes, TWO["triangle"])
        rows[1] = [0, 1]
        for wrong in (rows, np.array([[0, 1, "a"]], dtype=object)):
            with self.assertRaises(varimesh.BadMesh):
                varimesh.Mesh.from_arrays(SQUARE, {"tri": wrong})

    def test_refuses_invalid_arrays_with_a_sentence(self):
        three = np.zeros((20, 3))
        wrong = {
            "node 4": (SQUARE, {"triangle": [[0, 1, 4]]}),
            "serendipity": (three, {"quad8": [list(range(8))]}),
            "no cells": (SQUARE, {"line": [[0, 1]]}),
            "same": (three, {"triangle": [[0, 1, 2]], "quad9": [list(range(9))]}),
            "finite": (SQUARE * np.nan, TWO),
            "integers": (SQUARE, {"triangle": [[0.5, 1, 2]]}),
            "(n, 2)": (np.zeros(4), TWO),
            "triangle": (SQUARE, {"tringle": [[0, 1, 2]]}),
        }
        for words, (nodes, cells) in wrong.items():
            with self.assertRaises(varimesh.BadMesh, msg=words) as caught:
                varimesh.Mesh.from_arrays(nodes, cells)
            self.assertIn(words, str(caught.exception))


class Options(unittest.TestCase):
    def test_names_and_values_are_those_of_the_message(self):
        hints = typing.get_type_hints(options.Options)
        fields = optimise_pb2.Options.DESCRIPTOR.fields_by_name
        self.assertEqual({name.rstrip("_") for name in hints}, set(fields))
        for name, kind in hints.items():
            enum = fields[name.rstrip("_")].enum_type
            if enum is not None:
                self.assertEqual(set(typing.get_args(kind)), set(names.spellings(enum)), name)

    def test_those_of_a_geometry_are_those_of_its_message(self):
        hints = typing.get_type_hints(options.Geometry)
        fields = job_pb2.Geometry.DESCRIPTOR.fields_by_name
        self.assertEqual(set(hints) - {"file"}, set(fields) - {"digest"})
        for name, field in fields.items():
            if field.enum_type is not None:
                self.assertEqual(set(typing.get_args(hints[name])), set(names.spellings(field.enum_type)), name)
        sent = options.Geometry("part.step", slide="coupled", tolerance=0.5, order=3).to_message()
        self.assertEqual((sent.slide, sent.tolerance, sent.order), (job_pb2.Geometry.SLIDE_COUPLED, 0.5, 3))

    def test_are_converted_to_the_message(self):
        message = options.to_message({"energy": "linear-elastic", "lambda_": 2, "fix": "wall", "fix_nodes": np.array([3]),
                                      "active_set": False, "tolerance": np.float64(1e-3), "order": None,
                                      "target_field": varimesh.TargetField([[1, 0, 1]], per="vertex", numbers=[5])})
        self.assertEqual((message.energy, message.lambda_ if hasattr(message, "lambda_") else getattr(message, "lambda")),
                         (optimise_pb2.ENERGY_LINEAR_ELASTIC, 2))
        self.assertEqual((list(message.fix), list(message.fix_nodes)), (["wall"], [3]))
        self.assertTrue(message.HasField("active_set") and not message.active_set and not message.order)
        self.assertEqual((message.target_field.components, list(message.target_field.numbers)), (3, [5]))

    def test_unknown_names_and_values_get_a_suggestion(self):
        for wrong, words in (({"enrgy": "winslow"}, "'energy'"), ({"energy": "winslo"}, "'winslow'"),
                             ({"tolerance": "small"}, "tolerance"), ({"fix_nodes": ["a"]}, "fix_nodes")):
            with self.assertRaises(varimesh.BadOption) as caught:
                options.to_message(wrong)
            self.assertIn(words, str(caught.exception))


if __name__ == "__main__":
    unittest.main(verbosity=2)
