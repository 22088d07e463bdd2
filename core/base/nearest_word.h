// What was probably meant by a misspelt word.
#pragma once

#include <string>
#include <vector>

namespace varimesh {

/// The nearest of some words by how many letters are wrong, missing, too many or swapped; empty where none is near.
std::string nearest_word(const std::string& word, const std::vector<std::string>& known);

}  // namespace varimesh
