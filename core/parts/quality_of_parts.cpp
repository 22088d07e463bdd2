#include "core/parts/quality_of_parts.h"

#include <algorithm>
#include <optional>

#include "core/base/index.h"
#include "core/diagnosis/diagnose.h"
#include "core/mesh/bounding_box.h"
#include "core/mesh/check.h"
#include "core/mesh/loose_parts.h"
#include "core/parts/close_up.h"
#include "core/parts/senses.h"
#include "core/quality/certified_quality.h"
#include "core/validity/certifier.h"
#include "core/validity/orientation.h"

namespace varimesh {
namespace {

BoundingBox whole_box(const BoundingBox& part, const Ranks& ranks) {
  std::array<double, 6> numbers{};
  for (std::size_t c = 0; c < 3; ++c) {
    numbers[c] = -part.low[c];
    numbers[c + 3] = part.high[c];
  }
  ranks.largest(numbers);
  BoundingBox whole;
  for (std::size_t c = 0; c < 3; ++c) {
    whole.low[c] = -numbers[c];
    whole.high[c] = numbers[c + 3];
  }
  return whole;
}

/// The nodes of a mesh that lie on a side of the box, by number, ascending.
std::vector<std::int64_t> nodes_at_sides(const HighOrderMesh& mesh, const BoundingBox& box) {
  std::vector<std::int64_t> found;
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    bool is_at_side = false;
    for (std::size_t c = 0; c < 3; ++c) {
      const double x = mesh.coordinates[3 * node + c];
      // All nodes of a plane mesh would lie on the sides that are equal.
      is_at_side |= box.low[c] < box.high[c] && (x == box.low[c] || x == box.high[c]);
    }
    if (is_at_side) found.push_back(mesh.node_numbers[node]);
  }
  std::ranges::sort(found);
  return found;
}

/// The work of quality_of_parts(). Every function is called by all ranks.
class Judge {
 public:
  Judge(const QualityOfParts& task, const Ranks& ranks) : task_(task), ranks_(ranks), team_(task.threads) {}

  Expected<WholeQuality> run() {
    for (auto step :
         {&Judge::read, &Judge::look_at_seams, &Judge::check, &Judge::certify, &Judge::count_nodes, &Judge::diagnose})
      if (const auto done = (this->*step)(); !done) return tl::unexpected(done.error());
    return std::move(result_);
  }

 private:
  Expected<void> read() {
    const auto done = ranks_.together([&]() -> Expected<void> {
      auto file = formats::PartedFile::open(task_.path);
      if (!file) return tl::unexpected(file.error());
      file_.emplace(std::move(*file));
      if (file_->dimension() < 2) {
        const auto mesh = file_->read(file_->one_of_each_block(), 1, nullptr);
        return mesh ? check_judgeable(*mesh) : tl::unexpected(mesh.error());
      }
      auto part = read_part(*file_, ranks_, team_.threads());
      if (!part) return tl::unexpected(part.error());
      part_ = std::move(*part);
      cells_.emplace(part_.mesh, part_.mesh.dimension);
      Expected<void> checked;
      if (cells_->count() > 0) team_.run([&] { checked = check_part(part_.mesh, team_); });
      return checked;
    });
    if (!done) return done;
    BoundingBox box;
    team_.run([&] { box = bounding_box(part_.mesh, team_); });
    box_ = whole_box(box, ranks_);
    if (part_.mesh.dimension == 2 && !lies_flat(box_))
      return bad_input("'" + task_.path +
                       "': The mesh is a surface in space, which several processes cannot judge; judge it in one.");
    return {};
  }

  Expected<void> look_at_seams() {
    const auto done = ranks_.together([&] {
      team_.run([&] {
        facets_ = facets(part_.mesh, team_);
        signs_ = detail::centre_signs(part_.mesh, team_);
      });
      joined_ = detail::join_cells(*cells_, facets_, signs_);
      shown_.resize(cells_->count());
    });
    if (!done) return done;
    first_group_ = ranks_.sum_before(std::ssize(joined_.groups));
    seams_ = find_seams(part_, facets_, joined_, first_group_, ranks_, team_);
    for (const std::int32_t cell : possible_duplicates(part_, ranks_)) shown_[at(cell)] = 1;
    return ranks_.together([&] {
      show_notable(part_, seams_, shown_, team_);
      show_cells_at(part_, nodes_at_sides(part_.mesh, box_), shown_);
    });
  }

  /// The first rank checks what no rank can with its part alone.
  Expected<void> check() {
    if (const auto done = look_closely(); !done) return done;
    // Elements of one dimension less that are no facet of a cell: are their nodes in cells?
    std::vector<std::int64_t> idle;
    if (ranks_.is_first()) idle = nodes_of_idle(*close_);
    idle = ranks_.gather_everywhere(idle);
    if (!idle.empty()) {
      show_cells_at(part_, idle, shown_);
      if (const auto done = look_closely(); !done) return done;
    }
    return ranks_.together([&]() -> Expected<void> {
      if (!ranks_.is_first()) return {};
      Expected<void> checked;
      team_.run([&] {
        checked = check_part(close_->mesh, team_);
        if (checked) checked = check_together(close_->mesh, close_->facets, team_);
        if (checked) result_.loose = loose_boundary(close_->mesh, close_->facets, team_);
      });
      return checked;
    });
  }

  Expected<void> look_closely() {
    auto close = close_up(*file_, part_, shown_, seams_, ranks_, team_);
    if (!close) return tl::unexpected(close.error());
    close_ = std::move(*close);
    return {};
  }

  static std::vector<std::int64_t> nodes_of_idle(const CloseUp& close) {
    const Cells borders(close.mesh, close.mesh.dimension - 1);
    std::vector<char> is_facet(borders.count());
    for (const auto& [_, element] : close.facets.elements) is_facet[at(element)] = 1;
    std::vector<std::int64_t> nodes;
    for (std::size_t element = 0; element < borders.count(); ++element)
      if (is_facet[element] == 0)
        for (const std::int32_t node : borders.nodes(element)) nodes.push_back(close.mesh.node_numbers[at(node)]);
    std::ranges::sort(nodes);
    return nodes;
  }

  Expected<void> certify() {
    const std::vector<char> clockwise =
        clockwise_cells(part_, facets_, joined_, signs_, first_group_, seams_, box_, ranks_, team_);
    result_.quality = {};
    std::vector<std::int64_t> turned;
    double sign = 1;
    team_.run([&] {
      turned = detail::cell_numbers(part_.mesh, clockwise);
      if (!clockwise.empty()) detail::turn_cells(part_.mesh, clockwise, team_);
      sign = detail::orientation(part_.mesh, team_, ranks_);
    });
    facets_ = {};
    joined_ = {};
    std::optional<Certifier> certifier;
    std::vector<Certificate> certificates;
    const auto done = ranks_.together([&] {
      team_.run([&] {
        certifier.emplace(part_.mesh, box_, sign);
        certificates.resize(certifier->cells());
        certifier->certify(part_.mesh.coordinates, certificates, team_);
      });
      uncertified_.resize(certificates.size());
      for (std::size_t cell = 0; cell < certificates.size(); ++cell)
        uncertified_[cell] = certificates[cell].is_valid() ? 0 : 1;
    });
    if (!done) return done;
    result_.quality =
        varimesh::quality(part_.mesh, *certifier, std::move(certificates), task_.intervals, team_, ranks_);
    result_.quality.clockwise = ranks_.gather(turned);
    return {};
  }

  /// Each rank counts a range of all nodes: those that cells have, and those of them that are free.
  Expected<void> count_nodes() {
    const std::int64_t total = file_->nodes();
    const auto owner = [&](std::int64_t place) {
      std::int64_t rank = place / std::max<std::int64_t>(total / ranks_.count(), 1);
      rank = std::min<std::int64_t>(rank, ranks_.count() - 1);
      while (range_of_rank(total, static_cast<int>(rank), ranks_.count()).first > place) --rank;
      while (rank + 1 < ranks_.count() &&
             range_of_rank(total, static_cast<int>(rank) + 1, ranks_.count()).first <= place)
        ++rank;
      return at(rank);
    };
    std::vector<std::vector<std::int64_t>> used(at(ranks_.count())), fixed(at(ranks_.count()));
    std::vector<char> is_used(part_.mesh.node_count());
    for (std::size_t cell = 0; cell < cells_->count(); ++cell)
      for (const std::int32_t node : cells_->nodes(cell)) is_used[at(node)] = 1;
    for (std::size_t node = 0; node < is_used.size(); ++node)
      if (is_used[node] != 0) used[owner(part_.places[node])].push_back(part_.places[node]);
    if (ranks_.is_first()) {
      const std::vector<bool> is_fixed = fixed_nodes(close_->mesh, close_->facets);
      for (std::size_t node = 0; node < is_fixed.size(); ++node)
        if (is_fixed[node]) fixed[owner(close_->places[node])].push_back(close_->places[node]);
    }
    const formats::ElementRange own = range_of_rank(total, ranks_.rank(), ranks_.count());
    std::vector<char> state(at(own.count));  // 0: no cell has the node; 1: it is free; 2: it is fixed
    for (const auto& list : ranks_.exchange_lists(used))
      for (const std::int64_t place : list) state[at(place - own.first)] = 1;
    for (const auto& list : ranks_.exchange_lists(fixed))
      for (const std::int64_t place : list)
        if (char& node = state[at(place - own.first)]; node == 1) node = 2;
    result_.mesh = {file_->dimension(), file_->order(), file_->cells(), total,
                    ranks_.sum(std::ranges::count(state, 1))};
    const std::int64_t lone = ranks_.sum(std::ranges::count(state, 0));
    const auto first = std::ranges::find(state, 0);
    const double place = ranks_.smallest(double(first == state.end() ? total : own.first + (first - state.begin())));
    return ranks_.together([&]() -> Expected<void> {
      if (!ranks_.is_first() || lone == 0) return {};
      const auto number = file_->node_number(std::int64_t(place));
      if (!number) return tl::unexpected(number.error());
      result_.loose.push_back(lone_nodes_text(lone, *number));
      return {};
    });
  }

  /// The first rank looks at the cells that are not certified, among all cells that have a node with them in common.
  Expected<void> diagnose() {
    const CertificateSummary& certified = result_.quality.certified;
    if (certified.invalid + certified.undecided == 0) return {};
    std::vector<std::int64_t> nodes;
    for (std::size_t cell = 0; cell < uncertified_.size(); ++cell)
      if (uncertified_[cell] != 0)
        for (const std::int32_t node : cells_->nodes(cell)) nodes.push_back(part_.mesh.node_numbers[at(node)]);
    nodes = ranks_.gather_everywhere(nodes);
    std::ranges::sort(nodes);
    show_cells_at(part_, nodes, shown_);
    if (const auto done = look_closely(); !done) return done;
    return ranks_.together([&] {
      if (!ranks_.is_first()) return;
      const std::vector<bool> fixed = fixed_nodes(close_->mesh, close_->facets);
      turn_clockwise(close_->mesh);
      const std::vector<std::int64_t> numbers = uncertified_numbers(result_.quality);
      if (task_.diagnoses)
        team_.run([&] { result_.unrepairable = with_any_of(varimesh::diagnose(close_->mesh, fixed, team_), numbers); });
      result_.left = what_is_left(close_->mesh, numbers, result_.unrepairable, {});
    });
  }

  void turn_clockwise(HighOrderMesh& mesh) const {
    std::vector<std::int64_t> turned = result_.quality.clockwise;
    if (turned.empty()) return;
    std::ranges::sort(turned);
    const Cells cells(mesh, mesh.dimension);
    std::vector<char> which(cells.count());
    for (std::size_t cell = 0; cell < which.size(); ++cell)
      which[cell] = std::ranges::binary_search(turned, cells.number(cell)) ? 1 : 0;
    detail::turn_cells(mesh, which);
  }

  const QualityOfParts& task_;
  const Ranks& ranks_;
  const Team team_;
  std::optional<formats::PartedFile> file_;
  Part part_;
  std::optional<Cells> cells_;
  BoundingBox box_;
  Facets facets_;  ///< Of the part alone.
  std::vector<std::int8_t> signs_;
  detail::JoinedCells joined_;
  std::int64_t first_group_ = 0;
  Seams seams_;
  std::vector<char> shown_;        ///< By cell of the part: whether the first rank looks at it.
  std::vector<char> uncertified_;  ///< By cell of the part.
  std::optional<CloseUp> close_;   ///< On the first rank.
  WholeQuality result_;
};

}  // namespace

Expected<WholeQuality> quality_of_parts(const QualityOfParts& task, const Ranks& ranks) {
  return Judge(task, ranks).run();
}

}  // namespace varimesh
