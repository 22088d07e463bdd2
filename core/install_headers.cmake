# Installs the public headers: what core/varimesh.h includes, directly or not. Every other header stays internal, and a
# new public one needs no line here. They keep their folders under include/varimesh/core, where the "core/…" of their own
# includes finds them. Run by cmake --install.
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
