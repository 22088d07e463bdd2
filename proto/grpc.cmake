# Finds gRPC and Protocol Buffers: by default those of the system, as Debian 12 and Debian 13 have them. With
# VARIMESH_LATER_GRPC those of gRPC 1.65 or later, by the CMake packages that they install (CMAKE_PREFIX_PATH says where); the
# protocol buffers that belong to such a gRPC link Abseil, which only these packages know.
#
# Afterwards there are the targets gRPC::grpc++ and protobuf::libprotobuf, and the variables Protobuf_PROTOC_EXECUTABLE,
# GRPC_CPP_PLUGIN and VARIMESH_GRPC_REFLECTION.
if(VARIMESH_LATER_GRPC)
  find_package(gRPC 1.65 CONFIG REQUIRED)
  find_package(Protobuf CONFIG REQUIRED)
  set(Protobuf_PROTOC_EXECUTABLE $<TARGET_FILE:protobuf::protoc>)
  set(GRPC_CPP_PLUGIN $<TARGET_FILE:gRPC::grpc_cpp_plugin>)
  set(VARIMESH_GRPC_REFLECTION gRPC::grpc++_reflection)
else()
  find_package(Protobuf REQUIRED)
  include(${CMAKE_CURRENT_LIST_DIR}/system_grpc.cmake)
  find_program(GRPC_CPP_PLUGIN grpc_cpp_plugin REQUIRED)
  set(VARIMESH_GRPC_REFLECTION grpc++_reflection)
endif()
