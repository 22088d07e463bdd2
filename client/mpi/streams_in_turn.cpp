#include "client/mpi/streams_in_turn.h"

#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <iostream>
#include <string_view>
#include <thread>

#include "core/base/io/write_all.h"

namespace varimesh::client {
namespace {

/// A launcher reads at once. Another reader may take longer: after one wait in vain there is none.
constexpr std::chrono::seconds kLongestWait{5};
constexpr std::chrono::microseconds kPause{50};

/// Waits until the pipe of this descriptor is empty, but not for ever. Returns whether it is empty, or is no pipe.
bool wait_until_read(int descriptor) {
  struct stat about {};
  if (::fstat(descriptor, &about) != 0 || !S_ISFIFO(about.st_mode)) return true;
  const auto end = std::chrono::steady_clock::now() + kLongestWait;
  for (int unread = 0; ::ioctl(descriptor, FIONREAD, &unread) == 0 && unread > 0;) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(kPause);
  }
  return true;
}

}  // namespace

int StreamInTurn::overflow(int character) {
  const char one = traits_type::to_char_type(character);
  return xsputn(&one, 1) == 1 ? traits_type::not_eof(character) : traits_type::eof();
}

std::streamsize StreamInTurn::xsputn(const char* text, std::streamsize size) {
  waiting_.append(text, static_cast<std::size_t>(size));
  return size;
}

int StreamInTurn::sync() {
  const std::size_t last = waiting_.rfind('\n');
  return last == std::string::npos || write(last + 1) ? 0 : -1;
}

bool StreamInTurn::write(std::size_t size) {
  if (size == 0) return true;
  waits_ = waits_ && wait_until_read(other_);
  const bool is_written = write_all(own_, std::string_view(waiting_).substr(0, size));
  waiting_.erase(0, size);
  return is_written;
}

StreamsInTurn::StreamsInTurn()
    : standard_output_(std::cout.rdbuf()),
      standard_error_(std::cerr.rdbuf()),
      tied_(std::cerr.tie(nullptr)),
      output_(STDOUT_FILENO, STDERR_FILENO),
      error_(STDERR_FILENO, STDOUT_FILENO) {
  std::cout.rdbuf(&output_);
  std::cerr.rdbuf(&error_);
}

StreamsInTurn::~StreamsInTurn() {
  std::cout.rdbuf(standard_output_);
  std::cerr.rdbuf(standard_error_);
  std::cerr.tie(tied_);
  error_.finish();
  output_.finish();
  if (error_.waits() && output_.waits() && wait_until_read(STDOUT_FILENO)) wait_until_read(STDERR_FILENO);
}

}  // namespace varimesh::client
