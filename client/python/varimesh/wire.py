"""Converts MeshPart messages to and from arrays, without one Python object per number.

protobuf's own containers take seconds for a mesh of a million nodes. The layout is that of proto/varimesh/v1/mesh.proto.
"""
from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

VARINT, FIXED64, BYTES, FIXED32 = 0, 1, 2, 5


def varint(value: int) -> bytes:
    """One unsigned number as a varint."""
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def field(number: int, payload: bytes) -> bytes:
    """A field of bytes: a string, a message or a packed list."""
    return varint(number << 3 | BYTES) + varint(len(payload)) + payload


def pack(values: NDArray[Any]) -> bytes:
    """Non-negative numbers as packed varints."""
    left: NDArray[np.unsignedinteger[Any]] = np.ascontiguousarray(values, dtype=np.uint64).ravel()
    if left.size == 0:
        return b""
    width = max(1, -(-int(left.max()).bit_length() // 7))
    digits = np.empty((left.size, width), dtype=np.uint8)
    lengths = np.ones(left.size, dtype=np.int64)
    for i in range(width):
        digits[:, i] = left & np.uint64(0x7F)
        left = left >> np.uint64(7)
        lengths += (left != 0) & (i + 1 < width)
    places = np.arange(width)
    digits[places < (lengths - 1)[:, None]] |= 0x80
    return digits[places < lengths[:, None]].tobytes()


def unpack(data: bytes) -> NDArray[np.int64]:
    """Packed varints as non-negative numbers."""
    raw = np.frombuffer(data, dtype=np.uint8)
    ends = np.flatnonzero(raw < 0x80)
    if raw.size and (ends.size == 0 or ends[-1] != raw.size - 1):
        raise ValueError("a number is cut off")
    starts = np.append(0, ends + 1)[:-1]
    lengths = ends - starts + 1
    values = np.zeros(ends.size, dtype=np.int64)
    for i in range(int(lengths.max(initial=0))):
        has = lengths > i
        values[has] |= (raw[starts[has] + i] & 0x7F).astype(np.int64) << np.int64(7 * i)
    return values


def read_varint(data: memoryview, at: int) -> tuple[int, int]:
    """A number, and the position of the next byte."""
    value = shift = 0
    while True:
        byte = data[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            return value, at


def fields(data: memoryview) -> Iterator[tuple[int, int | memoryview]]:
    """The fields of a message: the number of each, and its value or bytes."""
    at = 0
    while at < len(data):
        key, at = read_varint(data, at)
        kind = key & 7
        if kind == VARINT:
            value, at = read_varint(data, at)
            yield key >> 3, value
        elif kind in (BYTES, FIXED64, FIXED32):
            size = {FIXED64: 8, FIXED32: 4}.get(kind)
            if size is None:
                size, at = read_varint(data, at)
            if at + size > len(data):
                raise ValueError("a field is cut off")
            yield key >> 3, data[at : at + size]
            at += size
        else:
            raise ValueError(f"a field of the unknown kind {kind}")


def messages(data: memoryview) -> Iterator[memoryview]:
    """Consecutive messages, each preceded by its length."""
    at = 0
    while at < len(data):
        size, at = read_varint(data, at)
        if at + size > len(data):
            raise ValueError("a message is cut off")
        yield data[at : at + size]
        at += size
