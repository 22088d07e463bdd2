#!/usr/bin/python3
"""pack_hdf5.py FILE OUT: writes the groups and arrays of an HDF5 file as an input of the fuzzer hdf5 (program/hdf5.cpp)."""
import struct
import sys

import h5py
import numpy as np


def record(path, attribute, values=None):
    dims, width, kind, payload = (), 0, b"g", b""
    if values is not None:
        values = np.asarray(values)
        dims = values.shape
        kind = {"i": b"i", "u": b"i", "f": b"f", "S": b"s"}.get(values.dtype.kind, b"o")
        if kind == b"i":
            payload = values.astype("<i4").tobytes()
        elif kind == b"f":
            payload = values.astype("<f8").tobytes()
        elif kind == b"s":
            width = min(values.dtype.itemsize, 64)
            payload = values.astype(f"S{width}").tobytes()
    name = path.encode()
    return (kind + bytes([attribute, len(name)]) + name + bytes([width, len(dims)]) +
            b"".join(struct.pack(">H", n) for n in dims) + struct.pack(">H", len(payload)) + payload)


def main(file, out):
    records = []
    with h5py.File(file) as f:
        def add(name, item):
            path = f"/{name}" if name else "/"
            if name:
                records.append(record(path, 0, item[()] if isinstance(item, h5py.Dataset) else None))
            records.extend(record(f"{path}\n{key}", 1, value) for key, value in item.attrs.items()
                           if key not in ("name", "type", "flags"))
        add("", f)
        f.visititems(add)
    with open(out, "wb") as target:
        target.write(b"".join(records))


if __name__ == "__main__":
    main(*sys.argv[1:])
