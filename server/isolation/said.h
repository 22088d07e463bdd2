// What the process of a job may say, which a hostile mesh may have taken over: the one place where its numbers are
// checked.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string_view>

#include "server/isolation/worker.pb.h"

namespace varimesh::server {

/// How long a run may go on after its time limit, or after it was told to stop, without a word: large meshes take a
/// while to be written.
inline constexpr std::chrono::seconds kPatience{60};

/// Returns how many texts and messages are inside a serialised FromWorker; nothing if the bytes are no such message.
/// A message takes hundreds of times more memory than the two bytes that announce it.
std::optional<std::int64_t> parts_of(std::string_view bytes);

/// The most parts of one message. The library names at most a thousand elements of a kind.
inline constexpr std::int64_t kMostParts = 100'000;

/// What one process has said so far. Throws ProcessLost for what the library never says.
class Said {
 public:
  using Time = std::chrono::steady_clock::time_point;

  /// `outputs`: how many were asked for.
  explicit Said(int outputs) : most_outputs_(outputs) {}

  /// Checks signs, sizes and counts of a message before anything is done with it.
  void check(const worker::FromWorker& message);
  /// The run was admitted with this much memory, in bytes. Outputs are made of what is in it.
  void admit(std::int64_t bytes);

  /// How long a run may take to end after it should have: the longer the more it has written. One byte now and then
  /// keeps no process alive.
  std::chrono::seconds patience() const;
  /// Whether nothing of an output has come for half of kPatience.
  bool is_silent(Time now) const { return now - heard_ > kPatience / 2; }
  /// What the process waited for until `now` counts as heard.
  void hear(Time now) { heard_ = now; }

 private:
  void check_output(std::int64_t bytes);
  void check_history(const v1::History& part);

  const int most_outputs_;
  int outputs_ = 0;
  bool started_ = false, asked_to_run_ = false;
  int asked_to_read_ = 0;
  std::int64_t to_read_ = 0, admitted_ = 0, written_ = 0, output_ = 0, checkpoint_ = 0, history_ = 0;
  Time heard_ = std::chrono::steady_clock::now();
};

}  // namespace varimesh::server
