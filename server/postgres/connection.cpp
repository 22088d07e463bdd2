// Wraps the functions of libpq that the job store needs.
#include "server/postgres/connection.h"

#include <poll.h>

#include <algorithm>
#include <cerrno>

namespace varimesh::server {
namespace {

/// How long the database may take to answer a statement. Its own limit, statement_timeout, is shorter.
constexpr std::chrono::seconds kAnswer{15};

using Kind = PostgresError::Kind;

Kind kind_of(std::string_view state) {
  const auto begins = [&](std::string_view prefix) { return state.substr(0, prefix.size()) == prefix; };
  if (state == "40001" || state == "40P01" || state == "55P03") return Kind::Retry;  // deadlock, a lock that is held
  if (state == "53100") return Kind::Full;                                           // disk full
  // Broken connections, no more connections, shutting down or starting, a standby, and statements that took too long.
  if (begins("08") || begins("57P") || state == "53300" || state == "25006" || state == "25P03" || state == "57014")
    return Kind::Lost;
  return Kind::Other;
}

/// Returns the message on one line.
std::string one_line(const char* message) {
  std::string line = message == nullptr ? "" : message;
  while (!line.empty() && (line.back() == '\n' || line.back() == ' ')) line.pop_back();
  std::replace(line.begin(), line.end(), '\n', ' ');
  return line;
}

}  // namespace

// ===== values and rows =====

namespace {

/// Values as libpq takes them. Texts point into the values.
struct Arrays {
  explicit Arrays(const SqlValues& values) {
    using Value = SqlValues::Value;
    numbers.reserve(values.all().size());
    for (const Value& value : values.all()) {
      const bool is_number = value.kind == Value::Kind::Number;
      if (is_number) numbers.push_back(std::to_string(value.number));
      const std::string& sent = is_number ? numbers.back() : value.bytes;
      bytes.push_back(value.kind == Value::Kind::Null ? nullptr : sent.data());
      lengths.push_back(static_cast<int>(sent.size()));
      formats.push_back(is_number ? 0 : 1);
    }
  }
  int count() const { return static_cast<int>(bytes.size()); }

  std::vector<std::string> numbers;
  std::vector<const char*> bytes;
  std::vector<int> lengths, formats;
};

/// One of the rows, as the job store reads it.
class Row : public SqlRow {
 public:
  Row(const PostgresRows& rows, int at) : rows_(rows), at_(at) {}
  std::int64_t number(int column) const override { return rows_.number(at_, column); }
  bool is_null(int column) const override { return rows_.is_null(at_, column); }
  std::string_view view(int column) const override { return rows_.view(at_, column); }

 private:
  const PostgresRows& rows_;
  const int at_;
};

constexpr SqlDialect kDialect{
    .shared = true,
    .lock = " FOR UPDATE OF jobs",
    .lock_or_skip = " FOR UPDATE OF jobs SKIP LOCKED",
    // Waits for no other worker: one that notes a turn of the same peer at this moment does it for both.
    .take_turn =
        "WITH mine AS (SELECT peer FROM turns WHERE peer = $1 FOR UPDATE SKIP LOCKED), "
        "noted AS (UPDATE turns SET served = nextval('turn_numbers') FROM mine WHERE turns.peer = mine.peer) "
        "INSERT INTO turns SELECT $1, nextval('turn_numbers') WHERE NOT EXISTS(SELECT 1 FROM turns WHERE peer = $1) "
        "ON CONFLICT DO NOTHING",
    .lock_claims = "SELECT pg_advisory_xact_lock(hashtext('varimesh claim'))",
    .now = "(extract(epoch FROM clock_timestamp()) * 1000000)::bigint * 1000",
    .started = "SELECT (extract(epoch FROM pg_postmaster_start_time()) * 1000000)::bigint * 1000",
    .referenced =
        "SELECT digest FROM unnest(string_to_array($1::text, ',')) AS asked(digest) "
        "WHERE EXISTS(SELECT 1 FROM needs WHERE needs.digest = asked.digest)"};

}  // namespace

std::string_view PostgresRows::view(int row, int column) const {
  return {PQgetvalue(result_.get(), row, column), static_cast<std::size_t>(PQgetlength(result_.get(), row, column))};
}

std::int64_t PostgresRows::number(int row, int column) const {
  const std::string_view bytes = view(row, column);
  if (PQfformat(result_.get(), column) == 0) return bytes.empty() ? 0 : std::stoll(std::string(bytes));
  std::uint64_t bits = 0;  // the most significant byte comes first
  for (const char byte : bytes) bits = bits << 8 | static_cast<unsigned char>(byte);
  if (bytes.size() == 4) return static_cast<std::int32_t>(bits);
  return static_cast<std::int64_t>(bits);
}

// ===== connection =====

PostgresConnection::PostgresConnection(const std::string& url) {
  // The values before `dbname` are defaults, which the address can replace.
  const char* const keywords[] = {
      "fallback_application_name", "connect_timeout",      "keepalives_idle", "keepalives_interval", "keepalives_count",
      "tcp_user_timeout",          "target_session_attrs", "dbname",          "client_encoding",     nullptr};
  const char* const values[] = {"varimeshd", "3", "10", "3", "3", "10000", "read-write", url.c_str(), "UTF8", nullptr};
  connection_.reset(PQconnectdbParams(keywords, values, 1));
  if (connection_ == nullptr) throw PostgresError(Kind::Other, "out of memory");
  if (PQstatus(connection_.get()) != CONNECTION_OK)
    throw PostgresError(Kind::Lost, one_line(PQerrorMessage(connection_.get())));
  PQsetNoticeProcessor(
      connection_.get(), [](void*, const char*) {}, nullptr);
  PQsetnonblocking(connection_.get(), 1);
  // A process that is stopped in the middle of a transaction must not hold its locks for ever.
  run("SET statement_timeout = '10s'; SET lock_timeout = '5s'; SET idle_in_transaction_session_timeout = '10s'");
}

void PostgresConnection::lose(const std::string& what) {
  connection_.reset();
  throw PostgresError(Kind::Lost, what);
}

void PostgresConnection::fail(const std::string& what) {
  const std::string message = what.empty() ? one_line(PQerrorMessage(connection_.get())) : what;
  if (PQstatus(connection_.get()) != CONNECTION_OK) lose(message);
  throw PostgresError(Kind::Other, message);
}

void PostgresConnection::wait(bool for_writing) {
  pollfd waited{PQsocket(connection_.get()), static_cast<short>(for_writing ? POLLIN | POLLOUT : POLLIN), 0};
  const auto end = std::chrono::steady_clock::now() + kAnswer;
  while (true) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    const int ready = ::poll(&waited, 1, static_cast<int>(std::max<std::int64_t>(left.count(), 0)));
    if (ready > 0) return;
    if (ready < 0 && errno == EINTR) continue;
    lose("the database does not answer");
  }
}

PostgresRows PostgresConnection::result(const std::string& statement) {
  for (int left = PQflush(connection_.get()); left != 0; left = PQflush(connection_.get())) {
    if (left < 0) fail({});
    wait(true);
    if (PQconsumeInput(connection_.get()) == 0) fail({});
  }
  PostgresRows last(nullptr);
  std::string state, message;
  while (true) {
    while (PQisBusy(connection_.get()) != 0) {
      wait(false);
      if (PQconsumeInput(connection_.get()) == 0) fail({});
    }
    PGresult* one = PQgetResult(connection_.get());
    if (one == nullptr) break;
    const ExecStatusType status = PQresultStatus(one);
    if (status != PGRES_TUPLES_OK && status != PGRES_COMMAND_OK && message.empty()) {
      const char* code = PQresultErrorField(one, PG_DIAG_SQLSTATE);
      state = code == nullptr ? "" : code;
      message = one_line(PQresultErrorMessage(one)) + " (" + statement.substr(0, 40) + ")";
    }
    last = PostgresRows(one);
  }
  if (message.empty()) return last;
  if (PQstatus(connection_.get()) != CONNECTION_OK) lose(message);
  throw PostgresError(kind_of(state), message);
}

PostgresRows PostgresConnection::run(const std::string& statements) {
  if (broken()) lose("the connection to the database was lost");
  if (PQsendQuery(connection_.get(), statements.c_str()) == 0) fail({});
  return result(statements);
}

PostgresRows PostgresConnection::query(const std::string& statement, const SqlValues& values) {
  if (broken()) lose("the connection to the database was lost");
  auto found = prepared_.find(statement);
  if (found == prepared_.end()) {
    const std::string name = "s" + std::to_string(prepared_.size());
    if (PQsendPrepare(connection_.get(), name.c_str(), statement.c_str(), 0, nullptr) == 0) fail({});
    result(statement);
    found = prepared_.emplace(statement, name).first;
  }
  const Arrays sent(values);
  if (PQsendQueryPrepared(connection_.get(), found->second.c_str(), sent.count(), sent.bytes.data(),
                          sent.lengths.data(), sent.formats.data(), 1) == 0)
    fail({});
  return result(statement);
}

const SqlDialect& PostgresConnection::dialect() const { return kDialect; }

void PostgresConnection::ask(const std::string& statement, const SqlValues& values,
                             const std::function<void(const SqlRow&)>& take, Statement kind) {
  const PostgresRows rows = kind == Statement::Kept ? query(statement, values) : query_once(statement, values);
  for (int i = 0; take && i < rows.count(); ++i) take(Row(rows, i));
}

PostgresRows PostgresConnection::query_once(const std::string& statement, const SqlValues& values) {
  if (broken()) lose("the connection to the database was lost");
  const Arrays sent(values);
  if (PQsendQueryParams(connection_.get(), statement.c_str(), sent.count(), nullptr, sent.bytes.data(),
                        sent.lengths.data(), sent.formats.data(), 1) == 0)
    fail({});
  return result(statement);
}

std::vector<std::string> PostgresConnection::wait_for_news(std::chrono::milliseconds most) {
  if (broken()) lose("the connection to the database was lost");
  pollfd waited{PQsocket(connection_.get()), POLLIN, 0};
  if (::poll(&waited, 1, static_cast<int>(most.count())) > 0 && PQconsumeInput(connection_.get()) == 0) fail({});
  std::vector<std::string> texts;
  while (PGnotify* const news = PQnotifies(connection_.get())) {
    texts.emplace_back(news->extra);
    PQfreemem(news);
  }
  return texts;
}

// ===== transaction =====

PostgresTransaction::PostgresTransaction(PostgresConnection& connection) : connection_(connection) {
  const PostgresRows begun = connection_.run(
      "BEGIN; SELECT (extract(epoch FROM clock_timestamp()) * 1000000)::bigint, pg_current_xact_id()::text::bigint");
  time_ = TimePoint(std::chrono::duration_cast<TimePoint::duration>(std::chrono::microseconds(begun.number(0, 0))));
  number_ = begun.number(0, 1);
}

PostgresTransaction::~PostgresTransaction() {
  if (!open_ || connection_.broken()) return;
  try {
    connection_.run("ROLLBACK");
  } catch (const PostgresError&) {
    // The database rolls back when it sees that the connection is closed.
  }
}

void PostgresTransaction::commit() {
  committing_ = true;
  connection_.run("COMMIT");
  open_ = false;
}

}  // namespace varimesh::server
