# Compresses PTX and makes a C++ source of it: cmake -D INPUT=FILE.ptx -D OUTPUT=FILE.cpp -D NAME=NAME -P pack_ptx.cmake
# The source has the constant std::string_view varimesh::device::ptx::NAME, a gzip stream.
cmake_minimum_required(VERSION 3.25)
file(ARCHIVE_CREATE OUTPUT ${OUTPUT}.gz PATHS ${INPUT} FORMAT raw COMPRESSION GZip COMPRESSION_LEVEL 9)
file(READ ${OUTPUT}.gz content HEX)
# Four bytes are the time. Without it, the same PTX makes the same source.
string(SUBSTRING "${content}" 0 8 head)
string(SUBSTRING "${content}" 16 -1 rest)
set(content "${head}00000000${rest}")
string(REGEX REPLACE "(..)" "\\\\x\\1" content "${content}")
# Compilers limit the length of a string literal.
set(text "// Made by core/device_kernels/pack_ptx.cmake.\n#include <string_view>\n\nnamespace varimesh::device::ptx {\n")
string(APPEND text "static const char bytes[] =\n")
string(LENGTH "${content}" length)
set(begin 0)
while(begin LESS length)
  string(SUBSTRING "${content}" ${begin} 16000 piece)
  string(APPEND text "\"${piece}\"\n")
  math(EXPR begin "${begin} + 16000")
endwhile()
string(APPEND text ";\nextern const std::string_view ${NAME};\n")
string(APPEND text "const std::string_view ${NAME}(bytes, sizeof bytes - 1);\n}  // namespace varimesh::device::ptx\n")
file(WRITE ${OUTPUT} "${text}")
