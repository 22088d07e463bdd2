# Called by ctest: installs component `core` of ${build} below ${work}, then configures, builds and runs the project in
# ${source}/program with this installation. CMake does not find Eigen there, and its headers are errors.
file(REMOVE_RECURSE ${work})

include(${CMAKE_CURRENT_LIST_DIR}/step.cmake)
include(${CMAKE_CURRENT_LIST_DIR}/poison.cmake)

step(${CMAKE_COMMAND} --install ${build} --component core --prefix ${work}/prefix)

file(GLOB_RECURSE package_files ${work}/prefix/*.cmake)
foreach(file ${package_files})
  file(STRINGS ${file} mentions REGEX "[Ee]igen")
  if(mentions)
    message(FATAL_ERROR "${file} needs Eigen:\n${mentions}")
  endif()
endforeach()

set(poison ${work}/poison)
poison(${poison} ${eigen_include} "Eigen/*")
expect_poisoned(${compiler} ${poison} Eigen/Core)

step(${CMAKE_COMMAND} -S ${source}/program -B ${work}/build -G ${generator} -D CMAKE_BUILD_TYPE=${build_type}
     -D CMAKE_CXX_COMPILER=${compiler} -D CMAKE_CXX_FLAGS=-I${poison} -D CMAKE_CXX_FLAGS_RELWITHDEBINFO=${flags}
     -D CMAKE_PREFIX_PATH=${work}/prefix -D CMAKE_DISABLE_FIND_PACKAGE_Eigen3=ON)
step(${CMAKE_COMMAND} --build ${work}/build)
step(${work}/build/untangle ${mesh} ${work}/optimised.msh)
