# Headers that must not be included: poison(FOLDER ROOT PATTERN...) makes a header in FOLDER for each file below ROOT that
# matches a pattern, with the same name and an #error in it. With FOLDER first in the include path, every attempt to
# include one of these files ends the compilation.
function(poison folder root)
  list(TRANSFORM ARGN PREPEND ${root}/ OUTPUT_VARIABLE patterns)
  file(GLOB headers RELATIVE ${root} LIST_DIRECTORIES false ${patterns})
  if(NOT headers)
    message(FATAL_ERROR "There are no headers ${ARGN} below ${root}, so the test could not find an include of one.")
  endif()
  foreach(header ${headers})
    file(WRITE ${folder}/${header} "#error \"The installed headers include <${header}>.\"\n")
  endforeach()
endfunction()

# Checks that the compilation of a file that includes a poisoned header fails because of the #error.
function(expect_poisoned compiler folder header)
  file(WRITE ${folder}/includes_it.cpp "#include <${header}>\n")
  execute_process(COMMAND ${compiler} -I${folder} -fsyntax-only ${folder}/includes_it.cpp
                  RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(status EQUAL 0 OR NOT output MATCHES "The installed headers include <${header}>")
    message(FATAL_ERROR "A file that includes <${header}> compiles with status ${status}:\n${output}")
  endif()
endfunction()
