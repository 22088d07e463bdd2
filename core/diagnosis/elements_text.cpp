#include "core/diagnosis/elements_text.h"

#include <algorithm>

namespace varimesh {

std::string elements_text(const std::vector<std::int64_t>& elements, std::string_view name, std::string_view plural) {
  constexpr std::size_t kShown = 8;
  const std::size_t count = elements.size(), shown = std::min(count, kShown);
  std::string text(count == 1 ? name : plural);
  for (std::size_t i = 0; i < shown; ++i)
    text += (i == 0 ? " " : i + 1 == count ? " and " : ", ") + std::to_string(elements[i]);
  if (count > shown) text += " and " + std::to_string(count - shown) + " more";
  return text;
}

std::string clockwise_text(const std::vector<std::int64_t>& elements, std::size_t of, int dimension) {
  const std::string clockwise = dimension == 3 ? "numbered clockwise (left-handed)" : "numbered clockwise";
  if (elements.size() == 1) return "Element " + std::to_string(elements.front()) + " is " + clockwise;
  if (elements.size() == of) return "All " + std::to_string(of) + " elements are " + clockwise;
  return std::to_string(elements.size()) + " elements are " + clockwise + ": " +
         elements_text(elements, "element", "elements");
}

}  // namespace varimesh
