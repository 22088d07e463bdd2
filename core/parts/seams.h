// Where the parts of a mesh meet: which facets have a cell of another rank on their other side, and which cells have
// something at their facets that only the whole mesh can judge.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/connectivity.h"
#include "core/parts/part.h"
#include "core/ranks/ranks.h"
#include "core/validity/orientation.h"

namespace varimesh {

/// The vertices of a facet as 128 bits that do not depend on their order. Different facets have different ones but for
/// a chance of 2^−64 or less, and then too many cells are looked at closely, nothing else.
using FacetKey = std::array<std::uint64_t, 2>;

/// Of two groups of joined cells (detail::JoinedCells) that meet at a facet, by their numbers among those of all ranks.
struct GroupLink {
  std::int64_t one = 0, other = 0;
  std::int64_t relation = 1;  ///< 1 if the groups have one sense as their cells' senses are, −1 if opposite ones.
};

/// What the ranks find out together. The lists of keys ascend.
struct Seams {
  std::vector<FacetKey> outer;    ///< Facets with one cell, on all ranks.
  std::vector<FacetKey> unclear;  ///< Facets about which only all their cells can tell, on all ranks.
  std::vector<FacetKey> borders;  ///< Elements of one dimension less, on all ranks.
  std::vector<GroupLink> links;   ///< On the first rank.
  bool all_agree = true;          ///< Whether all cells that meet at a facet are numbered in one sense.

  bool is_outer(const FacetKey& key) const;
  bool is_notable(const FacetKey& key) const;
};

/// The key of the facet `facet` of a cell, from the numbers of its vertices in the file.
FacetKey facet_key(const HighOrderMesh& mesh, const Cells& cells, std::size_t cell, std::size_t facet);

/// @param facets those of the part alone
/// @param joined the groups of cells that are joined within the part
/// @param first_group the number of the first of them among those of all ranks
/// All ranks call it.
Seams find_seams(const Part& part, const Facets& facets, const detail::JoinedCells& joined, std::int64_t first_group,
                 const Ranks& ranks, const Team& team);

/// The cells of the part, from 0, that may be the same as another cell of any rank. All ranks call it.
std::vector<std::int32_t> possible_duplicates(const Part& part, const Ranks& ranks);

}  // namespace varimesh
