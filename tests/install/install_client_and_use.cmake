# Called by ctest: installs components `client` and `client-development` of ${build} below ${work}, builds the project in
# ${source} against them and nothing else of this tree, and runs it with a server.
file(REMOVE_RECURSE ${work})
file(MAKE_DIRECTORY ${work})

function(step)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT status EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "${command}\nended with status ${status}:\n${output}")
  endif()
  message(STATUS "${output}")
endfunction()

step(${CMAKE_COMMAND} --install ${build} --component client --prefix ${work}/prefix)
step(${CMAKE_COMMAND} --install ${build} --component client-development --prefix ${work}/prefix)
step(${CMAKE_COMMAND} -S ${source} -B ${work}/build -G ${generator} -D CMAKE_BUILD_TYPE=${build_type}
     -D CMAKE_CXX_COMPILER=${compiler} -D CMAKE_CXX_FLAGS_RELWITHDEBINFO=${flags} -D CMAKE_PREFIX_PATH=${work}/prefix)
step(${CMAKE_COMMAND} --build ${work}/build)
step(sh ${CMAKE_CURRENT_LIST_DIR}/run_remote.sh ${varimeshd} ${work}/build/remote ${work} ${mesh})
