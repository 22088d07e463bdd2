// A build without libjwt accepts no JSON Web Tokens.
#include "server/access/json_web_tokens.h"

namespace varimesh::server {

struct JsonWebTokens::Keys {};

JsonWebTokens::JsonWebTokens(JsonWebTokenSettings settings, std::unique_ptr<Keys> keys)
    : settings_(std::move(settings)), keys_(std::move(keys)) {}
JsonWebTokens::~JsonWebTokens() = default;
bool JsonWebTokens::available() { return false; }
Expected<std::shared_ptr<const JsonWebTokens>> JsonWebTokens::parse(const JsonWebTokenSettings&, const std::string&) {
  return bad_option(
      "This varimeshd was built without libjwt and knows no JSON Web Tokens; install Debian's libjwt-dev "
      "and build it again, or use --tokens.");
}
bool JsonWebTokens::looks_like_one(std::string_view) { return false; }
bool JsonWebTokens::lacks_key_of(std::string_view) const { return false; }
std::optional<Principal> JsonWebTokens::find(std::string_view, WallTime) const { return std::nullopt; }

}  // namespace varimesh::server
