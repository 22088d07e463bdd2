#include "server/isolation/said.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/message.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "server/isolation/worker_process.h"

namespace varimesh::server {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::io::CodedInputStream;

/// More memory, in bytes, than any machine has. Sums of a few such numbers do not overflow.
constexpr std::int64_t kMostMemory = std::int64_t{1} << 50;
/// How often a process asks for memory to read its mesh (core/base/io/allowance.h).
constexpr int kMostClaims = 3;
/// A node takes more than 240 bytes of a run and at most 85 of a text; a number of a connectivity 4 bytes, and at most
/// 11. What is beside them is small.
constexpr std::int64_t kOutputPerMemory = 4, kOutputBeside = std::int64_t{64} << 20;
/// What an iteration takes in memory, and what all of a run may take, in bytes.
constexpr std::int64_t kIterationBytes = 128, kMostHistoryBytes = std::int64_t{256} << 20;
constexpr std::size_t kMostMetricsBytes = std::size_t{4} << 20;
constexpr std::int64_t kMostHdf5Seconds = 100'000'000;
/// The largest message that is no piece of a file, in bytes. A number in it takes at most 8 times its bytes.
constexpr std::size_t kMostOtherBytes = std::size_t{8} << 20;
/// Slower than any disk to which results are written, in bytes per second.
constexpr std::int64_t kLeastPerSecond = std::int64_t{256} << 10;

void require(bool holds, const char* what) {
  if (!holds) throw ProcessLost{what};
}

bool is_size(std::int64_t bytes) { return bytes >= 0 && bytes <= kMostMemory; }

void check_iteration(const v1::Iteration& iteration) {
  require(iteration.number() >= 0 && iteration.invalid_elements() >= 0 && iteration.active_nodes() >= 0 &&
              iteration.repairable_elements() >= 0 && iteration.products() >= 0 && iteration.left_elements() >= 0 &&
              iteration.groups_left() >= 0 && iteration.seconds() >= 0 && iteration.seconds_left() >= 0,
          "told of an iteration with negative numbers");
}

/// Checks that every choice in a message is one that the contract has: others are places in tables that are too short.
void check_choices(const google::protobuf::Message& message) {
  const auto* const reflection = message.GetReflection();
  std::vector<const FieldDescriptor*> fields;
  reflection->ListFields(message, &fields);
  for (const FieldDescriptor* field : fields) {
    const int count = field->is_repeated() ? reflection->FieldSize(message, field) : 1;
    for (int i = 0; i < count; ++i) {
      if (field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE)
        check_choices(field->is_repeated() ? reflection->GetRepeatedMessage(message, field, i)
                                           : reflection->GetMessage(message, field));
      if (field->cpp_type() != FieldDescriptor::CPPTYPE_ENUM) continue;
      const int value = field->is_repeated() ? reflection->GetRepeatedEnumValue(message, field, i)
                                             : reflection->GetEnumValue(message, field);
      require(field->enum_type()->FindValueByNumber(value) != nullptr, "made a choice that there is not");
    }
  }
}

/// Adds to `parts`. Returns false if the bytes are no such message, or if there are too many parts.
bool count_parts(const Descriptor& type, CodedInputStream& in, std::int64_t& parts, int depth) {
  constexpr int kMostDepth = 20;
  if (depth > kMostDepth) return false;
  while (const std::uint32_t tag = in.ReadTag()) {
    std::uint64_t number = 0;
    std::uint32_t four = 0, length = 0;
    switch (tag & 7U) {
      case 0:
        if (!in.ReadVarint64(&number)) return false;
        continue;
      case 1:
        if (!in.ReadLittleEndian64(&number)) return false;
        continue;
      case 5:
        if (!in.ReadLittleEndian32(&four)) return false;
        continue;
      case 2:
        break;
      default:
        return false;
    }
    if (!in.ReadVarint32(&length) || length > static_cast<std::uint32_t>(in.BytesUntilLimit())) return false;
    const FieldDescriptor* field = type.FindFieldByNumber(static_cast<int>(tag >> 3U));
    const bool is_message = field != nullptr && field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE;
    const bool is_text = field == nullptr || field->cpp_type() == FieldDescriptor::CPPTYPE_STRING;
    if ((is_message || is_text) && ++parts > kMostParts) return false;
    if (!is_message) {
      if (!in.Skip(static_cast<int>(length))) return false;
      continue;
    }
    const auto before = in.PushLimit(static_cast<int>(length));
    if (!count_parts(*field->message_type(), in, parts, depth + 1) || in.BytesUntilLimit() != 0) return false;
    in.PopLimit(before);
  }
  return true;
}

}  // namespace

std::optional<std::int64_t> parts_of(std::string_view bytes) {
  CodedInputStream in(reinterpret_cast<const std::uint8_t*>(bytes.data()), static_cast<int>(bytes.size()));
  std::int64_t parts = 0;
  const auto begins_with = [&](int field) { return !bytes.empty() && bytes[0] == static_cast<char>(field << 3 | 2); };
  const bool is_piece = begins_with(worker::FromWorker::kOutputPieceFieldNumber) ||
                        begins_with(worker::FromWorker::kCheckpointPieceFieldNumber);
  if (!is_piece && bytes.size() > kMostOtherBytes) return std::nullopt;
  in.PushLimit(static_cast<int>(bytes.size()));
  if (!count_parts(*worker::FromWorker::descriptor(), in, parts, 0)) return std::nullopt;
  return parts;
}

void Said::check(const worker::FromWorker& message) {
  using Kind = worker::FromWorker;
  check_choices(message);
  switch (message.kind_case()) {
    case Kind::kStarted:
      require(!std::exchange(started_, true), "started twice");
      return require(is_size(message.started().address_space()), "told of a size that cannot be");
    case Kind::kIteration:
      return check_iteration(message.iteration());
    case Kind::kCheckpointDue:
      return check_iteration(message.checkpoint_due());
    case Kind::kCheckpoint:
      checkpoint_ = 0;
      return check_iteration(message.checkpoint());
    case Kind::kCheckpointPiece:
      checkpoint_ += static_cast<std::int64_t>(message.checkpoint_piece().size());
      return require(checkpoint_ <= admitted_ + kOutputBeside, "wrote more than a checkpoint can have");
    case Kind::kWork:
      return require(message.work().done() >= 0 && message.work().of() >= 0 && message.work().groups_left() >= 0 &&
                         message.work().seconds_left() >= 0,
                     "told of work with negative numbers");
    case Kind::kReading:
      require(!asked_to_run_ && ++asked_to_read_ <= kMostClaims, "asked for memory to read too often");
      require(is_size(message.reading().least()) && is_size(message.reading().most()) &&
                  message.reading().least() <= message.reading().most() && message.reading().most() >= to_read_,
              "asked for a size of memory that cannot be");
      to_read_ = message.reading().most();
      return;
    case Kind::kRunning:
      require(!std::exchange(asked_to_run_, true), "asked for memory to run twice");
      return require(is_size(message.running().most()), "asked for a size of memory that cannot be");
    case Kind::kOutput:
      require(admitted_ > 0 && ++outputs_ <= most_outputs_, "wrote more results than were asked for");
      output_ = 0;
      return;
    case Kind::kOutputPiece:
      return check_output(static_cast<std::int64_t>(message.output_piece().size()));
    case Kind::kHdf5:
      return require(message.hdf5().seconds() >= 0 && message.hdf5().seconds() <= kMostHdf5Seconds &&
                         is_size(message.hdf5().memory()),
                     "asked for limits that cannot be");
    case Kind::kSlideTrial:
      return require(message.slide_trial().left_before() >= 0, "told of a trial with negative numbers");
    case Kind::kHistory:
      return check_history(message.history());
    case Kind::kEnded:
      return require(message.ended().metrics().ByteSizeLong() <= kMostMetricsBytes, "sent a report that is too long");
    default:
      return;  // Loan checks what is borrowed, add_reported() the work of the kernels
  }
}

void Said::admit(std::int64_t bytes) { admitted_ = std::max<std::int64_t>(bytes, 1); }

void Said::check_output(std::int64_t bytes) {
  require(outputs_ > 0, "sent a message that nobody expects");
  output_ += bytes;
  written_ += bytes;
  require(output_ <= kOutputPerMemory * admitted_ + kOutputBeside, "wrote more than a result can have");
  heard_ = std::chrono::steady_clock::now();
}

void Said::check_history(const v1::History& part) {
  for (const v1::Iteration& iteration : part.iterations()) check_iteration(iteration);
  history_ += std::max(static_cast<std::int64_t>(part.ByteSizeLong()), kIterationBytes * part.iterations_size());
  require(history_ <= kMostHistoryBytes, "sent a history that is too long");
}

std::chrono::seconds Said::patience() const {
  return kPatience + outputs_ * kPatience / 2 + std::chrono::seconds(written_ / kLeastPerSecond);
}

}  // namespace varimesh::server
