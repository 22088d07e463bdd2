# Makes Debian packages of the installed components; deploy/make-packages builds them.
set(CPACK_GENERATOR DEB)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING ONE_PER_GROUP)
set(CPACK_PACKAGE_CONTACT "The VariMesh authors <varimesh@localhost>")
set(CPACK_PACKAGE_FILE_NAME varimesh)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)  # finds the libraries that the programs are linked against, with versions
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

# Describes a package: its group of components, its name, one line about it, and what it depends on.
set(abi ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
macro(varimesh_package group name summary)
  cmake_parse_arguments(package "" "DEPENDS;SECTION" "COMPONENTS" ${ARGN})
  string(TOUPPER ${group} key)
  set(CPACK_DEBIAN_${key}_PACKAGE_NAME ${name})
  set(CPACK_COMPONENT_${key}_DESCRIPTION "${summary}")
  set(CPACK_COMPONENT_GROUP_${key}_DESCRIPTION "${summary}")
  set(CPACK_DEBIAN_${key}_DESCRIPTION "${summary}")
  set(CPACK_DEBIAN_${key}_PACKAGE_DEPENDS "${package_DEPENDS}")
  if(package_SECTION)
    set(CPACK_DEBIAN_${key}_PACKAGE_SECTION ${package_SECTION})
  endif()
  foreach(component ${package_COMPONENTS})
    string(TOUPPER ${component} component_key)
    set(CPACK_COMPONENT_${component_key}_GROUP ${group})
    list(APPEND CPACK_COMPONENTS_ALL ${component})
  endforeach()
  list(GET package_COMPONENTS 0 first)
  install(FILES ${PROJECT_SOURCE_DIR}/LICENSE RENAME copyright DESTINATION share/doc/${name} COMPONENT ${first})
endmacro()

set(CPACK_COMPONENTS_ALL)
varimesh_package(server varimesh-server "Server that optimises high-order meshes, over gRPC" COMPONENTS server)
varimesh_package(command varimesh "Command that optimises high-order meshes, here or on a server" COMPONENTS command)
if(TARGET varimesh_hdf5)
  varimesh_package(hdf5 varimesh-hdf5 "Reads and writes HDF5 meshes (HOPR, CGNS, PyFR) for varimesh and varimesh-server"
    COMPONENTS hdf5)
  set(CPACK_DEBIAN_SERVER_PACKAGE_RECOMMENDS varimesh-hdf5)
  set(CPACK_DEBIAN_COMMAND_PACKAGE_RECOMMENDS varimesh-hdf5)
endif()
if(TARGET varimesh_opencascade)
  varimesh_package(geometry varimesh-geometry "Reads CAD models (STEP, IGES, BREP) for varimesh and varimesh-server"
    COMPONENTS geometry)
  set(CPACK_DEBIAN_COMMAND_PACKAGE_SUGGESTS varimesh-geometry)
endif()
if(TARGET varimesh_mpi)
  varimesh_package(mpi varimesh-mpi "Certifies and optimises high-order meshes on many machines, over MPI" COMPONENTS mpi)
  set(CPACK_DEBIAN_MPI_PACKAGE_RECOMMENDS "openmpi-bin, openssh-client")
endif()
varimesh_package(library libvarimesh-client${abi} "C++ client of the mesh optimisation server" COMPONENTS client
  SECTION libs)
varimesh_package(development libvarimesh-dev "Headers of the mesh optimisation library and of the C++ client" SECTION libdevel
  COMPONENTS client-development core
  DEPENDS "libvarimesh-client${abi} (= ${PROJECT_VERSION}), libgrpc++-dev, libprotobuf-dev, protobuf-compiler, libexpected-dev, libhwy-dev, libexpat1-dev, zlib1g-dev, pkg-config")
varimesh_package(python python3-varimesh "Python package that optimises high-order meshes on a server" SECTION python
  COMPONENTS python DEPENDS "python3 (>= 3.11), python3-grpcio, python3-protobuf, python3-numpy")
set(CPACK_DEBIAN_SERVER_PACKAGE_SUGGESTS "varimesh, varimesh-geometry")
set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS varimesh-server)
set(CPACK_DEBIAN_PYTHON_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS OFF)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SHLIBDEPS OFF)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_GENERATE_SHLIBS ON)
# Compiles the Python package on installation and removes the compiled files with it. Otherwise the files that Python
# compiles at the first import would be left behind.
file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/debian/postinst @ONLY CONTENT [[#!/bin/sh
set -e
if [ "$1" = configure ]; then py3compile -p python3-varimesh; fi
]])
file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/debian/prerm @ONLY CONTENT [[#!/bin/sh
set -e
py3clean -p python3-varimesh
]])
set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA
  "${PROJECT_BINARY_DIR}/debian/postinst;${PROJECT_BINARY_DIR}/debian/prerm")
include(CPack)
