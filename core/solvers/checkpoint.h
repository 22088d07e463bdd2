// The state of a run as bytes. Every class with state lists it once, in a template `state(archive)`. With a
// CheckpointWriter it writes the state, with a CheckpointReader it reads it back.
#pragma once

#include <cstdint>
#include <cstring>
#include <functional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "core/mesh/high_order_mesh.h"
#include "core/options/options.h"
#include "core/problem/target_field.h"

namespace varimesh {

/// Takes the next bytes; false if it wants no more. CheckpointSink of core/optimise/run_control.h is the same.
using ByteSink = std::function<bool(std::string_view)>;

/// A hash of bytes in the order in which they are added. It does not protect against an adversary.
class Fingerprint {
 public:
  void add(std::string_view bytes);
  template <class T>
  requires(std::is_arithmetic_v<T> || std::is_enum_v<T>) void add(T value) {
    add(std::string_view(reinterpret_cast<const char*>(&value), sizeof value));
  }
  template <class T>
  requires(std::is_arithmetic_v<T> || std::is_enum_v<T>) void add(const std::vector<T>& values) {
    add(values.size());
    add(std::string_view(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)));
  }
  std::uint64_t value() const { return hash_; }

 private:
  std::uint64_t hash_ = 0x9e3779b97f4a7c15;
};

/// A hash of everything that decides the path of a run: the mesh, its fixed nodes (by node), its targets, and all
/// options except `threads`, `device` and those that only say when to stop (max_iterations, time_limit).
std::uint64_t fingerprint(const HighOrderMesh& mesh, const std::vector<bool>& fixed, const StretchField& target,
                          const Options& options);

/// Whether bytes begin as every checkpoint does, of whatever version, mesh and options.
bool is_checkpoint(std::string_view bytes);

/// Writes numbers as they are in this machine's memory, gathered into larger pieces, and a checksum at the end.
class CheckpointWriter {
 public:
  static constexpr bool kReads = false;

  CheckpointWriter(ByteSink sink, std::uint64_t fingerprint);

  template <class T>
  requires(std::is_arithmetic_v<T> || std::is_enum_v<T>) void operator()(const T& value) { put(&value, sizeof value); }
  template <class T>
  requires(std::is_arithmetic_v<T> || std::is_enum_v<T>) void operator()(const std::vector<T>& values) {
    (*this)(static_cast<std::uint64_t>(values.size()));
    put(values.data(), values.size() * sizeof(T));
  }
  template <class First, class Second, class... Rest>
  void operator()(const First& first, const Second& second, const Rest&... rest) {
    (*this)(first);
    (*this)(second, rest...);
  }

  /// Writes the rest and the checksum; false if the sink stopped.
  bool finish();

 private:
  void put(const void* data, std::size_t size);
  void flush();

  ByteSink sink_;
  Fingerprint sum_;
  std::string pending_;
  bool stopped_ = false;
};

/// Reads what a CheckpointWriter wrote. Past the end everything is 0 or empty, and failed() becomes true.
class CheckpointReader {
 public:
  static constexpr bool kReads = true;

  /// `bytes` must outlive the reader. Fails unless `fingerprint` is the one that was written.
  CheckpointReader(std::string_view bytes, std::uint64_t fingerprint);

  template <class T>
  requires(std::is_arithmetic_v<T> || std::is_enum_v<T>) void operator()(T& value) { get(&value, sizeof value); }
  /// As many values as were written.
  template <class T>
  requires(std::is_arithmetic_v<T> || std::is_enum_v<T>) void operator()(std::vector<T>& values) {
    std::uint64_t size = 0;
    (*this)(size);
    failed_ = failed_ || size > rest_.size() / sizeof(T);
    values.resize(failed_ ? 0 : size);
    get(values.data(), values.size() * sizeof(T));
  }
  template <class First, class Second, class... Rest>
  void operator()(First& first, Second& second, Rest&... rest) {
    (*this)(first);
    (*this)(second, rest...);
  }

  /// Whether the checkpoint cannot be used: it comes from another version, is for another mesh or other options, is cut
  /// off or damaged, or does not fit the run.
  bool failed() const { return failed_; }
  void fail() { failed_ = true; }

 private:
  void get(void* data, std::size_t size);

  std::string_view rest_;
  bool failed_ = false;
};

}  // namespace varimesh
