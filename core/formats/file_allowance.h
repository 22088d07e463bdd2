// How much memory a reader may take for what a file of XML or ISM says. Internal to core/formats. The readers of
// records of text have an Allowance (allowance.h), which their Scanner asks.
#pragma once

#include <cstddef>
#include <string>

#include "core/formats/scanner.h"

namespace varimesh::formats {

/// Counts what such a reader takes, and refuses a file that asks for more than 8 times its size and 64 MiB. Only a
/// damaged or hostile file does so, or one that repeats itself, such as a compressed file of zeros.
class FileAllowance {
 public:
  explicit FileAllowance(std::size_t file_bytes) : left_(kTimes * file_bytes + kPlus) {}

  /// Must come before the memory is taken.
  void take(std::size_t count, std::size_t bytes_each) {
    if (bytes_each != 0 && count > left_ / bytes_each)
      throw ReadFailure{
          "The mesh file cannot be read: what it describes takes more than 8 times the memory of the file and 64 MiB. "
          "The file is damaged, or it leaves almost everything out; write it in another format, for example MSH."};
    left_ -= count * bytes_each;
  }
  /// What was taken and is free again.
  void give_back(std::size_t bytes) { left_ += bytes; }

 private:
  static constexpr std::size_t kTimes = 8, kPlus = std::size_t(64) << 20;
  std::size_t left_;
};

}  // namespace varimesh::formats
