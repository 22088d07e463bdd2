#include <algorithm>

#include "core/association/association.h"
#include "core/association/match.h"
#include "core/base/counted.h"

namespace varimesh {
namespace {

using detail::number_text;

constexpr std::size_t kShown = 5;

std::string entity_text(const Association& association, const NodeEntity& entity) {
  const auto index = static_cast<std::size_t>(entity.entity);
  const geometry::Geometry& geometry = association.geometry;
  if (entity.dimension == 0) return "vertex " + std::to_string(geometry.vertices[index].tag);
  if (entity.dimension == 1) return "curve " + std::to_string(geometry.curves[index].tag);
  return geometry.surfaces[index].text();
}

std::string unmatched_text(const Association& association, const SurfaceMatch& match) {
  if (match.on_none < match.elements)
    return std::to_string(match.on_none) + " of the " + std::to_string(match.elements) + " elements of surface " +
           std::to_string(match.tag) +
           " of the mesh lie on no surface of the geometry for sure, so their nodes stay where they are.";
  if (match.rival >= 0)
    return "Surface " + std::to_string(match.tag) + " of the mesh lies on " +
           association.geometry.surfaces[static_cast<std::size_t>(match.rival)].text() +
           " of the geometry and on another, so its nodes stay where they are.";
  return "Surface " + std::to_string(match.tag) +
         " of the mesh lies on no surface of the geometry, so its nodes stay where they are.";
}

std::string parameters_text(const HighOrderMesh& mesh, const Association& association) {
  std::string text =
      "The parameters in the file lead to " + std::to_string(association.by_parameters) + " of these nodes";
  if (association.misled.empty()) return text + ".";
  const std::size_t count = association.misled.size();
  text += ", but not to " + counted(std::int64_t(count), "other") + ", which " + (count == 1 ? "was" : "were") +
          " projected (node ";
  for (std::size_t i = 0; i < std::min(kShown, count); ++i)
    text += (i > 0 ? ", " : "") + std::to_string(mesh.node_numbers[static_cast<std::size_t>(association.misled[i])]);
  return text + (count > kShown ? ", \u2026)." : ").");
}

}  // namespace

std::vector<std::string> describe(const HighOrderMesh& mesh, const Association& association, double tolerance) {
  std::vector<std::string> sentences;
  std::size_t by_tag = 0, by_distance = 0, by_elements = 0;
  for (const SurfaceMatch& match : association.matches) {
    by_tag += match.by_tag ? 1 : 0;
    by_distance += !match.by_tag && match.surface >= 0 ? 1 : 0;
    by_elements += match.surface < 0 && match.on_none < match.elements ? 1 : 0;
  }
  std::array<std::size_t, 3> on{};
  std::vector<std::pair<double, std::size_t>> off;
  double largest = 0;
  for (std::size_t node = 0; node < association.nodes.size(); ++node) {
    const NodeEntity& entity = association.nodes[node];
    if (entity.dimension < 0) continue;
    ++on[static_cast<std::size_t>(entity.dimension)];
    largest = std::max(largest, entity.distance);
    if (entity.distance > tolerance * association.size) off.emplace_back(-entity.distance, node);
  }
  sentences.push_back("Geometry: " + std::to_string(by_tag + by_distance + by_elements) + " of " +
                      std::to_string(association.matches.size()) + " surfaces of the mesh matched (" +
                      std::to_string(by_tag) + " by tag, " + std::to_string(by_distance) + " by distance" +
                      (by_elements > 0 ? ", " + std::to_string(by_elements) + " element by element" : "") + "); " +
                      std::to_string(on[0]) + " nodes on vertices, " + std::to_string(on[1]) + " on curves, " +
                      std::to_string(on[2]) + " on surfaces, at most " + number_text(largest) + " from them.");
  if (association.repeated > 0)
    sentences.push_back("Bodies of the geometry touch: " + std::to_string(association.repeated) +
                        (association.repeated == 1 ? " surface is" : " surfaces are") +
                        " there twice and counted once.");
  if (association.factor != 1)
    sentences.push_back("Lengths in the mesh are " + number_text(association.factor) +
                        " times those in the geometry, which was scaled.");
  if (association.by_parameters > 0 || !association.misled.empty())
    sentences.push_back(parameters_text(mesh, association));
  std::size_t unmatched = 0;
  for (const SurfaceMatch& match : association.matches)
    if (match.on_none > 0 && ++unmatched <= kShown) sentences.push_back(unmatched_text(association, match));
  if (unmatched > kShown) sentences.push_back("and " + counted(std::int64_t(unmatched - kShown), "more surface") + ".");
  if (!association.held.empty())
    sentences.push_back(counted(std::ssize(association.held), "boundary node") +
                        (association.held.size() == 1
                             ? " belongs to no entity for sure and stays where it is: node "
                             : " belong to no entity for sure and stay where they are, node ") +
                        std::to_string(mesh.node_numbers[static_cast<std::size_t>(association.held.front())]) +
                        (association.held.size() == 1 ? "." : " among them."));
  std::ranges::sort(off);
  for (std::size_t i = 0; i < std::min(kShown, off.size()); ++i)
    sentences.push_back(
        "Node " + std::to_string(mesh.node_numbers[off[i].second]) + " is " + number_text(-off[i].first) + " from " +
        entity_text(association, association.nodes[off[i].second]) + "; the option snap moves it there.");
  if (off.size() > kShown)
    sentences.push_back("and " + counted(std::int64_t(off.size() - kShown), "more such node") + ".");
  return sentences;
}

}  // namespace varimesh
