# Called by ctest: installs component `core` of ${build} below ${work}, then configures, builds and runs the project in
# ${source} against that and nothing else.
file(REMOVE_RECURSE ${work})

function(step)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT status EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "${command}\nended with status ${status}:\n${output}")
  endif()
  message(STATUS "${output}")
endfunction()

step(${CMAKE_COMMAND} --install ${build} --component core --prefix ${work}/prefix)
step(${CMAKE_COMMAND} -S ${source}/program -B ${work}/build -G ${generator} -D CMAKE_BUILD_TYPE=${build_type}
     -D CMAKE_CXX_COMPILER=${compiler} -D CMAKE_CXX_FLAGS_RELWITHDEBINFO=${flags} -D CMAKE_PREFIX_PATH=${work}/prefix)
step(${CMAKE_COMMAND} --build ${work}/build)
step(${work}/build/untangle ${mesh} ${work}/optimised.msh)
