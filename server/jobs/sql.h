// SQL as the job store needs it. The store sends the same statements to SQLite and PostgreSQL; SqlDialect has what must
// differ. Errors are thrown as SqliteError and PostgresError, which the JobDatabase catches.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace varimesh::server {

/// The parameters $1, $2, … of a statement.
class SqlValues {
 public:
  struct Value {
    enum class Kind { Null, Number, Text, Bytes };
    Kind kind = Kind::Null;
    std::int64_t number = 0;
    std::string bytes = {};  ///< Of Text and Bytes.
  };

  SqlValues& add(std::int64_t number) {
    values_.push_back({Value::Kind::Number, number});
    return *this;
  }
  SqlValues& add(std::string_view text) {
    values_.push_back({Value::Kind::Text, 0, std::string(text)});
    return *this;
  }
  SqlValues& add_bytes(std::string bytes) {
    values_.push_back({Value::Kind::Bytes, 0, std::move(bytes)});
    return *this;
  }
  SqlValues& add_null() {
    values_.push_back({});
    return *this;
  }
  const std::vector<Value>& all() const { return values_; }

 private:
  std::vector<Value> values_;
};

/// A row that a statement has returned, valid until the next one. Columns count from 0.
class SqlRow {
 public:
  virtual ~SqlRow() = default;
  virtual std::int64_t number(int column) const = 0;
  virtual bool is_null(int column) const = 0;
  /// Text or bytes.
  virtual std::string_view view(int column) const = 0;
  std::string text(int column) const { return std::string(view(column)); }
};

/// What the job store must say differently.
struct SqlDialect {
  bool shared = false;  ///< Other processes use the database at the same time.
  /// Rows have check sums: nobody else finds flipped bits. Otherwise jobs have the column cancel_unseen.
  bool sums = false;
  const char* lock = "";                 ///< At the end of a SELECT of jobs that are about to be changed.
  const char* lock_or_skip = "";         ///< The same, without the jobs that another process is changing.
  const char* waiting = "jobs";          ///< The table of jobs, for a search of those that wait.
  const char* take_turn = "";            ///< Notes in the table turns that it was the turn of the peer $1.
  const char* lock_claims = "SELECT 1";  ///< Lets only one transaction at a time claim a job.
  const char* now = "0";                 ///< The time of the database, in nanoseconds since 1970.
  const char* started = "";              ///< Selects when the database was started, in nanoseconds since 1970.
  const char* referenced = "";  ///< Of the digests $1, each with a comma behind it, selects those that jobs refer to.
};

/// A connection to a database. One thread at a time.
class Sql {
 public:
  enum class Statement { Kept, Once };  ///< Whether the statement stays prepared: not if it has many variants.

  virtual ~Sql() = default;
  virtual const SqlDialect& dialect() const = 0;
  /// Runs a statement and calls `take` for each row of its result.
  virtual void ask(const std::string& statement, const SqlValues& values = {},
                   const std::function<void(const SqlRow&)>& take = {}, Statement kind = Statement::Kept) = 0;
  /// Returns the first column of the last row; 0 if there is no row.
  std::int64_t number(const std::string& statement, const SqlValues& values = {}) {
    std::int64_t number = 0;
    ask(statement, values, [&](const SqlRow& row) { number = row.number(0); });
    return number;
  }
};

}  // namespace varimesh::server
