# embed_files(OUTPUT NAMESPACE FILE…) makes the source OUTPUT in the current binary folder, with the contents of the files
# as constants in NAMESPACE (embed.cmake).
function(embed_files output namespace)
  list(JOIN ARGN "|" files)
  add_custom_command(OUTPUT ${CMAKE_CURRENT_BINARY_DIR}/${output}
    COMMAND ${CMAKE_COMMAND} -D OUTPUT=${CMAKE_CURRENT_BINARY_DIR}/${output} -D NAMESPACE=${namespace} -D "FILES=${files}"
            -P ${PROJECT_SOURCE_DIR}/web/embed.cmake
    DEPENDS ${ARGN} ${PROJECT_SOURCE_DIR}/web/embed.cmake
    VERBATIM)
endfunction()
