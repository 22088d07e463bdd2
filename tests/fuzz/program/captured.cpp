// What the process of a job says when a hostile mesh has taken it over. An input is a sequence of messages, each behind
// two bytes with its length. What the server takes of them must make sense, and take no more memory than their size
// allows.
#include <google/protobuf/stubs/logging.h>

#include <algorithm>
#include <chrono>
#include <string_view>

#include "server/isolation/said.h"
#include "server/isolation/worker_process.h"
#include "tests/fuzz/program/memory.h"

namespace {

using namespace varimesh::server;
namespace worker = varimesh::worker;
using varimesh::fuzz::expect;
using Kind = worker::FromWorker::KindCase;

/// What the server has taken, counted by itself.
struct Taken {
  int started = 0, claims = 0, runs = 0, outputs = 0;
  std::int64_t claimed = 0, admitted = 0, output = 0, written = 0;
};

bool is_size(std::int64_t bytes) { return bytes >= 0 && bytes <= std::int64_t{1} << 50; }

void count(const worker::FromWorker& message, Taken& taken, Said& said) {
  switch (message.kind_case()) {
    case Kind::kStarted:
      ++taken.started;
      return;
    case Kind::kReading:
      ++taken.claims;
      expect(taken.runs == 0 && message.reading().most() >= taken.claimed, "it gave up memory that it has");
      taken.claimed = message.reading().most();
      return expect(is_size(taken.claimed), "it was given memory that cannot be");
    case Kind::kRunning:
      ++taken.runs;
      taken.admitted = message.running().most();
      expect(is_size(taken.admitted), "it was admitted with memory that cannot be");
      return said.admit(taken.admitted);
    case Kind::kOutput:
      ++taken.outputs;
      taken.output = 0;
      return expect(taken.runs > 0, "it wrote before it ran");
    case Kind::kOutputPiece:
      taken.output += static_cast<std::int64_t>(message.output_piece().size());
      taken.written += static_cast<std::int64_t>(message.output_piece().size());
      return expect(taken.outputs > 0, "it wrote into no output");
    case Kind::kIteration:
      return expect(message.iteration().number() >= 0 && message.iteration().seconds() >= 0, "an iteration cannot be");
    default:
      return;
  }
}

/// Whether the server goes on listening.
bool hear(std::string_view bytes, Said& said, Taken& taken) {
  const auto parts = parts_of(bytes);
  if (!parts || *parts > kMostParts) return false;
  const std::int64_t most = *parts * 1024 + static_cast<std::int64_t>(bytes.size()) * 32 + (std::int64_t{1} << 20);
  return varimesh::fuzz::within_memory(most, [&] {
    worker::FromWorker message;
    if (!message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return false;
    try {
      said.check(message);
    } catch (const ProcessLost&) {
      return false;
    }
    count(message, taken, said);
    return true;
  });
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int* /*count*/, char*** /*arguments*/) {
  google::protobuf::SetLogHandler(nullptr);  // a line for each text that is not UTF-8
  varimesh::fuzz::count_memory();
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string_view input(reinterpret_cast<const char*>(data), size);
  Said said(2);
  Taken taken;
  const auto length = [&] {
    return static_cast<unsigned char>(input[0]) * 256U + static_cast<unsigned char>(input[1]);
  };
  while (input.size() >= 2) {
    const std::string_view message = input.substr(2, length());
    input.remove_prefix(2 + message.size());
    if (!hear(message, said, taken)) break;
    expect(taken.started <= 1 && taken.claims <= 3 && taken.runs <= 1 && taken.outputs <= 2, "it asked too often");
    expect(taken.output <= 4 * std::max<std::int64_t>(taken.admitted, 1) + (64 << 20), "it wrote too much");
    const auto patience = kPatience * 2 + std::chrono::seconds(taken.written / (256 << 10));
    expect(said.patience() <= patience, "it is waited for without end");
  }
  return 0;
}
