# Installs the public headers: all headers that core/varimesh.h includes, directly or indirectly. All others are internal.
# A new public header needs no line here. The headers keep their folders under include/varimesh/core, so that their own
# includes of "core/…" work. cmake --install runs this script.
cmake_policy(VERSION 3.25)
cmake_path(GET CMAKE_CURRENT_LIST_DIR PARENT_PATH source)
set(waiting core/varimesh.h)
set(public)
while(waiting)
  list(POP_FRONT waiting header)
  if(header IN_LIST public)
    continue()
  endif()
  list(APPEND public ${header})
  cmake_path(GET header PARENT_PATH folder)
  file(INSTALL "${source}/${header}" DESTINATION "${CMAKE_INSTALL_PREFIX}/include/varimesh/${folder}")
  file(STRINGS "${source}/${header}" includes REGEX "^#include \"core/")
  list(TRANSFORM includes REPLACE "^#include \"([^\"]*)\".*" "\\1")
  list(APPEND waiting ${includes})
endwhile()
