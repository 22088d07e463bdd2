// What a submission must meet before it becomes a job.
#include <set>

#include "core/base/sha256.h"
#include "core/formats/formats.h"
#include "server/engine/geometry_messages.h"
#include "server/engine/translate.h"
#include "server/jobs/job_record.h"
#include "server/refusals.h"
#include "server/scheduling/scheduler.h"

namespace varimesh::server {
namespace {

/// The largest spec, in bytes. A job with its spec must fit into one message.
constexpr std::size_t kMostSpecBytes = std::size_t{2} << 20;

/// The command has the same limit.
constexpr int kMostLatticeIntervals = 1000;

constexpr int kHighestPriority = 100;

}  // namespace

Answer<void> Scheduler::check(const v1::JobSpec& spec, bool is_admin) {
  if (spec.ByteSizeLong() > kMostSpecBytes)
    return bad_request("The spec has " + std::to_string(spec.ByteSizeLong()) + " bytes; it can have at most " +
                       std::to_string(kMostSpecBytes) + ". Shorten its lists of nodes and its texts.");
  if (!is_sha256(spec.mesh().digest()))
    return bad_request("The spec must name its mesh by SHA-256: 64 lowercase hexadecimal digits.");
  if (!is_readable(spec.mesh().format()))
    return bad_request(
        "This server does not read the format of the mesh; GetServerInfo lists the formats that it reads.");
  std::set<int> outputs;
  for (const int output : spec.outputs()) {
    if (!v1::MeshFormat_IsValid(output) || !is_writable(static_cast<v1::MeshFormat>(output)))
      return bad_request(
          "This server does not write the format of an output; GetServerInfo lists the formats that it writes.");
    if (!outputs.insert(output).second)
      return bad_request("The same output format is requested twice; request it once.");
  }
  if (spec.labels().size() > 32) return bad_request("A job can have at most 32 labels.");
  for (const auto& [key, value] : spec.labels())
    if (key.empty() || key.size() > 128 || value.size() > 128)
      return bad_request("A label's key must have 1 to 128 bytes, and its value at most 128.");
  const int most_priority = is_admin ? kHighestPriority : settings_.max_priority;
  if (spec.priority() < -kHighestPriority || spec.priority() > most_priority)
    return bad_request("The priority must be from " + std::to_string(-kHighestPriority) + " to " +
                       std::to_string(most_priority) + ".");
  if (spec.quality().lattice() < 0 || spec.quality().lattice() > kMostLatticeIntervals)
    return bad_request("The lattice must have 0 to " + std::to_string(kMostLatticeIntervals) + " intervals per edge.");
  const auto options = options_from(spec.options());
  if (!options) return tl::unexpected(options.error());
  if (const auto accepted = engine_.check_options(*options); !accepted)
    return invalid_option(accepted.error().sentence);
  if (const auto accepted = check_geometry(spec, *options); !accepted) return accepted;
  if (const auto accepted = check_layers(spec); !accepted) return accepted;
  if (const auto accepted = check_webhook(spec); !accepted) return accepted;
  for (const std::string& digest : inputs_of(spec))
    if (!meshes_->touch(digest)) return mesh_missing(digest);
  return check_memory(spec.mesh().digest());
}

Answer<void> Scheduler::check_layers(const v1::JobSpec& spec) {
  if (!spec.has_layers()) return {};
  if (spec.has_quality()) return bad_request("A job that judges a mesh changes nothing, so it can have no layers.");
  const auto layers = options_from(spec.layers());
  if (!layers) return tl::unexpected(layers.error());
  if (const auto accepted = varimesh::check(*layers); !accepted) return invalid_option(accepted.error().sentence);
  return {};
}

Answer<void> Scheduler::check_webhook(const v1::JobSpec& spec) const {
  if (!spec.has_webhook()) return {};
  if (settings_.check_webhook) return settings_.check_webhook(spec.webhook());
  return invalid_option("This server calls nobody at the end of a job; leave out the webhook.");
}

bool Scheduler::takes_geometries() const {
  return engine_.check_geometry && engine_.check_geometry(v1::Geometry(), Options());
}

Answer<void> Scheduler::check_geometry(const v1::JobSpec& spec, const Options& options) {
  if (!spec.has_geometry()) {
    if (options.repair != Repair::Refine) return {};
    return invalid_option("The repair refine needs a model for its new nodes, and the spec has no geometry.");
  }
  if (!is_on_boundary(spec.geometry()) && !is_sha256(spec.geometry().digest()))
    return bad_request("The spec must name its geometry by SHA-256: 64 lowercase hexadecimal digits.");
  if (spec.has_quality()) return bad_request("A job that judges a mesh moves nothing, so it can have no geometry.");
  if (!engine_.check_geometry) return invalid_option(takes_no_models().value().sentence);
  if (const auto accepted = engine_.check_geometry(spec.geometry(), options); !accepted)
    return invalid_option(accepted.error().sentence);
  return {};
}

Answer<void> Scheduler::check_memory(const std::string& digest) {
  if (memory_.limit() == 0) return {};
  const auto size = meshes_->size_of(digest);
  if (!size) return {};  // the job will say why
  const std::int64_t least = formats::least_memory(*size);
  if (!memory_.can_ever_fit(least)) return mesh_needs_memory(memory_.limit(), least);
  return {};
}

}  // namespace varimesh::server
