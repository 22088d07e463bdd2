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

}  // namespace varimesh
