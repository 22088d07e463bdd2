// Guesses which word was meant by a misspelt one.
#pragma once

#include <string>
#include <vector>

namespace varimesh {

/// The word of `known` that differs from `word` in the fewest wrong, missing, additional or swapped letters. Empty if
/// none is near.
std::string nearest_word(const std::string& word, const std::vector<std::string>& known);

}  // namespace varimesh
