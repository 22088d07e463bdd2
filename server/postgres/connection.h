// A connection to PostgreSQL, and what is sent and received over it. Errors are thrown as PostgresError, which
// the JobDatabase catches.
#pragma once

#include <libpq-fe.h>

#include <chrono>
#include <cstdint>
#include <exception>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "server/jobs/job_store.h"
#include "server/jobs/sql.h"

namespace varimesh::server {

/// An error of PostgreSQL or of the connection to it.
class PostgresError : public std::exception {
 public:
  enum class Kind {
    Lost,   ///< The database cannot be reached, or is starting or stopping. The open transaction has no effect.
    Retry,  ///< The transaction met another one and has no effect; it can be repeated at once.
    Full,   ///< The database's disk is full.
    Other
  };
  PostgresError(Kind kind, std::string what) : kind_(kind), what_(std::move(what)) {}
  const char* what() const noexcept override { return what_.c_str(); }
  Kind kind() const { return kind_; }

 private:
  Kind kind_;
  std::string what_;
};

/// The rows that a statement has returned.
class PostgresRows {
 public:
  explicit PostgresRows(PGresult* result) : result_(result) {}

  int count() const { return PQntuples(result_.get()); }
  std::int64_t number(int row, int column) const;
  bool is_null(int row, int column) const { return PQgetisnull(result_.get(), row, column) != 0; }
  /// Text or bytes, valid as long as this object.
  std::string_view view(int row, int column) const;
  std::string text(int row, int column) const { return std::string(view(row, column)); }

 private:
  struct Clear {
    void operator()(PGresult* result) const { PQclear(result); }
  };
  std::unique_ptr<PGresult, Clear> result_;
};

/// A connection to a database. One thread at a time.
class PostgresConnection : public Sql {
 public:
  /// `url`: postgresql://…, or keywords and values as libpq reads them. Passwords come from libpq's usual places:
  /// PGPASSFILE, ~/.pgpass or PGPASSWORD.
  explicit PostgresConnection(const std::string& url);

  const SqlDialect& dialect() const override;
  void ask(const std::string& statement, const SqlValues& values, const std::function<void(const SqlRow&)>& take,
           Statement kind) override;
  /// Runs a statement that is prepared once and kept.
  PostgresRows query(const std::string& statement, const SqlValues& values = {});
  /// Runs a statement that is prepared for this call only, for statements with many variants.
  PostgresRows query_once(const std::string& statement, const SqlValues& values = {});
  /// Runs statements without parameters, and returns the rows of the last one.
  PostgresRows run(const std::string& statements);

  /// Waits for notifications, and returns their texts; none if none came in time.
  std::vector<std::string> wait_for_news(std::chrono::milliseconds most);

  /// Whether the connection can be used no more.
  bool broken() const { return connection_ == nullptr || PQstatus(connection_.get()) != CONNECTION_OK; }

 private:
  PostgresRows result(const std::string& statement);
  /// Waits until the connection can be read (or written). Closes it and throws if nothing happens for too long.
  void wait(bool for_writing);
  [[noreturn]] void fail(const std::string& what);
  [[noreturn]] void lose(const std::string& what);

  struct Close {
    void operator()(PGconn* connection) const { PQfinish(connection); }
  };
  std::unique_ptr<PGconn, Close> connection_;
  std::map<std::string, std::string, std::less<>> prepared_;  ///< The names of the kept statements.
};

/// A transaction that is rolled back unless it is committed.
class PostgresTransaction {
 public:
  explicit PostgresTransaction(PostgresConnection& connection);
  ~PostgresTransaction();
  PostgresTransaction(const PostgresTransaction&) = delete;
  PostgresTransaction& operator=(const PostgresTransaction&) = delete;

  PostgresConnection& connection() { return connection_; }
  /// The time on the database's clock, at which the transaction began.
  TimePoint time() const { return time_; }
  /// The number by which the database can be asked later whether the transaction was committed.
  std::int64_t number() const { return number_; }
  /// Whether commit() was called, so that only the database knows the outcome if the connection was lost.
  bool committing() const { return committing_; }
  void commit();

 private:
  PostgresConnection& connection_;
  TimePoint time_;
  std::int64_t number_ = 0;
  bool open_ = true, committing_ = false;
};

}  // namespace varimesh::server
