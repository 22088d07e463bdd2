// A build without prometheus-cpp counts nothing.
#include "server/metrics/metrics.h"

namespace varimesh::server {

struct Metrics::Families {};

Metrics::Metrics() : families_(std::make_unique<Families>()) {}
Metrics::~Metrics() = default;
bool Metrics::available() { return false; }
void Metrics::count_submission() {}
void Metrics::count_end(const v1::Job&) {}
void Metrics::count_loss() {}
void Metrics::count_webhook(CallEnd) {}
void Metrics::count_kernels(double, double) {}
void Metrics::count_bytes(bool, std::int64_t) {}
void Metrics::count_call(std::string_view, int, std::chrono::duration<double>) {}
std::string Metrics::text(const Gauges&) { return {}; }

}  // namespace varimesh::server
