# SHA-256, in a library of its own so that the numerical library does not need OpenSSL.
find_package(OpenSSL REQUIRED COMPONENTS Crypto)
add_library(varimesh_digest STATIC ${CMAKE_CURRENT_LIST_DIR}/sha256.cpp)
target_include_directories(varimesh_digest PUBLIC ${PROJECT_SOURCE_DIR})
target_link_libraries(varimesh_digest PRIVATE OpenSSL::Crypto varimesh_warnings)
