"""Writes each VTU file of a folder again, in every form that the writers of VTK and meshio have.

usage: rewrite_vtu.py vtk|meshio FOLDER
"""
import pathlib
import sys

folder = pathlib.Path(sys.argv[2])


def by_vtk(file):
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader, vtkXMLUnstructuredGridWriter

    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(file))
    reader.Update()
    for mode in ("Ascii", "Binary", "Appended"):
        for compressed in (False, True) if mode != "Ascii" else (False,):
            for encoded in (False, True) if mode == "Appended" else (False,):
                for wide in (False, True):
                    for big in (False, True) if mode != "Ascii" else (False,):
                        writer = vtkXMLUnstructuredGridWriter()
                        name = f"{file.stem}.{mode}{compressed:d}{encoded:d}{wide:d}{big:d}.again.vtu"
                        writer.SetFileName(str(folder / name))
                        writer.SetInputData(reader.GetOutput())
                        getattr(writer, f"SetDataModeTo{mode}")()
                        writer.SetEncodeAppendedData(encoded)
                        (writer.SetCompressorTypeToZLib if compressed else writer.SetCompressorTypeToNone)()
                        (writer.SetHeaderTypeToUInt64 if wide else writer.SetHeaderTypeToUInt32)()
                        (writer.SetByteOrderToBigEndian if big else writer.SetByteOrderToLittleEndian)()
                        assert writer.Write() == 1


def by_meshio(file):
    import meshio
    import meshio_vtu

    mesh = meshio_vtu.read(file)
    for name, options in (
        ("ascii", {"binary": False}),
        ("plain", {"compression": None}),
        ("zlib", {"compression": "zlib"}),
    ):
        meshio.write(folder / f"{file.stem}.{name}.again.vtu", mesh, file_format="vtu", **options)


for path in sorted(folder.glob("*.vtu")):
    {"vtk": by_vtk, "meshio": by_meshio}[sys.argv[1]](path)
