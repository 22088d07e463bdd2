// Messages between the server and the process of a job.
#include "server/isolation/channel.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include <memory>
#include <string>
#include <thread>

#include "server/isolation/plain_texts.h"
#include "server/isolation/worker.pb.h"

namespace varimesh::server {
namespace {

class ChannelTest : public ::testing::Test {
 protected:
  ChannelTest() {
    int ends[2];
    EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends), 0);
    here_ = std::make_unique<Channel>(ends[0]);
    raw_ = ends[1];
  }
  ~ChannelTest() override {
    if (raw_ >= 0) ::close(raw_);
  }
  /// The other end as a channel.
  std::unique_ptr<Channel> there() { return std::make_unique<Channel>(std::exchange(raw_, -1)); }

  std::unique_ptr<Channel> here_;
  int raw_ = -1;
};

worker::FromWorker note(const std::string& text) {
  worker::FromWorker message;
  message.set_note(text);
  return message;
}

TEST_F(ChannelTest, CarriesMessagesOfAllSizesInOrder) {
  const auto there = this->there();
  std::thread sender([&] {
    for (int size = 1; size < 5'000'000; size *= 7) there->send(note(std::string(static_cast<std::size_t>(size), 'x')));
  });
  worker::FromWorker got;
  for (int size = 1; size < 5'000'000; size *= 7) {
    ASSERT_EQ(here_->receive(got, -1), Channel::Got::Message);
    EXPECT_EQ(got.note().size(), static_cast<std::size_t>(size));
  }
  sender.join();
  EXPECT_EQ(here_->receive(got, 0), Channel::Got::Nothing);
}

TEST_F(ChannelTest, CarriesAFileOnce) {
  const auto there = this->there();
  const int file = ::memfd_create("test", MFD_CLOEXEC);
  ASSERT_EQ(::write(file, "abc", 3), 3);
  ASSERT_TRUE(there->send(note("with a file"), file));
  ASSERT_TRUE(there->send(note("without")));
  ::close(file);
  worker::FromWorker got;
  ASSERT_EQ(here_->receive(got, -1), Channel::Got::Message);
  const int copy = here_->take_file();
  ASSERT_GE(copy, 0);
  EXPECT_EQ(here_->take_file(), -1);
  char bytes[3];
  EXPECT_EQ(::pread(copy, bytes, 3, 0), 3);
  EXPECT_EQ(std::string(bytes, 3), "abc");
  EXPECT_TRUE(::fcntl(copy, F_GETFD) & FD_CLOEXEC);
  ::close(copy);
}

TEST_F(ChannelTest, TellsAnEndFromABreach) {
  worker::FromWorker got;
  ASSERT_EQ(::write(raw_, "\xff\xff\xff\xff", 4), 4);
  EXPECT_EQ(here_->receive(got, -1), Channel::Got::Breach) << "four gigabytes are announced";
  const auto there = this->there();
  EXPECT_FALSE(there->send(note(std::string(kMostFrameBytes, 'x'))));
}

TEST_F(ChannelTest, RefusesBytesThatAreNoMessage) {
  worker::FromWorker got;
  ASSERT_EQ(::write(raw_, "\x02\x00\x00\x00\xff\xff", 6), 6);
  EXPECT_EQ(here_->receive(got, -1), Channel::Got::Breach);
}

TEST_F(ChannelTest, EndsInTheMiddleOfAMessage) {
  worker::FromWorker got;
  ASSERT_EQ(::write(raw_, "\x09\x00\x00\x00x", 5), 5);
  EXPECT_EQ(here_->receive(got, 0), Channel::Got::Nothing);
  there().reset();
  EXPECT_EQ(here_->receive(got, -1), Channel::Got::End);
  EXPECT_FALSE(here_->send(note("to nobody")));
}

TEST_F(ChannelTest, ReceivesWhatWasSentBeforeTheEnd) {
  auto there = this->there();
  ASSERT_TRUE(there->send(note("the last word")));
  EXPECT_FALSE(here_->is_closed());
  ASSERT_TRUE(here_->send(note("nobody reads this")));
  there.reset();
  EXPECT_FALSE(here_->send(note("nor this")));
  EXPECT_TRUE(here_->is_closed());
  worker::FromWorker got;
  ASSERT_EQ(here_->receive(got, -1), Channel::Got::Message);
  EXPECT_EQ(got.note(), "the last word");
  EXPECT_EQ(here_->receive(got, -1), Channel::Got::End);
}

TEST_F(ChannelTest, GivesUpOnAReaderThatReadsNothing) {
  here_->limit_sending(1);
  const worker::FromWorker large = note(std::string(std::size_t{8} << 20, 'x'));
  EXPECT_FALSE(here_->send(large));
  EXPECT_FALSE(here_->is_closed());
}

TEST(PlainTexts, HideControlCharactersAtEveryDepth) {
  v1::Metrics metrics;
  metrics.add_notes("one\nline\x1b[2J");
  metrics.mutable_left()->add_remedies()->set_sentence("two\r");
  metrics.mutable_left()->set_sentence("as it is");
  make_plain(metrics);
  EXPECT_EQ(metrics.notes(0), "one\\x0aline\\x1b[2J");
  EXPECT_EQ(metrics.left().remedies(0).sentence(), "two\\x0d");
  EXPECT_EQ(metrics.left().sentence(), "as it is");
}

}  // namespace
}  // namespace varimesh::server
