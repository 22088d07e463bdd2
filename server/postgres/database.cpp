// Checks the address, and opens the store.
#include "server/postgres/database.h"

#include <libpq-fe.h>

#include "server/postgres/connection.h"
#include "server/postgres/postgres_jobs.h"
#include "server/postgres/schema.h"

namespace varimesh::server {
namespace {

Error output(const std::string& sentence) { return {Error::Kind::Output, sentence}; }

Error unreachable(const std::string& why) {
  return output("The database cannot be used (" + why + "); check that it runs, and the address of --store.");
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
  PQconninfoFree(options);
  if (has_password)
    return refuse(
        "The address of --store contains a password, which every user of this machine can read in the list of "
        "processes; put it into a file that PGPASSFILE names, or into PGPASSWORD.");
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
