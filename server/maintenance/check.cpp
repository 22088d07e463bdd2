// First the database, which says what must be there; then the files; then what is missing.
#include "server/maintenance/check.h"

#include <sys/stat.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <map>
#include <set>
#include <system_error>

#include "core/base/sha256.h"
#include "server/jobs/job_rows.h"
#include "server/jobs/sqlite.h"
#include "server/jobs/sqlite_schema.h"
#include "server/meshes/blobs.h"
#include "server/meshes/disk.h"
#include "server/state/state_directory.h"

namespace varimesh::server {
namespace {

/// Checks one state directory.
class Checker {
 public:
  Checker(const StateDirectory& state, bool repair) : state_(state), repair_(repair) {}

  CheckReport run() {
    try {
      SqliteDatabase database(state_.jobs());
      check_database(database);
    } catch (const SqliteError& error) {
      found("The database of jobs cannot be read (" + std::string(error.what()) + "); restore a backup.");
    }
    check_files();
    for (const auto& [digest, user] : references_)
      if (!whole_.contains(digest))
        found("The file " + digest + ", which " + user + " refers to, is missing or damaged.");
    for (const std::string& digest : whole_) report_.unreferenced += references_.contains(digest) ? 0 : 1;
    report_.files = static_cast<std::int64_t>(whole_.size());
    return std::move(report_);
  }

 private:
  void found(std::string sentence) { report_.damage.push_back(std::move(sentence)); }

  // ===== the database =====

  void check_database(SqliteDatabase& database) {
    if (!set_up_schema(database))
      return found("The database of jobs was written by a newer version of varimeshd; check it with that version.");
    if (!is_sound(database) && repair_) {
      database.run("REINDEX");
      found(is_sound(database) ? "The indices of the database were damaged and have been made anew."
                               : "The database of jobs cannot be repaired; restore a backup.");
    }
    check_jobs(database);
  }

  bool is_sound(SqliteDatabase& database) {
    auto query = database.query_once("PRAGMA integrity_check(3)");
    bool sound = true;
    while (query.step()) {
      if (query.view(0) == "ok") continue;
      found("The database of jobs is damaged: " + query.text(0) + ".");
      sound = false;
    }
    return sound;
  }

  void check_jobs(Sql& database) {
    std::map<std::int64_t, std::string> damaged;  // names, by key
    database.ask("SELECT key, name FROM jobs", {}, [&](const SqlRow& name) { damaged[name.number(0)] = name.text(1); });
    report_.jobs = static_cast<std::int64_t>(damaged.size());
    std::vector<JobRow> rows;
    database.ask(select_jobs(database), {}, [&](const SqlRow& from) {
      if (auto row = read_job(database, from)) {
        damaged.erase(row->key);
        note_references(row->record);
        rows.push_back(std::move(*row));
      }
    });
    for (const auto& [key, name] : damaged) {
      found("The record of " + name + " is damaged; delete the job and submit it again.");
      if (repair_) set_aside(database, key);
    }
    for (const JobRow& row : rows)
      if (!load_events(database, row))
        found("The events of " + row.record.job.name() + " are damaged; this does not affect its result.");
  }

  void note_references(const JobRecord& record) {
    for (const std::string& digest : digests_of(record)) references_.try_emplace(digest, record.job.name());
  }

  // ===== the files =====

  void check_files() {
    std::error_code error;
    for (const auto& file : std::filesystem::directory_iterator(state_.meshes(), error)) check_file(file.path());
    if (error) found("The folder of meshes cannot be read (" + error.message() + ").");
  }

  void check_file(const std::filesystem::path& path) {
    const std::string name = path.filename().string();
    if (name.starts_with("part-")) return;  // of an upload that was cut; the server removes it when it starts
    if (name == kDamagedFolder) return;     // what the server has set aside
    // Who else may use the mesh. A damaged line is nobody's.
    if (path.extension() == ".owners" && is_sha256(path.stem().string())) return;
    const bool compressed = path.extension() == ".zst";
    const std::string digest = compressed ? path.stem().string() : name;
    if (!is_sha256(digest)) return found("The file '" + name + "' does not belong to the server.");
    if (is_whole(path, compressed ? Form::Zstd : Form::Plain, digest)) {
      whole_.insert(digest);
      return;
    }
    found("The file " + name + " is damaged" + (repair_ ? set_file_aside(path) : "") + ".");
  }

  /// Returns what became of the file.
  std::string set_file_aside(const std::filesystem::path& path) const {
    const std::filesystem::path aside = state_.path() / "damaged";
    std::error_code error;
    if (::mkdir(aside.c_str(), 0700) != 0 && errno != EEXIST) return std::string(": ") + std::strerror(errno);
    std::filesystem::rename(path, aside / path.filename(), error);
    return error ? " and cannot be moved: " + error.message() : " and was moved to " + aside.string();
  }

  const StateDirectory& state_;
  const bool repair_;
  CheckReport report_;
  std::map<std::string, std::string> references_;  ///< A job that refers to it, by digest.
  std::set<std::string> whole_;
};

}  // namespace

Expected<CheckReport> check_state(const std::string& directory, bool repair) {
  if (!std::filesystem::exists(std::filesystem::path(directory) / "jobs.sqlite"))
    return tl::unexpected(Error{Error::Kind::Output, "'" + directory +
                                                         "' holds no jobs of a server; name the directory that the "
                                                         "server has as --state."});
  const auto state = StateDirectory::take(directory);
  if (!state) return tl::unexpected(state.error());
  return Checker(**state, repair).run();
}

}  // namespace varimesh::server
