// The connections of a process to its database.
#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "server/postgres/connection.h"

namespace varimesh::server {

/// Lends connections, opens them when they are needed, and closes those that are broken. Thread-safe.
class PostgresPool {
 public:
  /// `log` is told when the database cannot be reached, and when it is back.
  PostgresPool(std::string url, int most, std::function<void(const std::string& line)> log)
      : url_(std::move(url)), most_(most), log_(std::move(log)) {}

  /// A connection that is given back at the end.
  class Lent {
   public:
    Lent(PostgresPool& pool, std::unique_ptr<PostgresConnection> connection)
        : pool_(pool), connection_(std::move(connection)) {}
    ~Lent() { pool_.give_back(std::move(connection_)); }
    Lent(const Lent&) = delete;
    Lent& operator=(const Lent&) = delete;
    PostgresConnection& operator*() { return *connection_; }

   private:
    PostgresPool& pool_;
    std::unique_ptr<PostgresConnection> connection_;
  };
  /// Waits for a free connection until `deadline`. Throws PostgresError (Lost) if there is none, or the database cannot
  /// be reached.
  Lent take(SteadyTime deadline);

  /// When the database could no longer be reached. Nothing while it can, as far as is known.
  std::optional<SteadyTime> lost_since();

  /// The database has answered.
  void note_reached();

 private:
  void give_back(std::unique_ptr<PostgresConnection> connection);
  void note_lost(const std::string& why);

  const std::string url_;
  const int most_;
  const std::function<void(const std::string& line)> log_;
  std::mutex mutex_;
  std::condition_variable freed_;
  int lent_ = 0;
  std::vector<std::unique_ptr<PostgresConnection>> idle_;
  std::optional<SteadyTime> lost_since_;
};

}  // namespace varimesh::server
