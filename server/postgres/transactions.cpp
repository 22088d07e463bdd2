// Repeats transactions, and finds out their outcome.
#include "server/postgres/transactions.h"

#include <algorithm>
#include <thread>

#include "server/postgres/rows.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

using Kind = PostgresError::Kind;

Refusal refusal_of(const PostgresError& error) {
  switch (error.kind()) {
    case Kind::Lost:
    case Kind::Retry:
      return store_unavailable();
    case Kind::Full:
      return store_full("The database's disk has no room for the job");
    case Kind::Other:
      break;
  }
  return internal_failure("The job store failed; the log of the server says why.");
}

void tell(const PostgresWork& committed) {
  if (committed.news.empty()) return;
  try {
    postgres::notify(committed.connection, committed.news);
  } catch (const PostgresError&) {
    // The others look at the database by themselves, only later.
  }
}

}  // namespace

std::optional<Failure> PostgresTransactions::with_connection(const std::function<void(PostgresConnection&)>& work,
                                                             std::chrono::milliseconds patience) {
  const SteadyTime start = std::chrono::steady_clock::now();
  // When the database is known to be away, the call fails at its first try.
  const SteadyTime end = pool_.lost_since().value_or(start) + patience;
  for (std::chrono::milliseconds pause{20};; pause = std::min(pause * 2, std::chrono::milliseconds(500))) {
    try {
      auto lent = pool_.take(start + patience);
      work(*lent);
      if (!(*lent).broken()) pool_.note_reached();
      return std::nullopt;
    } catch (const PostgresError& error) {
      const bool again = error.kind() == Kind::Lost || error.kind() == Kind::Retry;
      if (!again || std::chrono::steady_clock::now() + pause >= end) {
        if (error.kind() == Kind::Other) where_.log(std::string("the job store failed: ") + error.what());
        return refusal_of(error).value();
      }
    }
    std::this_thread::sleep_for(pause);
  }
}

std::optional<Failure> PostgresTransactions::with_transaction(const std::function<bool(PostgresWork&)>& work,
                                                              Outcome outcome) {
  const auto patience = outcome == Outcome::CanBeSkipped ? std::chrono::milliseconds(0) : where_.patience;
  while (true) {
    std::optional<std::int64_t> unknown;
    const auto failed = with_connection(
        [&](PostgresConnection& connection) {
          PostgresTransaction open(connection);
          JobStoreSettings settings = settings_;
          if (!settings.clock) settings.clock = [now = open.time()] { return now; };
          PostgresWork transaction{connection, JobTransitions(settings)};
          if (!work(transaction)) return;
          try {
            open.commit();
          } catch (const PostgresError& error) {
            if (error.kind() != Kind::Lost) throw;
            unknown = open.number();
            return;
          }
          tell(transaction);
        },
        patience);
    if (failed) return failed;
    if (!unknown) return std::nullopt;
    const auto committed = was_committed(*unknown, outcome);
    if (!committed) return store_unavailable().value();
    if (*committed) return std::nullopt;
  }
}

std::optional<bool> PostgresTransactions::was_committed(std::int64_t number, Outcome outcome) {
  while (true) {
    std::optional<bool> committed;
    const auto failed = with_connection([&](PostgresConnection& connection) {
      const PostgresRows rows =
          connection.query("SELECT pg_xact_status($1::bigint::text::xid8)", PostgresValues().add(number));
      if (rows.view(0, 0) != "in progress") committed = rows.view(0, 0) == "committed";
    });
    if (committed) return committed;
    if (outcome == Outcome::CanBeSkipped || (failed && (outcome == Outcome::CanBeAskedAgain || stops_)))
      return std::nullopt;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
}

}  // namespace varimesh::server
