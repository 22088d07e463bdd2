// Counts the connections, and keeps those that are not used.
#include "server/postgres/pool.h"

namespace varimesh::server {

PostgresPool::Lent PostgresPool::take(SteadyTime deadline) {
  {
    std::unique_lock lock(mutex_);
    if (!freed_.wait_until(lock, deadline, [this] { return lent_ < most_; }))
      throw PostgresError(PostgresError::Kind::Lost, "all connections to the database are in use");
    ++lent_;
    if (!idle_.empty()) {
      auto connection = std::move(idle_.back());
      idle_.pop_back();
      return {*this, std::move(connection)};
    }
  }
  try {
    auto connection = std::make_unique<PostgresConnection>(url_);
    note_reached();
    return {*this, std::move(connection)};
  } catch (const PostgresError& error) {
    note_lost(error.what());
    give_back(nullptr);
    throw;
  }
}

void PostgresPool::give_back(std::unique_ptr<PostgresConnection> connection) {
  std::vector<std::unique_ptr<PostgresConnection>> closed;  // without the lock
  {
    std::lock_guard lock(mutex_);
    --lent_;
    if (connection != nullptr && !connection->broken())
      idle_.push_back(std::move(connection));
    else if (connection != nullptr)
      closed.swap(idle_);  // what broke one of them has probably broken the others
  }
  freed_.notify_one();
}

void PostgresPool::note_lost(const std::string& why) {
  {
    std::lock_guard lock(mutex_);
    if (lost_since_) return;
    lost_since_ = std::chrono::steady_clock::now();
  }
  log_("the database cannot be reached: " + why);
}

void PostgresPool::note_reached() {
  std::optional<SteadyTime> lost;
  {
    std::lock_guard lock(mutex_);
    lost.swap(lost_since_);
  }
  if (!lost) return;
  const auto away = std::chrono::duration_cast<std::chrono::seconds>(std::chrono::steady_clock::now() - *lost);
  log_("the database is back after " + std::to_string(away.count()) + " s");
}

std::optional<SteadyTime> PostgresPool::lost_since() {
  std::lock_guard lock(mutex_);
  return lost_since_;
}

}  // namespace varimesh::server
