// A proxy in front of an S3 server that fails in the ways in which servers and networks do.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <string_view>
#include <thread>
#include <vector>

namespace varimesh::server::testing {

/// Forwards connections to a port of this machine. One fault at a time applies to what comes next.
class FaultProxy {
 public:
  explicit FaultProxy(int server_port);
  ~FaultProxy();
  FaultProxy(const FaultProxy&) = delete;
  FaultProxy& operator=(const FaultProxy&) = delete;

  int port() const { return port_; }
  /// Answers this many requests with 503 instead of forwarding them.
  void refuse(int requests) { refusals_ = requests; }
  /// Closes this many connections when they have answered `after` bytes.
  void cut_answers(int connections, std::int64_t after) { cut_after_ = after, cuts_ = connections; }
  /// Closes this many connections when they have sent `after` bytes to the server, without an answer.
  void cut_requests(int connections, std::int64_t after) { cut_requests_after_ = after, request_cuts_ = connections; }
  /// Loses the answer to this many requests that begin with `word`: the server has done what they ask.
  void lose_answers(int requests) { lost_answers_ = requests; }
  /// Changes a bit in the middle of this many long answers.
  void flip_bits(int answers) { flips_ = answers; }
  /// Says nothing for this long before each answer of the next connections.
  void stall(int connections, int milliseconds) { stall_milliseconds_ = milliseconds, stalls_ = connections; }
  /// Closes all connections at once, and new ones too, until it is told otherwise.
  void go_away(bool is_away) { is_away_ = is_away; }

  int faults() const { return faults_; }
  /// Requests whose signature another secret than S3RVER has made. They are answered with 403.
  int wrong_signatures() const { return wrong_signatures_; }
  /// Requests that send a part of an object.
  int parts() const { return parts_; }

 private:
  void accept();
  void serve(int client);
  /// Looks at the head of a request. Returns what to answer instead of forwarding it; empty: nothing.
  std::string_view answer_to(std::string_view request);
  /// Takes one of the faults that are left. Returns whether there was one.
  bool take(std::atomic<int>& left);

  const int server_port_;
  int listener_ = -1, port_ = 0;
  std::atomic<int> refusals_ = 0, cuts_ = 0, request_cuts_ = 0, stalls_ = 0, flips_ = 0, lost_answers_ = 0, faults_ = 0;
  std::atomic<int> stall_milliseconds_ = 0, wrong_signatures_ = 0, parts_ = 0;
  std::atomic<std::int64_t> cut_after_ = 0, cut_requests_after_ = 0;
  std::atomic<bool> is_away_ = false, closing_ = false;
  std::mutex mutex_;
  std::vector<std::thread> threads_;  ///< Of the connections.
  std::thread accepting_;
};

}  // namespace varimesh::server::testing
