// A socket in front of the database that cuts connections at the worst moments.
#pragma once

#include <atomic>
#include <filesystem>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace varimesh::server::testing {

/// Forwards the connections of clients to the socket of a PostgreSQL server in another folder.
class CuttingSocket {
 public:
  enum class Cut {
    Never,
    BeforeCommit,       ///< The server never gets the next COMMIT.
    AfterCommit,        ///< The server commits, but its answer to the next COMMIT gets lost.
    AfterCommitForGood  ///< As AfterCommit, and no new connections are taken.
  };

  /// `server`: the folder of the server's socket.
  explicit CuttingSocket(std::filesystem::path server);
  ~CuttingSocket();
  CuttingSocket(const CuttingSocket&) = delete;
  CuttingSocket& operator=(const CuttingSocket&) = delete;

  /// The folder of this socket.
  std::string folder() const { return folder_.string(); }
  /// Cuts one connection, at its next COMMIT.
  void cut(Cut when) { cut_ = when; }
  int cuts() const { return cuts_; }
  /// Ends all connections and takes no new ones, or takes them again.
  void set_open(bool open);

 private:
  void listen();
  void accept();
  void serve(int client);
  /// Forwards what the client has sent. Returns false if the connection is to end.
  bool forward(int client, int server);

  const std::filesystem::path server_;
  std::filesystem::path folder_;
  std::atomic<Cut> cut_ = Cut::Never;
  std::atomic<int> cuts_ = 0;
  std::atomic<bool> open_ = true, closing_ = false;
  int listener_ = -1;
  std::thread thread_;
  std::mutex mutex_;
  std::vector<std::thread> connections_;
};

}  // namespace varimesh::server::testing
