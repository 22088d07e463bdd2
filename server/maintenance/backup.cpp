// The database is copied by SQLite's backup API, the files one by one. A running server may delete a file after the
// database was copied; then a newer copy of the database no longer refers to it.
#include "server/maintenance/backup.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <system_error>
#include <utility>

#include "core/base/io/write_all.h"
#include "server/jobs/job_rows.h"
#include "server/jobs/sqlite.h"
#include "server/jobs/sqlite_schema.h"
#include "server/meshes/blobs.h"
#include "server/meshes/directory_upload.h"
#include "server/meshes/read_at.h"
#include "server/state/state_directory.h"

namespace varimesh::server {
namespace {

namespace fs = std::filesystem;

/// How often the database is copied anew because files were deleted meanwhile.
constexpr int kRounds = 20;

constexpr const char* kMarker = StateDirectory::kBackupMark;

tl::unexpected<Error> cannot(const std::string& what, const std::string& why) {
  return tl::unexpected(Error{Error::Kind::Output, "Cannot " + what + " (" + why + ")."});
}

/// The files that the jobs of a database refer to.
struct Needed {
  std::int64_t jobs = 0;
  std::set<std::string> files, checkpoints;
  std::map<std::int64_t, std::string> unreadable;  ///< Names of the jobs whose rows are damaged, by key.
};

/// Appends the bytes of a file to another one. Returns false if that fails (errno).
bool copy_bytes(int from, int to) {
  constexpr std::size_t kPiece = std::size_t{1} << 20;
  std::string piece;
  for (std::int64_t offset = 0;; offset += static_cast<std::int64_t>(piece.size())) {
    if (!read_at(from, offset, kPiece, &piece)) return false;
    if (piece.empty()) return ::fdatasync(to) == 0;
    if (!write_all(to, piece)) return false;
  }
}

class Backup {
 public:
  Backup(fs::path from, const StateDirectory& to) : from_(std::move(from)), to_(to) {}

  Expected<BackupReport> run() {
    std::set<std::string> missing;
    Needed needed;
    for (int round = 0; round < kRounds; ++round) {
      auto copied = copy_database();
      if (!copied) return tl::unexpected(copied.error());
      needed = std::move(*copied);
      std::set<std::string> now_missing;
      for (const auto* digests : {&needed.files, &needed.checkpoints})
        for (const std::string& digest : *digests) {
          const auto found = copy_file(digest);
          if (!found) return tl::unexpected(found.error());
          if (!*found && digests == &needed.files) now_missing.insert(digest);
        }
      // What is missing twice was not deleted meanwhile.
      if (std::exchange(missing, std::move(now_missing)) == missing || missing.empty()) break;
    }
    for (const auto& [key, name] : needed.unreadable)
      report_.damage.push_back("The record of " + name + " is damaged in '" + from_.string() +
                               "', so it is not known which files it needs.");
    for (const std::string& digest : missing)
      report_.damage.push_back("The file " + digest + " is missing or damaged in '" + from_.string() +
                               "'; varimeshd check says which job refers to it.");
    // What the earlier backup has may be the only whole copy of what was lost.
    std::error_code error;
    report_.kept_earlier = !report_.damage.empty() && (fs::exists(to_.jobs(), error) || error);
    if (const auto ended = report_.kept_earlier ? give_up() : finish(needed); !ended)
      return tl::unexpected(ended.error());
    report_.jobs = needed.jobs;
    report_.files = static_cast<std::int64_t>(needed.files.size() + needed.checkpoints.size() - missing.size());
    return std::move(report_);
  }

 private:
  Expected<Needed> copy_database() {
    std::error_code ignored;
    for (const char* ending : {"", "-wal", "-shm", "-journal"}) fs::remove(new_database() + ending, ignored);
    try {
      SqliteDatabase source((from_ / "jobs.sqlite").string()), target(new_database());
      source.copy_to(target);
      if (!set_up_schema(target))
        return cannot("back up '" + from_.string() + "'", "a newer version of varimeshd wrote it; use that version");
      target.run("PRAGMA journal_mode = DELETE");
      return needed_by(target);
    } catch (const SqliteError& error) {
      return cannot("copy the database of jobs", error.what());
    }
  }

  static Needed needed_by(Sql& database) {
    Needed needed;
    database.ask("SELECT key, name FROM jobs", {},
                 [&](const SqlRow& name) { needed.unreadable[name.number(0)] = name.text(1); });
    needed.jobs = static_cast<std::int64_t>(needed.unreadable.size());
    database.ask(select_jobs(database), {}, [&](const SqlRow& from) {
      auto row = read_job(database, from);
      if (!row) return;
      needed.unreadable.erase(row->key);
      if (row->record.checkpoint) needed.checkpoints.insert(row->record.checkpoint->digest);
      row->record.checkpoint.reset();
      for (std::string& digest : digests_of(row->record)) needed.files.insert(std::move(digest));
    });
    return needed;
  }

  /// The file in the backup that a copy goes to before it is whole.
  fs::path part() const { return fs::path(to_.meshes()) / "part-backup"; }

  /// Copies an open file to part(), and closes it.
  Expected<void> copy_to_part(int source) {
    const int target = ::open(part().c_str(), O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC | O_NOFOLLOW, 0600);
    const bool copied = target >= 0 && copy_bytes(source, target);
    const int reason = errno;
    if (target >= 0) ::close(target);
    ::close(source);
    if (!copied) return cannot("write to '" + to_.meshes() + "'", std::strerror(reason));
    return {};
  }

  /// Whether the backup has the file now. False if it is not in the state directory.
  Expected<bool> copy_file(const std::string& digest) {
    if (whole_.contains(digest)) return true;
    for (const auto& [ending, form] : {std::pair{"", Form::Plain}, {".zst", Form::Zstd}})
      if (is_whole(fs::path(to_.meshes()) / (digest + ending), form, digest)) {
        whole_.insert(digest);
        return true;
      }
    // The server may compress the file at any time.
    for (const auto& [ending, form] : {std::pair{"", Form::Plain}, {".zst", Form::Zstd}, {"", Form::Plain}}) {
      const int source = ::open((from_ / "meshes" / (digest + ending)).c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
      if (source < 0) continue;
      if (const auto copied = copy_to_part(source); !copied) return tl::unexpected(copied.error());
      if (!is_whole(part(), form, digest)) continue;
      std::error_code error;
      fs::rename(part(), fs::path(to_.meshes()) / (digest + ending), error);
      if (error) return cannot("write to '" + to_.meshes() + "'", error.message());
      // A damaged file that it replaces may have had the other form.
      fs::remove(fs::path(to_.meshes()) / (digest + (form == Form::Plain ? ".zst" : "")), error);
      ++report_.copied;
      whole_.insert(digest);
      return true;
    }
    return false;
  }

  /// Copies the file that says whose a mesh is. If there is none any more, that of an earlier backup is deleted.
  Expected<void> copy_owners(const std::string& digest) {
    const std::string name = digest + ".owners";
    const fs::path owners = fs::path(to_.meshes()) / name;
    std::error_code error;
    const int source = ::open((from_ / "meshes" / name).c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
    if (source < 0) {
      if (errno != ENOENT) return cannot("read '" + name + "' in '" + from_.string() + "'", std::strerror(errno));
      // The server deletes it with the mesh; if only the backup has the mesh, it keeps both.
      for (const char* ending : {"", ".zst"})
        if (fs::exists(from_ / "meshes" / (digest + ending), error)) fs::remove(owners, error);
      return {};
    }
    if (auto copied = copy_to_part(source); !copied) return copied;
    fs::rename(part(), owners, error);
    if (error) return cannot("write to '" + to_.meshes() + "'", error.message());
    return {};
  }

  /// Leaves the earlier backup as it is.
  Expected<void> give_up() {
    std::error_code ignored;
    fs::remove(part(), ignored);
    for (const char* ending : {"", "-wal", "-shm", "-journal"}) fs::remove(new_database() + ending, ignored);
    return {};
  }

  /// Puts the new database in the place of the old one, once its files are on the disk, and then deletes the files that
  /// only the old one needed.
  Expected<void> finish(const Needed& needed) {
    std::error_code error;
    for (const std::string& digest : needed.files)
      if (const auto copied = copy_owners(digest); !copied) return tl::unexpected(copied.error());
    fs::remove(part(), error);
    if (!sync_directory(to_.meshes())) return cannot("write to '" + to_.meshes() + "'", std::strerror(errno));
    for (const char* ending : {"-wal", "-shm"}) fs::remove(to_.jobs() + ending, error);
    fs::rename(new_database(), to_.jobs(), error);
    if (error || !sync_directory(to_.path()))
      return cannot("write to '" + to_.path().string() + "'", error ? error.message() : std::strerror(errno));
    if (!report_.damage.empty()) return {};  // A damaged row may need any file.
    for (const auto& file : fs::directory_iterator(to_.meshes(), error)) {
      const fs::path name = file.path().filename();
      const bool has_ending = name.extension() == ".zst" || name.extension() == ".owners";
      const std::string digest = has_ending ? name.stem().string() : name.string();
      if (!needed.files.contains(digest) && !needed.checkpoints.contains(digest)) fs::remove(file.path(), error);
    }
    return {};
  }

  std::string new_database() const { return to_.jobs() + ".new"; }

  const fs::path from_;
  const StateDirectory& to_;
  BackupReport report_;
  std::set<std::string> whole_;  ///< Files of the backup that have been compared with their digests.
};

}  // namespace

Expected<BackupReport> back_up(const std::string& from, const std::string& to) {
  std::error_code error;
  if (!fs::exists(fs::path(from) / "jobs.sqlite", error))
    return tl::unexpected(Error{Error::Kind::Output, "'" + from +
                                                         "' holds no jobs of a server; name the directory that the "
                                                         "server has as --state. If its jobs are in PostgreSQL "
                                                         "(--store), back them up with pg_dump, and then copy the "
                                                         "folder 'meshes' of the directory."});
  if (fs::equivalent(from, to, error))
    return tl::unexpected(Error{Error::Kind::Output, "A backup needs a directory of its own; name another one."});
  const fs::path marker = fs::path(to) / kMarker;
  if (fs::exists(to, error) && !fs::exists(marker, error) && !fs::is_empty(to, error))
    return tl::unexpected(Error{Error::Kind::Output, "'" + to + "' is not empty and is no backup (it has no file '" +
                                                         kMarker +
                                                         "', or a server has used it since); name a new directory."});
  const auto target = StateDirectory::take(to);
  if (!target) return tl::unexpected(target.error());
  if (!std::ofstream(marker, std::ios::app)) return cannot("write '" + marker.string() + "'", std::strerror(errno));
  return Backup(fs::canonical(from, error), **target).run();
}

}  // namespace varimesh::server
