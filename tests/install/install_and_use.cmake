# Called by ctest. Installs component `core` of ${build} below ${work}, then configures, builds and runs the project in
# ${source} against the installed files only.
file(REMOVE_RECURSE ${work})

include(${CMAKE_CURRENT_LIST_DIR}/step.cmake)

step(${CMAKE_COMMAND} --install ${build} --component core --prefix ${work}/prefix)
step(${CMAKE_COMMAND} -S ${source}/program -B ${work}/build -G ${generator} -D CMAKE_BUILD_TYPE=${build_type}
     -D CMAKE_CXX_COMPILER=${compiler} -D CMAKE_CXX_FLAGS_RELWITHDEBINFO=${flags} -D CMAKE_PREFIX_PATH=${work}/prefix)
step(${CMAKE_COMMAND} --build ${work}/build)
step(${work}/build/untangle ${mesh} ${work}/optimised.msh)
