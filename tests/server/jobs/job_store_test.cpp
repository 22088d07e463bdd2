// Runs the conformance tests with every job store.
#include <gtest/gtest.h>

#include "tests/server/jobs/job_store_conformance.h"
#include "tests/server/jobs/job_stores.h"

namespace varimesh::server::testing {

INSTANTIATE_TEST_SUITE_P(Stores, JobStoreConformance, ::testing::ValuesIn(kStores), name_of);
INSTANTIATE_TEST_SUITE_P(Stores, Calls, ::testing::ValuesIn(kStores), name_of);
INSTANTIATE_TEST_SUITE_P(Stores, DurableCalls, ::testing::ValuesIn(kDurableStores), name_of);
INSTANTIATE_TEST_SUITE_P(Stores, FairTurns, ::testing::ValuesIn(kStores), name_of);
INSTANTIATE_TEST_SUITE_P(Stores, DurableJobStoreConformance, ::testing::ValuesIn(kDurableStores), name_of);

}  // namespace varimesh::server::testing
