// Standard output and standard error of a rank that share one launcher.
#pragma once

#include <ostream>
#include <streambuf>
#include <string>

namespace varimesh::client {

/// Writes whole lines to a descriptor when it is flushed, and only once the pipe of the other descriptor is empty.
/// Until then it keeps what it was given in memory.
class StreamInTurn : public std::streambuf {
 public:
  StreamInTurn(int own, int other) : own_(own), other_(other) {}

  /// Writes the rest, which may be no whole line.
  void finish() { (void)write(waiting_.size()); }
  /// Whether the other pipe has always been read in time so far.
  bool waits() const { return waits_; }

 private:
  int overflow(int character) override;
  std::streamsize xsputn(const char* text, std::streamsize size) override;
  /// Writes the whole lines that wait.
  int sync() override;
  /// Writes this many of the bytes that wait. Returns whether it could.
  bool write(std::size_t size);

  int own_, other_;
  bool waits_ = true;
  std::string waiting_;
};

/// Gives std::cout and std::cerr turns, as long as it lives, standard error first: what the program says there no
/// longer flushes standard output. The launcher of Open MPI 5.0.7, which Debian 13 has, reads a pipe in pieces, keeps
/// the line at which a piece ends, and adds it to what the rank writes next, to the other descriptor as well
/// (https://github.com/openpmix/openpmix/issues/3858). The sentences of standard error are short and whole, and have
/// been read before the first piece of standard output is there.
class StreamsInTurn {
 public:
  StreamsInTurn();
  ~StreamsInTurn();
  StreamsInTurn(const StreamsInTurn&) = delete;
  StreamsInTurn& operator=(const StreamsInTurn&) = delete;

 private:
  std::streambuf *standard_output_, *standard_error_;
  std::ostream* tied_;
  StreamInTurn output_, error_;
};

}  // namespace varimesh::client
