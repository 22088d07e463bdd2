// SQLite with its resources tied to objects and its errors thrown; whoever uses it catches them at its own door.
#pragma once

#include <sqlite3.h>

#include <cstdint>
#include <exception>
#include <map>
#include <memory>
#include <string>
#include <string_view>

namespace varimesh::server {

/// What SQLite could not do.
class SqliteError : public std::exception {
 public:
  SqliteError(sqlite3* database, const std::string& what);
  const char* what() const noexcept override { return what_.c_str(); }
  /// The disk, or the share of it that is ours, is full.
  bool disk_full() const { return disk_full_; }

 private:
  std::string what_;
  bool disk_full_ = false;
};

/// Bytes, where a string would be text.
struct SqliteBytes {
  std::string_view bytes;
};

/// One run of a statement; resets it when it goes, or finalises it where nobody else has it.
class SqliteQuery {
 public:
  enum class Statement { Kept, Own };
  SqliteQuery(sqlite3* database, sqlite3_stmt* statement, Statement kind)
      : database_(database), statement_(statement), kind_(kind) {}
  ~SqliteQuery();
  SqliteQuery(const SqliteQuery&) = delete;
  SqliteQuery& operator=(const SqliteQuery&) = delete;

  /// Binds the next parameter. What it views must live until the query is over.
  SqliteQuery& bind(std::int64_t value);
  SqliteQuery& bind(std::string_view text);
  SqliteQuery& bind(SqliteBytes bytes);
  SqliteQuery& bind_null();
  /// False at the end.
  bool step();
  void run() { step(); }

  std::int64_t number(int column) const { return sqlite3_column_int64(statement_, column); }
  bool is_null(int column) const { return sqlite3_column_type(statement_, column) == SQLITE_NULL; }
  /// Text or bytes; valid until the next step.
  std::string_view view(int column) const;
  std::string text(int column) const { return std::string(view(column)); }

 private:
  void check(int result) const;

  sqlite3* const database_;
  sqlite3_stmt* const statement_;
  const Statement kind_;
  int parameter_ = 0;
};

/// A connection. One thread at a time.
class SqliteDatabase {
 public:
  /// Makes the file, for its owner alone, where it is not there.
  explicit SqliteDatabase(const std::string& path);

  /// Runs statements that give nothing back.
  void run(const char* statements);
  /// Statements are prepared once and kept.
  SqliteQuery query(std::string_view statement);
  /// For statements of which there are many: prepared anew each time.
  SqliteQuery query_once(std::string_view statement);
  std::int64_t last_key() const { return sqlite3_last_insert_rowid(database_.get()); }
  int changes() const { return sqlite3_changes(database_.get()); }

 private:
  sqlite3_stmt* prepare(std::string_view statement, unsigned flags);

  struct Close {
    void operator()(sqlite3* database) const { sqlite3_close(database); }
  };
  struct Finalise {
    void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
  };
  std::unique_ptr<sqlite3, Close> database_;
  std::map<std::string, std::unique_ptr<sqlite3_stmt, Finalise>, std::less<>> statements_;
};

/// Writes all or nothing: rolled back unless committed.
class SqliteTransaction {
 public:
  explicit SqliteTransaction(SqliteDatabase& database) : database_(database) { database_.run("BEGIN IMMEDIATE"); }
  ~SqliteTransaction();
  SqliteTransaction(const SqliteTransaction&) = delete;
  SqliteTransaction& operator=(const SqliteTransaction&) = delete;
  void commit();

 private:
  SqliteDatabase& database_;
  bool open_ = true;
};

}  // namespace varimesh::server
