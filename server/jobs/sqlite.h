// SQLite with objects that own its resources. Errors are thrown as SqliteError, which the JobDatabase catches.
#pragma once

#include <sqlite3.h>

#include <cstdint>
#include <exception>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "server/jobs/sql.h"

namespace varimesh::server {

/// An error of SQLite.
class SqliteError : public std::exception {
 public:
  SqliteError(sqlite3* database, const std::string& what);
  const char* what() const noexcept override { return what_.c_str(); }
  /// Whether the disk, or this user's quota, is full.
  bool disk_full() const { return disk_full_; }

 private:
  std::string what_;
  bool disk_full_ = false;
};

/// Marks bytes as a BLOB; a plain string is bound as TEXT.
struct SqliteBytes {
  std::string_view bytes;
};

/// One execution of a statement. The destructor resets the statement, or finalises it if this object owns it.
class SqliteQuery : public SqlRow {
 public:
  enum class Statement { Kept, Own };
  SqliteQuery(sqlite3* database, sqlite3_stmt* statement, Statement kind)
      : database_(database), statement_(statement), kind_(kind) {}
  ~SqliteQuery() override;
  SqliteQuery(const SqliteQuery&) = delete;
  SqliteQuery& operator=(const SqliteQuery&) = delete;

  /// Binds the next parameter. The bytes of a view must stay valid until the query is destroyed.
  SqliteQuery& bind(std::int64_t value);
  SqliteQuery& bind(std::string_view text);
  SqliteQuery& bind(SqliteBytes bytes);
  SqliteQuery& bind_null();
  /// Moves to the next row. Returns false after the last one.
  bool step();
  void run() { step(); }

  /// Binds the parameters $1, $2, …, in any order of the statement. They must stay valid until the query is destroyed.
  SqliteQuery& bind_all(const SqlValues& values);

  std::int64_t number(int column) const override { return sqlite3_column_int64(statement_, column); }
  bool is_null(int column) const override { return sqlite3_column_type(statement_, column) == SQLITE_NULL; }
  std::string_view view(int column) const override;

 private:
  void check(int result) const;

  sqlite3* const database_;
  sqlite3_stmt* const statement_;
  const Statement kind_;
  int parameter_ = 0;
};

/// A connection to a database. One thread at a time.
class SqliteDatabase : public Sql {
 public:
  /// Creates the file, accessible only to its owner, if it does not exist. `path` must not lead through a symbolic
  /// link. Empty: the database is in memory, and ends with this object.
  explicit SqliteDatabase(const std::string& path);

  const SqlDialect& dialect() const override;
  void ask(const std::string& statement, const SqlValues& values, const std::function<void(const SqlRow&)>& take,
           Statement kind) override;

  /// Runs statements without results.
  void run(const char* statements);
  /// Runs a statement that is prepared once and kept.
  SqliteQuery query(std::string_view statement);
  /// Runs a statement that is prepared for this call only, for statements with many variants.
  SqliteQuery query_once(std::string_view statement);
  /// Copies the whole database, as it is at one moment, over another one, also while other processes write to it.
  void copy_to(SqliteDatabase& target);

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

/// A transaction that is rolled back unless it is committed.
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
