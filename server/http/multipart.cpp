// civetweb's own reader of forms has no bounds for slow clients, and copies each piece several times.
#include "server/http/multipart.h"

#include <algorithm>
#include <cctype>
#include <cstring>

#include "server/refusals.h"

namespace varimesh::server {
namespace {

constexpr std::size_t kPiece = std::size_t{1} << 20, kMostHeaderBytes = 8192, kMostBoundaryBytes = 70;

Refusal no_form(const std::string& why) { return bad_request("The body is no form with parts: " + why + "."); }

std::string in_small_letters(std::string_view text) {
  std::string small(text);
  std::ranges::transform(small, small.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return small;
}

/// The value of a parameter such as name="spec"; empty if there is none.
std::string parameter(std::string_view header, const std::string& name) {
  const std::string small = in_small_letters(header);
  for (auto at = small.find(name + "="); at != std::string::npos; at = small.find(name + "=", at + 1)) {
    if (at == 0 || std::string_view("; \t").find(small[at - 1]) == std::string_view::npos) continue;
    std::string_view value = header.substr(at + name.size() + 1);
    const bool is_quoted = value.starts_with('"');
    if (is_quoted) value.remove_prefix(1);
    const auto end = value.find_first_of(is_quoted ? "\"" : "; \t\r\n");
    if (is_quoted && end == std::string_view::npos) return {};
    return std::string(value.substr(0, end));
  }
  return {};
}

/// The name in the headers of a part; empty if they have none.
std::string name_of(std::string_view headers) {
  while (!headers.empty()) {
    const std::string_view line = headers.substr(0, headers.find("\r\n"));
    if (in_small_letters(line).starts_with("content-disposition:")) return parameter(line, "name");
    headers.remove_prefix(std::min(line.size() + 2, headers.size()));
  }
  return {};
}

}  // namespace

Multipart::Multipart(HttpExchange& exchange)
    : exchange_(exchange), left_(exchange.size()), buffer_("\r\n") {  // the first delimiter may lack its line break
  const std::string boundary = parameter(exchange.header("Content-Type"), "boundary");
  if (!boundary.empty() && boundary.size() <= kMostBoundaryBytes) delimiter_ = "\r\n--" + boundary;
}

Answer<void> Multipart::fill() {
  if (left_ <= 0) return no_form("it ends inside a part");
  buffer_.erase(0, begin_);
  begin_ = 0;
  const std::size_t had = buffer_.size(), wanted = std::min(kPiece, static_cast<std::size_t>(left_));
  buffer_.resize(had + wanted);
  const std::size_t got = exchange_.read_some(buffer_.data() + had, wanted);
  buffer_.resize(had + got);
  left_ -= static_cast<std::int64_t>(got);
  constexpr std::size_t kLeast = kPiece / 4;
  if (got < std::min(kLeast, wanted)) return bad_request("The body ended early or came too slowly.");
  return {};
}

Answer<std::string_view> Multipart::read() {
  if (delimiter_.empty()) return no_form("its Content-Type has no boundary of at most 70 bytes");
  for (;;) {
    const std::string_view rest = std::string_view(buffer_).substr(begin_);
    const void* const found = ::memmem(rest.data(), rest.size(), delimiter_.data(), delimiter_.size());
    // Without a delimiter, the last bytes may be the beginning of one.
    const std::size_t count = found != nullptr ? static_cast<std::size_t>(static_cast<const char*>(found) - rest.data())
                                               : rest.size() - std::min(rest.size(), delimiter_.size() - 1);
    begin_ += count;
    if (found != nullptr || count > 0) return rest.substr(0, count);
    if (const auto filled = fill(); !filled) return tl::unexpected(filled.error());
  }
}

Answer<std::string> Multipart::next() {
  for (;;) {
    const auto skipped = read();
    if (!skipped) return tl::unexpected(skipped.error());
    if (skipped->empty()) break;
  }
  for (;;) {
    const std::string_view rest = std::string_view(buffer_).substr(begin_ + delimiter_.size());
    if (rest.starts_with("--")) return std::string();
    if (rest.size() >= 2 && !rest.starts_with("\r\n")) return no_form("a boundary does not end its line");
    if (const auto end = rest.find("\r\n\r\n"); end != std::string_view::npos && end <= kMostHeaderBytes) {
      const std::string name = name_of(rest.substr(0, end));
      begin_ += delimiter_.size() + end + 4;
      if (name.empty()) return no_form("a part has no name");
      return name;
    }
    if (rest.size() > kMostHeaderBytes) return no_form("the header of a part is too long");
    if (const auto filled = fill(); !filled) return tl::unexpected(filled.error());
  }
}

Answer<void> Multipart::end() {
  const auto name = next();
  if (!name) return tl::unexpected(name.error());
  if (!name->empty()) return bad_request("There is no part '" + *name + "' after the part mesh.");
  return {};
}

}  // namespace varimesh::server
