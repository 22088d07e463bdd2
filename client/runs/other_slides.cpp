#include "client/runs/other_slides.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <utility>

#include "client/process/exit_status.h"
#include "client/process/interrupts.h"
#include "core/base/sha256.h"
#include "core/merit/merit.h"
#include "core/merit/thresholds.h"

namespace varimesh::client {
namespace {

constexpr std::size_t kMostBytesOfRequestId = 128;  // the contract's limit

std::int64_t left(const v1::Job& job) {
  const v1::Certified& certified = job.metrics().after().certified();
  return certified.invalid() + certified.undecided();
}

double smallest(const v1::Job& job) { return job.metrics().after().min_scaled_jacobian(); }

std::string left_text(const v1::Job& job) {
  if (left(job) == 1) return "1 element is not certified valid";
  if (left(job) > 1) return std::to_string(left(job)) + " elements are not certified valid";
  char text[80];
  std::snprintf(text, sizeof text, "The smallest scaled Jacobian is only %.2g", smallest(job));
  return text;
}

/// A way to slide, and what is said of it.
struct Slide {
  v1::Geometry::Slide slide;
  std::string name;    ///< As --slide has it.
  std::string ending;  ///< Of the request id.
};

bool is_weak(const v1::Job& job) { return left(job) > 0 || smallest(job) < threshold::kWeak; }

Merit merit_of(const v1::Job& job) { return {.uncertified = left(job), .smallest = smallest(job)}; }

/// The request id of another run. The same id gives the same one.
std::string request_id_of(const std::string& id, const std::string& ending) {
  if (id.empty()) return id;
  return (id.size() + ending.size() <= kMostBytesOfRequestId ? id : sha256(id)) + ending;
}

/// Changes the job to one whose nodes slide in this way. A mesh that slid in this process is read and uploaded once
/// more, and what came of its model is returned.
Outcome<std::optional<v1::GeometryReport>> slide_otherwise(Client& client, Input input, const Slide& other,
                                                           v1::JobSpec* spec) {
  if (spec->has_geometry()) {
    spec->mutable_geometry()->set_slide(other.slide);
    return std::optional<v1::GeometryReport>();
  }
  if (input.geometry.on_boundary)
    input.geometry = {};
  else
    input.geometry.slide = other.name;
  input.keeps_as_it_came = false;
  auto moved = moved_mesh(input);
  if (!moved) return tl::unexpected(moved.error());
  const auto mesh = upload(client, input, *moved);
  if (!mesh) return tl::unexpected(mesh.error());
  spec->mutable_mesh()->set_digest(mesh->digest());
  return *moved ? std::move((*moved)->geometry) : std::nullopt;
}

/// Runs the job with another way to slide. Nothing if that fails; the reason has been printed.
std::optional<v1::Job> run_otherwise(const OtherSlides& others, const Slide& other) {
  v1::JobSpec spec = others.spec;
  const auto geometry = slide_otherwise(others.client, others.input, other, &spec);
  if (!geometry) {
    print_error(geometry.error());
    return std::nullopt;
  }
  auto job = others.run(spec, request_id_of(others.request_id, other.ending));
  if (!job) return std::nullopt;
  if (*geometry && job->has_metrics()) *job->mutable_metrics()->mutable_geometry() = **geometry;
  return std::move(*job);
}

/// Prints what the geometry came to in this job, without what was printed for `before`.
void print_geometry(const OtherSlides& others, const v1::Job& job, const v1::Job& before) {
  const auto& printed = before.metrics().geometry().sentences();
  for (const std::string& sentence : job.metrics().geometry().sentences())
    if (std::ranges::find(printed, sentence) == printed.end()) others.print_sentence(sentence);
}

/// Takes the other run into `best` if it is better, and says so in the words `better` or `no_better`.
void compare(const OtherSlides& others, const Slide& other, Asked::What asked, const std::string& better,
             const std::string& no_better, v1::Job& best) {
  std::optional<v1::Job> job = run_otherwise(others, other);
  if (!job) return others.print_sentence("That could not be tried, so the result is the mesh before it.");
  const bool succeeded = job->state() == v1::JOB_STATE_SUCCEEDED;
  if (!succeeded || !is_better(merit_of(*job), merit_of(best), {.what = asked}))
    return others.print_sentence(no_better);
  others.print_sentence(better);
  print_geometry(others, *job, best);
  best = std::move(*job);
}

}  // namespace

v1::Job best_of_other_slides(OtherSlides others, v1::Job slid) {
  const GeometryOptions& geometry = others.input.geometry;
  std::error_code failed;
  const bool is_there = others.spec.has_geometry() || std::filesystem::is_regular_file(others.input.mesh, failed);
  if (slid.state() != v1::JOB_STATE_SUCCEEDED || !is_there || geometry.slide == "none" || interrupted()) return slid;
  const Slide nothing{v1::Geometry::SLIDE_NONE, "none", "-as-it-came"};
  v1::Job best = std::move(slid);
  if (geometry.on_boundary) {
    others.print_sentence("Now with the boundary as it came.");
    compare(others, nothing, Asked::What::Minimum,
            "The result is better with the boundary as it came, so the nodes that slid are back.",
            "The result is no better with the boundary as it came.", best);
    return best;
  }
  if (is_weak(best) && geometry.slide.empty()) {
    const bool are_left = left(best) > 0;
    others.print_sentence(left_text(best) + ", so now all nodes move together (--slide coupled).");
    compare(others, {v1::Geometry::SLIDE_COUPLED, "coupled", "-coupled"},
            are_left ? Asked::What::Validity : Asked::What::Minimum,
            std::string(are_left ? "With that, fewer elements are invalid" : "With that, it is larger") +
                ", so it is taken. The boundary may lie farther from the model now; --slide all never does this step.",
            std::string(are_left ? "With that, no fewer elements are invalid" : "With that, it is no larger") +
                ", so the result stays as it was.",
            best);
  }
  if (left(best) > 0 && !interrupted()) {
    others.print_sentence(left_text(best) + ", so now without sliding, for comparison.");
    compare(others, nothing, Asked::What::Validity,
            "The result is better without sliding, so the nodes that slid are back.",
            "The result is no better without sliding.", best);
  }
  return best;
}

}  // namespace varimesh::client
