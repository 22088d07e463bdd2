// Parses lines of tokens and compares digests.
#include "server/access/tokens.h"

#include <sys/random.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <sstream>

#include "core/base/sha256.h"

namespace varimesh::server {
namespace {

constexpr std::size_t kMostNameBytes = 64;
constexpr std::size_t kMostTokenBytes = 4096;

bool is_name(std::string_view name) {
  return !name.empty() && name.size() <= kMostNameBytes && std::ranges::all_of(name, [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '.' || c == '_' || c == '-' || c == '@';
  });
}

/// Reads `digits` digits at the beginning of `text` and removes them.
std::optional<int> take_number(std::string_view& text, std::size_t digits) {
  int number = 0;
  if (text.size() < digits) return std::nullopt;
  const auto read = std::from_chars(text.data(), text.data() + digits, number);
  if (read.ec != std::errc() || read.ptr != text.data() + digits || text.front() == '-') return std::nullopt;
  text.remove_prefix(digits);
  return number;
}

bool take(std::string_view& text, char letter) {
  if (text.empty() || text.front() != letter) return false;
  text.remove_prefix(1);
  return true;
}

/// Returns the rights of "submit,read"; nothing if a role is unknown.
std::optional<Rights> rights_of(const std::string& roles) {
  Rights rights;
  std::istringstream words(roles);
  for (std::string role; std::getline(words, role, ',');) {
    const auto right = right_of(role);
    if (!right) return std::nullopt;
    rights = rights | *right;
  }
  return rights == kNoRight ? std::nullopt : std::optional(rights);
}

/// Compares all bytes, wherever the first difference is.
bool are_equal(std::string_view a, std::string_view b) {
  unsigned difference = a.size() == b.size() ? 0 : 1;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
    difference |= static_cast<unsigned char>(a[i]) ^ static_cast<unsigned char>(b[i]);
  return difference == 0;
}

tl::unexpected<Error> bad_line(std::size_t number, const std::string& what) {
  return bad_option("Line " + std::to_string(number) + " of the file of tokens " + what +
                    "; a line is NAME ROLES SHA-256 [UNTIL], as 'varimeshd token' writes it.");
}

std::string random_token() {
  constexpr std::string_view letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
  std::array<unsigned char, 43> bytes{};  // 43 letters of 6 bits each
  for (std::size_t filled = 0; filled < bytes.size();)
    if (const ssize_t got = ::getrandom(bytes.data() + filled, bytes.size() - filled, 0); got > 0)
      filled += static_cast<std::size_t>(got);
  std::string token = "vm_";
  for (const unsigned char byte : bytes) token += letters[byte & 63U];
  return token;
}

/// The clock counts nanoseconds from 1970 and ends in 2262. Later times become its last, earlier ones its first.
WallTime wall_time(std::chrono::sys_seconds time) {
  const auto first = std::chrono::ceil<std::chrono::seconds>(WallTime::min());
  const auto last = std::chrono::floor<std::chrono::seconds>(WallTime::max());
  return std::clamp(time, first, last);
}

}  // namespace

std::optional<WallTime> time_of(std::string_view text) {
  using namespace std::chrono;
  const auto year = take_number(text, 4);
  if (!year || !take(text, '-')) return std::nullopt;
  const auto month = take_number(text, 2);
  if (!month || !take(text, '-')) return std::nullopt;
  const auto day = take_number(text, 2);
  if (!day) return std::nullopt;
  const year_month_day date{std::chrono::year(*year), std::chrono::month(static_cast<unsigned>(*month)),
                            std::chrono::day(static_cast<unsigned>(*day))};
  if (!date.ok()) return std::nullopt;
  if (text.empty()) return wall_time(sys_days(date));
  if (!take(text, 'T')) return std::nullopt;
  const auto hour = take_number(text, 2);
  if (!hour || *hour > 23 || !take(text, ':')) return std::nullopt;
  const auto minute = take_number(text, 2);
  if (!minute || *minute > 59 || !take(text, ':')) return std::nullopt;
  const auto second = take_number(text, 2);
  if (!second || *second > 59 || text != "Z") return std::nullopt;
  return wall_time(sys_days(date) + hours(*hour) + minutes(*minute) + seconds(*second));
}

Expected<Tokens> Tokens::parse(std::string_view text) {
  Tokens tokens;
  std::istringstream lines{std::string(text)};
  std::size_t number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    std::istringstream words(line.substr(0, line.find('#')));
    std::string name, roles, digest, until, more;
    if (!(words >> name)) continue;
    words >> roles >> digest >> until >> more;
    Entry entry;
    if (!is_name(name)) return bad_line(number, "has a name that is not made of letters, digits and . _ - @");
    const auto rights = rights_of(roles);
    if (!rights) return bad_line(number, "has no known roles (submit, read, cancel or admin, separated by commas)");
    if (!is_sha256(digest)) return bad_line(number, "has no SHA-256 of 64 lowercase hexadecimal digits");
    if (!until.empty() && !(entry.until = time_of(until)))
      return bad_line(number, "has a time that is neither 2027-01-31 nor 2027-01-31T12:00:00Z");
    if (!more.empty()) return bad_line(number, "has too many words");
    if (std::ranges::find(tokens.entries_, digest, &Entry::digest) != tokens.entries_.end())
      return bad_line(number, "repeats a token of an earlier line");
    entry.principal = {name, *rights};
    entry.digest = digest;
    tokens.entries_.push_back(std::move(entry));
  }
  return tokens;
}

std::optional<Principal> Tokens::find(std::string_view token, WallTime now) const {
  if (token.empty() || token.size() > kMostTokenBytes) return std::nullopt;
  const std::string digest = sha256(token);
  const Entry* found = nullptr;
  for (const Entry& entry : entries_)
    if (are_equal(entry.digest, digest)) found = &entry;
  if (found == nullptr || (found->until && *found->until <= now)) return std::nullopt;
  return found->principal;
}

Expected<NewToken> make_token(const std::string& name, const std::vector<std::string>& roles,
                              const std::string& until) {
  NewToken made;
  made.token = random_token();
  std::string joined;
  for (const std::string& role : roles) joined += (joined.empty() ? "" : ",") + role;
  made.line = name + " " + joined + " " + sha256(made.token) + (until.empty() ? "" : " " + until);
  const auto tokens = Tokens::parse(made.line);
  if (!tokens) return tl::unexpected(tokens.error());
  if (tokens->size() != 1) return bad_option("The token needs a name; a '#' cannot be in it.");
  return made;
}

}  // namespace varimesh::server
