// Transactions in SQLite.
#include "server/jobs/sqlite_jobs.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <mutex>
#include <optional>

#include "server/jobs/job_database.h"
#include "server/jobs/sqlite.h"
#include "server/jobs/sqlite_schema.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

Failure failure_of(const SqliteError& error) {
  if (error.disk_full()) return store_full("The server's disk has no room for the job").value();
  return internal_failure(std::string("The job store failed (") + error.what() + ").").value();
}

/// A file that takes room on the disk, which is given up piece by piece when the disk is full. Thread-safe.
class KeptRoom {
 public:
  /// `path`: empty: no room is kept.
  explicit KeptRoom(const std::string& path)
      : file_(path.empty() ? -1 : ::open(path.c_str(), O_CREAT | O_WRONLY | O_CLOEXEC | O_NOFOLLOW, 0600)) {
    // A file that was copied may have less room on the disk than bytes.
    struct stat left {};
    if (file_ >= 0 && ::fstat(file_, &left) == 0)
      bytes_ = std::min({left.st_size, static_cast<off_t>(left.st_blocks) * 512, kBytes});
    fill();
  }
  ~KeptRoom() {
    if (file_ >= 0) ::close(file_);
  }
  KeptRoom(const KeptRoom&) = delete;
  KeptRoom& operator=(const KeptRoom&) = delete;

  /// Takes the room, if the disk has it. Tries so every few seconds only.
  void fill() {
    const std::lock_guard lock(mutex_);
    const auto now = std::chrono::steady_clock::now();
    if (file_ < 0 || bytes_ == kBytes || (tried_ && now - *tried_ < kPause)) return;
    tried_ = now;
    if (::posix_fallocate(file_, 0, kBytes) == 0) bytes_ = kBytes;
  }
  bool spend() {
    const std::lock_guard lock(mutex_);
    if (bytes_ < kPiece || ::ftruncate(file_, bytes_ - kPiece) != 0) return false;
    bytes_ -= kPiece;
    return true;
  }

 private:
  /// A change writes some ten pages of 4 KiB.
  static constexpr off_t kBytes = off_t{4} << 20, kPiece = off_t{64} << 10;
  static constexpr std::chrono::seconds kPause{10};

  const int file_;
  std::mutex mutex_;
  off_t bytes_ = 0;
  std::optional<std::chrono::steady_clock::time_point> tried_;
};

/// A database with one writing connection, whose transactions are on the disk when a call returns (WAL,
/// synchronous=FULL), and one reading connection, which does not wait for the writer. A database in memory has only
/// one connection.
class SqliteJobs : public JobDatabase {
 public:
  /// `path`: empty for a database in memory. Throws SqliteError.
  SqliteJobs(const std::string& path, const JobStoreSettings& settings)
      : transitions_(settings), writer_(path), room_(path.empty() ? "" : path + "-room") {
    if (!path.empty()) reader_ = std::make_unique<SqliteDatabase>(path);
  }
  /// Returns false if a newer version made the tables.
  bool set_up() {
    if (!set_up_schema(writer_)) return false;
    if (reader_ != nullptr) reader_->run("PRAGMA query_only = 1");
    return true;
  }

  bool durable() const override { return reader_ != nullptr; }
  bool spend_room() override { return room_.spend(); }

  std::optional<Failure> read(const std::function<void(Sql&)>& work) override {
    if (reader_ == nullptr)
      return write([&](JobWork& transaction) { return work(transaction.sql), false; }, Outcome::MustBeKnown);
    std::lock_guard lock(reader_mutex_);
    try {
      work(*reader_);
      return std::nullopt;
    } catch (const SqliteError& error) {
      return failure_of(error);
    }
  }

  /// One of the callers writes all waiting changes in one transaction; the others wait for it.
  std::optional<Failure> write(const std::function<bool(JobWork&)>& work, Outcome) override {
    Change change{work};
    std::unique_lock lock(queue_mutex_);
    queue_.push_back(&change);
    written_.wait(lock, [&] { return change.done || !writing_; });
    if (change.done) return change.failed;
    writing_ = true;
    std::vector<Change*> changes;
    changes.swap(queue_);
    lock.unlock();
    write_all(changes);
    lock.lock();
    for (Change* each : changes) each->done = true;
    writing_ = false;
    written_.notify_all();
    return change.failed;
  }

 private:
  /// A change that waits to be written, on the stack of its caller.
  struct Change {
    const std::function<bool(JobWork&)>& work;
    std::optional<Failure> failed = std::nullopt;
    bool done = false;
  };

  void write_all(const std::vector<Change*>& changes) {
    try {
      SqliteTransaction transaction(writer_);
      for (Change* change : changes) {
        JobWork work{writer_, transitions_};
        writer_.run("SAVEPOINT change");
        if (!change->work(work)) writer_.run("ROLLBACK TO change");
        writer_.run("RELEASE change");
      }
      transaction.commit();
      room_.fill();
    } catch (const SqliteError& error) {
      for (Change* change : changes) change->failed = failure_of(error);
    }
  }

  const JobTransitions transitions_;
  std::mutex queue_mutex_;
  std::condition_variable written_;
  std::vector<Change*> queue_;
  bool writing_ = false;   ///< One of the callers is writing.
  SqliteDatabase writer_;  ///< Used only by that caller.
  KeptRoom room_;
  std::mutex reader_mutex_;
  std::unique_ptr<SqliteDatabase> reader_;  ///< Null if the database is in memory.
};

}  // namespace

Answer<std::unique_ptr<JobStore>> open_sqlite_jobs(const std::string& path, const JobStoreSettings& settings) {
  try {
    auto jobs = std::make_unique<SqliteJobs>(path, settings);
    if (!jobs->set_up())
      return internal_failure(
          path + " was written by a newer version of varimeshd; run that version, or choose another directory.");
    return std::make_unique<JobStore>(std::move(jobs), settings);
  } catch (const SqliteError& error) {
    return internal_failure(std::string("The job store cannot be opened (") + error.what() +
                            "); choose another directory.");
  }
}

bool has_sqlite_jobs(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return false;
  try {
    return SqliteDatabase(path).number("PRAGMA user_version") > 0;
  } catch (const SqliteError&) {
    return true;
  }
}

std::unique_ptr<JobStore> jobs_in_memory(const JobStoreSettings& settings) {
  auto store = open_sqlite_jobs({}, settings);
  if (!store) std::abort();  // only if there is no memory for an empty database
  return std::move(*store);
}

}  // namespace varimesh::server
