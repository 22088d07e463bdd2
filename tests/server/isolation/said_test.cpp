// What a process that a hostile mesh has taken over may say.
#include "server/isolation/said.h"

#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "server/isolation/worker_process.h"

namespace varimesh::server {
namespace {

using worker::FromWorker;

/// A process that was admitted with 1 MiB, and was asked for two outputs.
Said admitted() {
  Said said(2);
  said.admit(1 << 20);
  return said;
}

FromWorker output() {
  FromWorker message;
  message.set_output(v1::MESH_FORMAT_VTU);
  return message;
}

TEST(Said, RefusesNumbersThatCannotBe) {
  for (const std::int64_t size : {std::int64_t{-1}, std::int64_t{1'000'000'000'000'000'000},
                                  std::numeric_limits<std::int64_t>::min(), std::numeric_limits<std::int64_t>::max()}) {
    FromWorker message;
    message.mutable_started()->set_address_space(size);
    EXPECT_THROW(Said(1).check(message), ProcessLost);
    message.mutable_reading()->set_most(size);
    EXPECT_THROW(Said(1).check(message), ProcessLost);
    message.mutable_running()->set_most(size);
    EXPECT_THROW(Said(1).check(message), ProcessLost);
    message.mutable_hdf5()->set_memory(size);
    EXPECT_THROW(Said(1).check(message), ProcessLost);
    message.mutable_hdf5()->set_seconds(size);
    EXPECT_THROW(Said(1).check(message), ProcessLost);
  }
  FromWorker message;
  message.mutable_reading()->set_least(2);
  message.mutable_reading()->set_most(1);
  EXPECT_THROW(Said(1).check(message), ProcessLost) << "the least is more than the most";
  message.mutable_iteration()->set_number(-1);
  EXPECT_THROW(Said(1).check(message), ProcessLost);
  for (const double seconds : {-1.0, std::numeric_limits<double>::quiet_NaN()}) {
    message.mutable_iteration()->set_number(1);
    message.mutable_iteration()->set_seconds(seconds);
    EXPECT_THROW(Said(1).check(message), ProcessLost);
  }
  message.mutable_checkpoint()->set_invalid_elements(-1);
  EXPECT_THROW(Said(1).check(message), ProcessLost);
  message.mutable_work()->set_done(-1);
  EXPECT_THROW(Said(1).check(message), ProcessLost);
  message.mutable_slide_trial()->set_left_before(-1);
  EXPECT_THROW(Said(1).check(message), ProcessLost);
}

TEST(Said, MakesNoChoiceThatThereIsNot) {
  for (const int value : {-1, 99, std::numeric_limits<int>::max()}) {
    FromWorker message;
    message.mutable_iteration()->set_phase(static_cast<v1::Phase>(value));
    EXPECT_THROW(Said(1).check(message), ProcessLost) << "a server would look for the name of this phase";
    message.mutable_history()->add_iterations()->set_phase(static_cast<v1::Phase>(value));
    EXPECT_THROW(Said(1).check(message), ProcessLost);
    message.set_output(static_cast<v1::MeshFormat>(value));
    EXPECT_THROW(admitted().check(message), ProcessLost);
  }
}

TEST(Said, AsksForMemoryToRunOnlyOnce) {
  Said said(1);
  FromWorker message;
  message.mutable_running()->set_most(1000);
  said.check(message);
  EXPECT_THROW(said.check(message), ProcessLost);
  message.mutable_reading()->set_most(1000);
  EXPECT_THROW(said.check(message), ProcessLost) << "what it has would be claimed no more";
}

TEST(Said, AsksForMoreMemoryToReadAFewTimes) {
  Said said(1);
  FromWorker message;
  for (const std::int64_t bytes : {1000, 2000, 3000}) {
    message.mutable_reading()->set_most(bytes);
    said.check(message);
  }
  message.mutable_reading()->set_most(4000);
  EXPECT_THROW(said.check(message), ProcessLost);
  Said less(1);
  less.check(message);
  message.mutable_reading()->set_most(3000);
  EXPECT_THROW(less.check(message), ProcessLost);
}

TEST(Said, WritesNoMoreResultsThanWereAskedFor) {
  Said said = admitted();
  said.check(output());
  said.check(output());
  EXPECT_THROW(said.check(output()), ProcessLost);
  EXPECT_THROW(Said(2).check(output()), ProcessLost) << "it has no memory yet";
}

/// How many bytes come before the process is ended; at most `most`.
std::int64_t bytes_taken(Said& said, const FromWorker& message, std::int64_t size, std::int64_t most) {
  for (std::int64_t taken = 0; taken < most; taken += size) try {
      said.check(message);
    } catch (const ProcessLost&) {
      return taken;
    }
  return most;
}

TEST(Said, WritesNothingEndless) {
  constexpr std::int64_t kMiB = 1 << 20, kMost = 1000 * kMiB;
  FromWorker message;
  Said said = admitted();
  message.set_output_piece("x");
  EXPECT_THROW(said.check(message), ProcessLost) << "no output was begun";
  said.check(output());
  message.set_output_piece(std::string(kMiB, 'x'));
  EXPECT_EQ(bytes_taken(said, message, kMiB, kMost), 68 * kMiB);
  message.mutable_checkpoint()->set_number(1);
  said.check(message);
  message.set_checkpoint_piece(std::string(kMiB, 'x'));
  EXPECT_EQ(bytes_taken(said, message, kMiB, kMost), 65 * kMiB);
  message.mutable_history();
  for (int i = 0; i < 10'000; ++i) message.mutable_history()->add_iterations();
  EXPECT_LE(bytes_taken(said, message, 10'000, 100'000'000), 2 << 20) << "iterations, which take 128 bytes each";
}

TEST(Said, IsNotParsedIfItHasTooManyParts) {
  FromWorker message;
  for (int i = 0; i < 10'000; ++i) message.mutable_history()->add_iterations()->set_number(i);
  EXPECT_EQ(parts_of(message.SerializeAsString()), 10'001);
  std::string bomb = "\x6a\x80\x92\xf4\x01";  // a history of 4,000,000 bytes
  for (int i = 0; i < 2'000'000; ++i) bomb.append("\x0a\0", 2);
  EXPECT_EQ(parts_of(bomb), std::nullopt) << "4 MB of empty iterations, which would take 250 MB";
  message.Clear();
  message.mutable_ended()->mutable_metrics()->mutable_substitute_targets()->mutable_elements()->Resize(9 << 20, 1);
  EXPECT_EQ(parts_of(message.SerializeAsString()), std::nullopt) << "numbers take more memory than bytes too";
  message.Clear();
  message.mutable_ended()->mutable_metrics()->set_iterations(3);
  EXPECT_TRUE(parts_of(message.SerializeAsString()));
  message.set_output_piece(std::string(1 << 20, '\0'));
  EXPECT_EQ(parts_of(message.SerializeAsString()), 1);
  EXPECT_EQ(parts_of("\x0b"), std::nullopt) << "a group";
  EXPECT_EQ(parts_of(std::string("\x6a\x05", 2)), std::nullopt) << "cut";
}

TEST(Said, IsNotWaitedForBecauseOfAByteNowAndThen) {
  Said said = admitted();
  EXPECT_EQ(said.patience(), kPatience);
  said.check(output());
  FromWorker message;
  message.set_output_piece("x");
  for (int i = 0; i < 100'000; ++i) said.check(message);
  EXPECT_LE(said.patience(), 2 * kPatience);
  message.set_output_piece(std::string(1 << 20, 'x'));
  for (int i = 0; i < 60; ++i) said.check(message);
  EXPECT_GE(said.patience(), 4 * kPatience) << "who writes much has the time for it";
}

}  // namespace
}  // namespace varimesh::server
