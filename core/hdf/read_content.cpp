// Finds out which program wrote an HDF5 or netCDF file, and reads the file as its format has it.
#include "core/hdf/read_content.h"

#include "core/hdf/cgns/cgns.h"
#include "core/hdf/exodus/exodus.h"
#include "core/hdf/hopr/hopr.h"

namespace varimesh::formats {

MeshFile read_hdf5_content(Hdf5Source& source, FileAllowance& allowance) {
  const Hdf5Group root(source, allowance, "/");
  if (root.find("ElemInfo") != nullptr && root.find("Ngeo", true) != nullptr) return read_hopr(source, allowance);
  if (root.find("CGNSLibraryVersion") != nullptr || root.find(" hdf5version") != nullptr)
    return read_cgns(source, allowance);
  if ((root.find("connect1") != nullptr || root.find("eb_prop1") != nullptr) &&
      (root.find("coordx") != nullptr || root.find("coord") != nullptr))
    return read_exodus(source, allowance);
  const auto is = [&](const char* what, const char* run) -> MeshFile {
    throw ReadFailure{std::string("The file is ") + what + "; " + run + "."};
  };
  if (root.find("ENS_MAA") != nullptr)
    return is("a MED file", "convert it, for example with: gmsh FILE -save -format msh41 -o mesh.msh");
  if (root.find("NEKTAR") != nullptr)
    return is("a mesh of Nektar++ in HDF5", "write it as XML, with: NekMesh FILE.nekg mesh.xml");
  if (root.find("eles") != nullptr || root.find("mesh_uuid") != nullptr || root.find("mesh-uuid") != nullptr)
    return is("a mesh or a solution of PyFR, which VariMesh only writes",
              "give VariMesh the MSH file from which pyfr import made it");
  return is("an HDF5 or netCDF file, but no mesh of HOPR, CGNS or Exodus",
            "convert it, for example with: meshio convert FILE mesh.msh --output-format gmsh");
}

}  // namespace varimesh::formats
