// Reads the few elements that matter. The answers come from a server that is trusted, and have no attributes in these
// elements.
#include "server/meshes/s3/xml.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <ctime>
#include <iterator>
#include <set>
#include <utility>

#include "server/refusals.h"

namespace varimesh::server {
namespace {

std::string unescaped(std::string_view text) {
  static constexpr std::array<std::pair<std::string_view, char>, 6> kEntities{
      {{"&amp;", '&'}, {"&lt;", '<'}, {"&gt;", '>'}, {"&quot;", '"'}, {"&apos;", '\''}, {"&#34;", '"'}}};
  std::string plain;
  while (!text.empty()) {
    std::size_t length = 1;
    char letter = text.front();
    for (const auto& [entity, means] : kEntities)
      if (text.starts_with(entity)) {
        length = entity.size();
        letter = means;
      }
    plain += letter;
    text.remove_prefix(length);
  }
  return plain;
}

}  // namespace

std::string text_of(std::string_view xml, std::string_view name) {
  const std::string open = "<" + std::string(name) + ">", close = "</" + std::string(name) + ">";
  const auto begin = xml.find(open);
  if (begin == std::string_view::npos) return {};
  const auto end = xml.find(close, begin);
  if (end == std::string_view::npos) return {};
  return unescaped(xml.substr(begin + open.size(), end - begin - open.size()));
}

S3Page parse_page(std::string_view xml, std::string_view prefix) {
  static constexpr std::string_view kOpen = "<Contents>", kClose = "</Contents>";
  S3Page page;
  if (text_of(xml, "IsTruncated") == "true") page.next = text_of(xml, "NextContinuationToken");
  for (auto begin = xml.find(kOpen); begin != std::string_view::npos; begin = xml.find(kOpen, begin + 1)) {
    const auto end = xml.find(kClose, begin);
    if (end == std::string_view::npos) break;
    const std::string_view entry = xml.substr(begin, end - begin);
    S3Object object;
    object.key = text_of(entry, "Key");
    if (object.key.starts_with(prefix)) object.key.erase(0, prefix.size());
    object.size = std::strtoll(text_of(entry, "Size").c_str(), nullptr, 10);
    object.tag = text_of(entry, "ETag");
    object.changed = parse_time(text_of(entry, "LastModified"));
    page.objects.push_back(std::move(object));
  }
  return page;
}

Answer<std::vector<S3Object>> all_pages(const std::function<Answer<S3Page>(const std::string& next)>& fetch) {
  std::vector<S3Object> all;
  std::set<std::string> seen;
  std::string next;
  do {
    auto page = fetch(next);
    if (!page) return tl::unexpected(page.error());
    if (!page->next.empty() && !seen.insert(page->next).second)
      return internal_failure("The S3 server of the meshes repeats a page of a list.");
    std::ranges::move(page->objects, std::back_inserter(all));
    next = std::move(page->next);
  } while (!next.empty());
  return all;
}

std::int64_t parse_time(const std::string& text) {
  std::tm time{};
  const char* const rest = ::strptime(text.c_str(), "%Y-%m-%dT%H:%M:%S", &time);
  if (rest == nullptr) return 0;
  const double part = *rest == '.' ? std::strtod(("0" + std::string(rest)).c_str(), nullptr) : 0;
  return std::int64_t{::timegm(&time)} * 1'000'000'000 + static_cast<std::int64_t>(part * 1e9);
}

}  // namespace varimesh::server
