// Takes the place of database.cpp in programs that are built without libpq.
#include "server/postgres/database.h"

namespace varimesh::server {
namespace {

Error without_libpq() {
  return {Error::Kind::BadOption,
          "This varimeshd was built without PostgreSQL; install libpq-dev and build it again, or leave out --store."};
}

}  // namespace

bool is_postgres(const std::string& address) {
  return address.rfind("postgresql://", 0) == 0 || address.rfind("postgres://", 0) == 0;
}

Expected<void> check_postgres(const std::string&) { return tl::unexpected(without_libpq()); }

Expected<std::unique_ptr<JobStore>> open_postgres(const std::string&, const JobStoreSettings&,
                                                  std::function<void(const std::string& line)>) {
  return tl::unexpected(without_libpq());
}

Expected<std::string> migrate_postgres(const std::string&) { return tl::unexpected(without_libpq()); }

}  // namespace varimesh::server
