// The distance between words is Damerau's: the least number of edits that turn one word into the other.
#include "core/options/nearest_word.h"

#include <algorithm>

namespace varimesh {
namespace {

/// The least number of wrong, missing, additional and swapped letters.
std::size_t distance(const std::string& a, const std::string& b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) d[i][0] = i;
  for (std::size_t j = 0; j <= b.size(); ++j) d[0][j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i)
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t change = a[i - 1] == b[j - 1] ? 0 : 1;
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + change});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  return d[a.size()][b.size()];
}

}  // namespace

std::string nearest_word(const std::string& word, const std::vector<std::string>& known) {
  std::string best;
  std::size_t least = std::max<std::size_t>(1, word.size() / 3) + 1;
  for (const std::string& one : known) {
    // An abbreviation counts as one error: --max for --max-iterations.
    const std::size_t wrong = word.size() > 3 && one.rfind(word, 0) == 0 ? 1 : distance(word, one);
    if (wrong < least) {
      least = wrong;
      best = one;
    }
  }
  return best;
}

}  // namespace varimesh
