# Called by ctest. Installs components `client` and `client-development` of ${build} below ${work}, builds the project in
# ${source} against the installed files only, and runs it with a server.
file(REMOVE_RECURSE ${work})
file(MAKE_DIRECTORY ${work})

include(${CMAKE_CURRENT_LIST_DIR}/step.cmake)

step(${CMAKE_COMMAND} --install ${build} --component client --prefix ${work}/prefix)
step(${CMAKE_COMMAND} --install ${build} --component client-development --prefix ${work}/prefix)
step(${CMAKE_COMMAND} -S ${source} -B ${work}/build -G ${generator} -D CMAKE_BUILD_TYPE=${build_type}
     -D CMAKE_CXX_COMPILER=${compiler} -D CMAKE_CXX_FLAGS_RELWITHDEBINFO=${flags} -D CMAKE_PREFIX_PATH=${work}/prefix)
step(${CMAKE_COMMAND} --build ${work}/build)
step(sh ${CMAKE_CURRENT_LIST_DIR}/run_remote.sh ${varimeshd} ${work}/build/remote ${work} ${mesh})
