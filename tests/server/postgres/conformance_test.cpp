// Runs the conformance tests of the job stores with PostgreSQL.
#include "tests/server/postgres/databases.h"

namespace varimesh::server::testing {

const StoreKind kPostgres{"Postgres", [] { return std::make_unique<InDatabase>(); }};

INSTANTIATE_TEST_SUITE_P(Postgres, JobStoreConformance, ::testing::Values(kPostgres), name_of);
INSTANTIATE_TEST_SUITE_P(Postgres, Calls, ::testing::Values(kPostgres), name_of);
INSTANTIATE_TEST_SUITE_P(Postgres, DurableCalls, ::testing::Values(kPostgres), name_of);
INSTANTIATE_TEST_SUITE_P(Postgres, FairTurns, ::testing::Values(kPostgres), name_of);
INSTANTIATE_TEST_SUITE_P(Postgres, DurableJobStoreConformance, ::testing::Values(kPostgres), name_of);

}  // namespace varimesh::server::testing
