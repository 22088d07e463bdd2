// Hears what other processes tell through the database.
#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <thread>

#include "server/jobs/job_store.h"

namespace varimesh::server {

/// Waits for notifications, with a connection and a thread of its own, and calls a function for each. It connects again
/// when the connection is lost. The destructor waits for a call that is under way.
class PostgresListener {
 public:
  PostgresListener(std::string url, std::function<void(const News&)> listener);
  ~PostgresListener();
  PostgresListener(const PostgresListener&) = delete;
  PostgresListener& operator=(const PostgresListener&) = delete;

 private:
  void run();
  /// Listens until the connection is lost or this object is destroyed.
  void hear();

  const std::string url_;
  const std::function<void(const News&)> listener_;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

}  // namespace varimesh::server
