// What a checkpoint keeps of a descent.
#include <algorithm>
#include <utility>

#include "core/base/index.h"
#include "core/solvers/descent/descent.h"

namespace varimesh {

template <class Archive>
void Descent::state(Archive& archive) {
  std::vector<double> accepted;
  if constexpr (!Archive::kReads) accepted = free_positions(problem_, accepted_);
  archive(factors_, first_gradient_, start_loss_, last_loss_, asked_.least_loss, raises_, caution_, raises_lost_,
          settling_, best_settling_, settled_js_, last_move_, earlier_minima_, accepted, accepted_loss_, accepted_js_,
          asked_.highest_minimum, best_.coordinates, best_.merit.uncertified, best_.merit.smallest, best_.merit.loss,
          best_.merit.lower_than_it_came);
  if constexpr (Archive::kReads)
    if (archive.failed() || !restore(accepted)) archive.fail();
}

void Descent::write(CheckpointWriter& writer) {
  writer(part_ ? gather_free(*part_, from_) : from_);
  for (const CellSet& set : problem_.sets)
    writer(std::vector<double>(set.delta_squared.begin(), set.delta_squared.end()));
  state(writer);
}

void Descent::read(std::optional<Descent>& descent, const DescentContext& context, CheckpointReader& reader) {
  Problem& problem = context.problem;
  const std::vector<double> positions = problem.positions;
  std::vector<double> from;
  reader(from);
  // The constructor measures the mesh where the descent began.
  if (reader.failed() || !set_free_positions(problem, from, problem.positions)) return reader.fail();
  descent.emplace(context);
  problem.positions = positions;
  for (CellSet& set : problem.sets) {
    std::vector<double> delta_squared;
    reader(delta_squared);
    if (reader.failed() || delta_squared.size() != set.delta_squared.size()) return reader.fail();
    std::ranges::copy(delta_squared, set.delta_squared.begin());
  }
  descent->state(reader);
}

bool Descent::restore(const std::vector<double>& accepted) {
  accepted_ = problem_.positions;
  if (!set_free_positions(problem_, accepted, accepted_) || factors_.size() != at(problem_.cells) ||
      earlier_minima_.size() != kRoundsOfPace || best_.coordinates.size() != context_.mesh.coordinates.size())
    return false;
  if (context_.came_valid) asked_.loss_as_it_came = start_loss_;
  State best = best_;
  best.certificates.resize(context_.certifier.cells());
  context_.certifier.certify(best.coordinates, best.certificates, team_, sharers());
  judge(best.coordinates, best);
  best_.certificates = std::move(best.certificates);
  return true;
}

}  // namespace varimesh
