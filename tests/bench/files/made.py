"""Files of many formats, made with Gmsh, meshio and VTK, for those that few projects publish."""


def with_gmsh(folder):
    """A plate with a hole and a cylinder, in formats of Gmsh."""
    import gmsh

    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        for name, order, endings in (("plate", 2, "msh msh2 mesh su2 inp vtk"), ("plate", 3, "msh msh2 mesh"),
                                     ("cylinder", 2, "msh msh2 mesh inp"), ("cylinder", 3, "msh mesh"),
                                     ("quads", 2, "msh inp"), ("quads", 4, "msh msh2")):  # fmt: skip
            gmsh.clear()
            if name == "cylinder":
                gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 2, 1)
            else:
                gmsh.model.occ.cut([(2, gmsh.model.occ.addRectangle(-2, -2, 0, 4, 4))],
                                   [(2, gmsh.model.occ.addDisk(0, 0, 0, 0.7, 0.7))])  # fmt: skip
            gmsh.model.occ.synchronize()
            dimension = 3 if name == "cylinder" else 2
            tags = [tag for _, tag in gmsh.model.getEntities(dimension)]
            gmsh.model.setPhysicalName(dimension, gmsh.model.addPhysicalGroup(dimension, tags), "body")
            gmsh.option.setNumber("Mesh.MeshSizeMin", 0.6)
            gmsh.option.setNumber("Mesh.MeshSizeMax", 0.6)
            gmsh.option.setNumber("Mesh.RecombineAll", name == "quads")
            gmsh.option.setNumber("Mesh.HighOrderOptimize", 0)
            gmsh.model.mesh.generate(dimension)
            gmsh.model.mesh.setOrder(order)
            for ending in endings.split():
                gmsh.option.setNumber("Mesh.MshFileVersion", 2.2 if ending == "msh2" else 4.1)
                file = f"{order}_22.msh" if ending == "msh2" else f"{order}.{ending}"
                gmsh.write(str(folder / f"gmsh_{name}_p{file}"))
    finally:
        gmsh.finalize()


def with_meshio(folder):
    """The same meshes through meshio, in formats that VariMesh reads."""
    import meshio

    for source in sorted(folder.glob("gmsh_*_22.msh")):
        mesh = meshio.read(source)
        name = source.stem.replace("gmsh_", "").replace("_22", "")
        corners = {"triangle": 3, "quad": 4, "tetra": 4}
        linear = [(shape, cells.data[:, :count]) for cells in mesh.cells
                  for shape, count in corners.items() if cells.type.startswith(shape)]  # fmt: skip
        for ending, kind in ((".vtu", "vtu"), (".inp", "abaqus"), (".meshb", "medit"), (".msh", "gmsh")):
            cells = linear if kind == "medit" else mesh.cells  # Medit's files of meshio are of order 1
            try:
                meshio.write(folder / f"meshio_{name}{ending}", meshio.Mesh(mesh.points, cells), file_format=kind)
            except Exception:  # a format without such cells
                (folder / f"meshio_{name}{ending}").unlink(missing_ok=True)


def with_vtk(folder):
    """One curved cell of each of VTK's quadratic and Lagrange kinds, and meshes of them."""
    import vtk

    for name, kind, order in (("hexahedron", vtk.VTK_LAGRANGE_HEXAHEDRON, 3), ("tetra", vtk.VTK_LAGRANGE_TETRAHEDRON, 2),
                              ("wedge", vtk.VTK_LAGRANGE_WEDGE, 3), ("quad", vtk.VTK_LAGRANGE_QUADRILATERAL, 4),
                              ("triangle", vtk.VTK_LAGRANGE_TRIANGLE, 4),
                              ("quadratic_hexahedron", vtk.VTK_QUADRATIC_HEXAHEDRON, 2),
                              ("quadratic_wedge", vtk.VTK_QUADRATIC_WEDGE, 2),
                              ("quadratic_pyramid", vtk.VTK_QUADRATIC_PYRAMID, 2),
                              ("quadratic_quad", vtk.VTK_QUADRATIC_QUAD, 2)):  # fmt: skip
        source = vtk.vtkCellTypeSource()
        source.SetCellType(kind)
        source.SetCellOrder(order)
        source.SetBlocksDimensions(2, 2, 2)
        source.Update()
        writer = vtk.vtkXMLUnstructuredGridWriter()
        writer.SetFileName(str(folder / f"vtk_{name}.vtu"))
        writer.SetInputData(source.GetOutput())
        writer.Write()


def all_files(folder):
    with_gmsh(folder)
    with_meshio(folder)
    with_vtk(folder)
    return sorted(path for path in folder.iterdir() if path.suffix not in (".vtk", ".su2"))
