// The open files that the process of a job gets.
#pragma once

#include <sys/mman.h>

#include <cstdint>
#include <new>
#include <string_view>

#include "server/meshes/mesh_store.h"

namespace varimesh::server {

/// An open file as bytes.
class MappedFile : public Blob {
 public:
  MappedFile(int file, std::int64_t size) : size_(static_cast<std::size_t>(size)) {
    if (size_ > 0) data_ = ::mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, file, 0);
    if (data_ == MAP_FAILED) throw std::bad_alloc();
  }
  ~MappedFile() override {
    if (size_ > 0) ::munmap(data_, size_);
  }
  std::string_view bytes() const override { return {static_cast<const char*>(data_), size_}; }

 private:
  const std::size_t size_;
  void* data_ = nullptr;
};

}  // namespace varimesh::server
