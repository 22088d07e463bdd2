"""read(PATH): meshio.read() of a VTU file, with any Python.

If the arrays stand behind the elements of XML, as in VariMesh's files, meshio decodes from the beginning of an array to the end
of the file, and relies on a decoder that stops at the array's padding. Python's decoder goes on behind it since the correction
of CVE-2026-3446 (https://github.com/python/cpython/issues/145264), which Debian 13 has, and meshio fails at most such files,
whoever wrote them. Here it gets a decoder that stops.
"""
import base64
import types

import meshio
from meshio.vtu import _vtu


def _up_to_the_padding(data):
    end = data.find("=")
    return base64.b64decode(data if end < 0 else data[: -(-end // 4) * 4])


def read(path):
    _vtu.base64 = types.SimpleNamespace(b64decode=_up_to_the_padding, b64encode=base64.b64encode)
    try:
        return meshio.read(path)
    finally:
        _vtu.base64 = base64
