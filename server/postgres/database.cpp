// Checks the address, and opens the store.
#include "server/postgres/database.h"

#include <libpq-fe.h>

#include <cstdlib>
#include <sstream>

#include "server/addresses.h"
#include "server/postgres/connection.h"
#include "server/postgres/postgres_jobs.h"
#include "server/postgres/schema.h"

namespace varimesh::server {
namespace {

Error output(const std::string& sentence) { return {Error::Kind::Output, sentence}; }

Error unreachable(const std::string& why) {
  return output("The database cannot be used (" + why + "); check that it runs, and the address of --store.");
}

/// What libpq takes for a keyword: from the address, or from the environment.
std::string value_of(const PQconninfoOption* options, std::string_view keyword) {
  for (const PQconninfoOption* option = options; option->keyword != nullptr; ++option) {
    if (option->keyword != keyword) continue;
    const char* const value =
        option->val != nullptr || option->envvar == nullptr ? option->val : std::getenv(option->envvar);
    return value == nullptr ? "" : value;
  }
  return {};
}

/// Whether other machines may see what is sent to one of these hosts, which commas separate. Sockets are paths.
bool leaves_machine(const std::string& hosts) {
  std::istringstream list(hosts);
  for (std::string host; std::getline(list, host, ',');)
    if (!host.empty() && host[0] != '/' && host[0] != '@' && !is_loopback(host + ":0")) return true;
  return false;
}

/// Whether nobody has said if a connection to another machine is to be encrypted. libpq would then go on without.
bool leaves_encryption_open(const PQconninfoOption* options) {
  return value_of(options, "sslmode").empty() &&
         (leaves_machine(value_of(options, "host")) || leaves_machine(value_of(options, "hostaddr")));
}

}  // namespace

bool is_postgres(const std::string& address) {
  return address.rfind("postgresql://", 0) == 0 || address.rfind("postgres://", 0) == 0;
}

Expected<void> check_postgres(const std::string& address) {
  const auto refuse = [](std::string sentence) {
    return tl::unexpected(Error{Error::Kind::BadOption, std::move(sentence)});
  };
  // The address is not repeated in the message, since it may contain a password.
  char* why = nullptr;
  PQconninfoOption* const options = is_postgres(address) ? PQconninfoParse(address.c_str(), &why) : nullptr;
  PQfreemem(why);
  if (options == nullptr)
    return refuse("--store needs the address of a PostgreSQL database, such as postgresql://user@host/database.");
  bool has_password = false;
  for (const PQconninfoOption* option = options; option->keyword != nullptr; ++option)
    if (std::string_view(option->keyword).ends_with("password") && option->val != nullptr) has_password = true;
  const bool leaves_open = leaves_encryption_open(options);
  PQconninfoFree(options);
  if (has_password)
    return refuse(
        "The address of --store contains a password, which every user of this machine can read in the list of "
        "processes; put it into a file that PGPASSFILE names, or into PGPASSWORD.");
  if (leaves_open)
    return refuse(
        "The address of --store does not say whether the way to the database is encrypted; add ?sslmode=require, or "
        "?sslmode=verify-full to check its certificate as well, or ?sslmode=disable if nobody else can reach this "
        "way.");
  return {};
}

Expected<std::unique_ptr<JobStore>> open_postgres(const std::string& address, const JobStoreSettings& settings,
                                                  std::function<void(const std::string& line)> log) {
  try {
    const PostgresConnection connection(address);  // an error says why, which a failed call of the store does not
  } catch (const PostgresError& error) {
    return tl::unexpected(unreachable(error.what()));
  }
  PostgresSettings where;
  where.url = address;
  where.log = std::move(log);
  auto store = open_postgres_jobs(where, settings);
  if (!store) return tl::unexpected(output(store.error().sentence));
  return std::move(*store);
}

Expected<std::string> migrate_postgres(const std::string& address) {
  try {
    PostgresConnection connection(address);
    const auto before = migrate_postgres(connection);
    if (!before) return tl::unexpected(output(before.error().sentence));
    const std::string now = std::to_string(kPostgresVersion);
    if (*before == kPostgresVersion) return "The tables of the database have version " + now + " already.";
    if (*before == 0) return "Made the tables of the database, version " + now + ".";
    return "Updated the tables of the database from version " + std::to_string(*before) + " to " + now + ".";
  } catch (const PostgresError& error) {
    return tl::unexpected(unreachable(error.what()));
  }
}

}  // namespace varimesh::server
