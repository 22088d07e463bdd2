#include "core/ranks/to_all.h"

#include <vector>

namespace varimesh {

void broadcast(std::span<std::byte> bytes, const Ranks& ranks) {
  std::vector<Ranks::Message> messages;
  if (!ranks.is_first()) messages.push_back({0, {}, bytes});
  for (int other = 1; ranks.is_first() && other < ranks.count(); ++other) messages.push_back({other, bytes, {}});
  ranks.exchange(messages);
}

bool have_same(std::string_view mine, const Ranks& ranks) {
  // An end after each text, so that "aa" of one rank does not look like "a" of two.
  std::vector<char> text(mine.begin(), mine.end());
  text.push_back('\0');
  const std::vector<char> texts = ranks.gather_everywhere(text);
  bool same = texts.size() == text.size() * static_cast<std::size_t>(ranks.count());
  for (std::size_t i = 0; same && i < texts.size(); ++i) same = texts[i] == text[i % text.size()];
  return !ranks.any(!same);
}

}  // namespace varimesh
