// Wraps the functions of SQLite that the job store needs.
#include "server/jobs/sqlite.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>

namespace varimesh::server {

SqliteError::SqliteError(sqlite3* database, const std::string& what)
    : what_(what + ": " + (database != nullptr ? sqlite3_errmsg(database) : "out of memory")) {
  if (database == nullptr) return;
  const int reason = sqlite3_system_errno(database);
  disk_full_ = sqlite3_errcode(database) == SQLITE_FULL ||
               (sqlite3_errcode(database) == SQLITE_IOERR && (reason == ENOSPC || reason == EDQUOT));
}

// ===== query =====

SqliteQuery::~SqliteQuery() {
  if (kind_ == Statement::Own) {
    sqlite3_finalize(statement_);
    return;
  }
  sqlite3_reset(statement_);
  sqlite3_clear_bindings(statement_);
}

void SqliteQuery::check(int result) const {
  if (result != SQLITE_OK) throw SqliteError(database_, sqlite3_sql(statement_));
}

SqliteQuery& SqliteQuery::bind(std::int64_t value) {
  check(sqlite3_bind_int64(statement_, ++parameter_, value));
  return *this;
}

SqliteQuery& SqliteQuery::bind(std::string_view text) {
  check(sqlite3_bind_text64(statement_, ++parameter_, text.data() == nullptr ? "" : text.data(), text.size(),
                            SQLITE_STATIC, SQLITE_UTF8));
  return *this;
}

SqliteQuery& SqliteQuery::bind(SqliteBytes bytes) {
  check(sqlite3_bind_blob64(statement_, ++parameter_, bytes.bytes.data() == nullptr ? "" : bytes.bytes.data(),
                            bytes.bytes.size(), SQLITE_STATIC));
  return *this;
}

SqliteQuery& SqliteQuery::bind_null() {
  check(sqlite3_bind_null(statement_, ++parameter_));
  return *this;
}

SqliteQuery& SqliteQuery::bind_all(const SqlValues& values) {
  int number = 0;
  for (const SqlValues::Value& value : values.all()) {
    parameter_ = sqlite3_bind_parameter_index(statement_, ("$" + std::to_string(++number)).c_str()) - 1;
    switch (value.kind) {
      case SqlValues::Value::Kind::Null:
        bind_null();
        break;
      case SqlValues::Value::Kind::Number:
        bind(value.number);
        break;
      case SqlValues::Value::Kind::Text:
        bind(value.bytes);
        break;
      case SqlValues::Value::Kind::Bytes:
        bind(SqliteBytes{value.bytes});
        break;
    }
  }
  return *this;
}

bool SqliteQuery::step() {
  const int result = sqlite3_step(statement_);
  if (result == SQLITE_ROW) return true;
  if (result != SQLITE_DONE) throw SqliteError(database_, sqlite3_sql(statement_));
  return false;
}

std::string_view SqliteQuery::view(int column) const {
  const auto* data = static_cast<const char*>(sqlite3_column_blob(statement_, column));
  return {data, data == nullptr ? 0 : static_cast<std::size_t>(sqlite3_column_bytes(statement_, column))};
}

// ===== database =====

SqliteDatabase::SqliteDatabase(const std::string& path) {
  // SQLite would make the file readable for everybody, and gives the files beside it the same permissions. A file that
  // exists is not opened here, since closing it would release the locks of this process's other connections.
  if (const int made =
          path.empty() ? -1 : ::open(path.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC | O_NOFOLLOW, 0600);
      made >= 0)
    ::close(made);
  sqlite3* opened = nullptr;
  const int result =
      sqlite3_open_v2(path.empty() ? ":memory:" : path.c_str(), &opened,
                      SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_NOFOLLOW, nullptr);
  database_.reset(opened);
  if (result != SQLITE_OK) throw SqliteError(opened, path);
  sqlite3_busy_timeout(opened, 10'000);
}

const SqlDialect& SqliteDatabase::dialect() const {
  static const SqlDialect dialect{.sums = true,
                                  .waiting = "jobs INDEXED BY jobs_waiting_of",
                                  .take_turn = "INSERT OR REPLACE INTO turns(peer) VALUES($1)"};
  return dialect;
}

void SqliteDatabase::ask(const std::string& statement, const SqlValues& values,
                         const std::function<void(const SqlRow&)>& take, Statement kind) {
  SqliteQuery query = kind == Statement::Kept ? this->query(statement) : query_once(statement);
  query.bind_all(values);
  while (query.step())
    if (take) take(query);
}

void SqliteDatabase::run(const char* statements) {
  if (sqlite3_exec(database_.get(), statements, nullptr, nullptr, nullptr) != SQLITE_OK)
    throw SqliteError(database_.get(), statements);
}

sqlite3_stmt* SqliteDatabase::prepare(std::string_view statement, unsigned flags) {
  sqlite3_stmt* prepared = nullptr;
  if (sqlite3_prepare_v3(database_.get(), statement.data(), static_cast<int>(statement.size()), flags, &prepared,
                         nullptr) != SQLITE_OK)
    throw SqliteError(database_.get(), std::string(statement));
  return prepared;
}

SqliteQuery SqliteDatabase::query(std::string_view statement) {
  auto found = statements_.find(statement);
  if (found == statements_.end())
    found = statements_.emplace(statement, prepare(statement, SQLITE_PREPARE_PERSISTENT)).first;
  return {database_.get(), found->second.get(), SqliteQuery::Statement::Kept};
}

SqliteQuery SqliteDatabase::query_once(std::string_view statement) {
  return {database_.get(), prepare(statement, 0), SqliteQuery::Statement::Own};
}

void SqliteDatabase::copy_to(SqliteDatabase& target) {
  sqlite3_backup* const copy = sqlite3_backup_init(target.database_.get(), "main", database_.get(), "main");
  if (copy == nullptr) throw SqliteError(target.database_.get(), "backup");
  const int result = sqlite3_backup_step(copy, -1);
  sqlite3_backup_finish(copy);  // sets the error of the target
  if (result != SQLITE_DONE) throw SqliteError(target.database_.get(), "backup");
}

// ===== transaction =====

SqliteTransaction::~SqliteTransaction() {
  if (!open_) return;
  try {
    database_.run("ROLLBACK");
  } catch (const SqliteError&) {
    // SQLite has already rolled back, for instance because the disk is full.
  }
}

void SqliteTransaction::commit() {
  database_.run("COMMIT");
  open_ = false;
}

}  // namespace varimesh::server
