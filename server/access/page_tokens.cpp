// A token is one block: the number of the store's token, and a part of the digest of its owner's name.
#include "server/access/page_tokens.h"

#include <openssl/evp.h>

#include <array>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <string_view>

#include "core/base/sha256.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

using Block = std::array<unsigned char, 16>;
constexpr std::string_view kDigits = "0123456789abcdef";

/// Encrypts or decrypts a block. Nothing if OpenSSL fails or the secret has the wrong size.
std::optional<Block> crypt(const Block& block, const std::string& secret, bool encrypt) {
  const std::unique_ptr<EVP_CIPHER_CTX, decltype(&EVP_CIPHER_CTX_free)> cipher(EVP_CIPHER_CTX_new(),
                                                                               EVP_CIPHER_CTX_free);
  Block made{};
  int size = 0;
  if (cipher == nullptr || secret.size() != block.size() ||
      EVP_CipherInit_ex(cipher.get(), EVP_aes_128_ecb(), nullptr, reinterpret_cast<const unsigned char*>(secret.data()),
                        nullptr, encrypt ? 1 : 0) != 1)
    return std::nullopt;
  EVP_CIPHER_CTX_set_padding(cipher.get(), 0);
  if (EVP_CipherUpdate(cipher.get(), made.data(), &size, block.data(), static_cast<int>(block.size())) != 1 ||
      size != static_cast<int>(made.size()))
    return std::nullopt;
  return made;
}

Block block_of(std::int64_t number, const std::string& owner) {
  Block block{};
  std::memcpy(block.data(), &number, sizeof number);
  const std::string digest = sha256(owner);  // in hexadecimal digits
  std::memcpy(block.data() + sizeof number, digest.data(), block.size() - sizeof number);
  return block;
}

/// Reads 32 hexadecimal digits.
std::optional<Block> block_of(const std::string& digits) {
  Block block{};
  if (digits.size() != 2 * block.size()) return std::nullopt;
  for (std::size_t i = 0; i < digits.size(); ++i) {
    const auto value = kDigits.find(digits[i]);
    if (value == std::string_view::npos) return std::nullopt;
    block[i / 2] = static_cast<unsigned char>(block[i / 2] << 4U | value);
  }
  return block;
}

}  // namespace

std::string PageTokens::seal(const std::string& token, const Caller& caller) const {
  if (token.empty() || caller.sees_all()) return token;
  std::int64_t number = 0;
  std::from_chars(token.data(), token.data() + token.size(), number);
  const auto sealed = crypt(block_of(number, caller.owner), secret_, true);
  std::string digits;
  if (!sealed) return digits;
  for (const unsigned char byte : *sealed) digits.append({kDigits[byte >> 4U], kDigits[byte & 15U]});
  return digits;
}

Answer<std::string> PageTokens::open(const std::string& sealed, const Caller& caller) const {
  if (sealed.empty() || caller.sees_all()) return sealed;
  const auto block = block_of(sealed);
  const auto opened = block ? crypt(*block, secret_, false) : std::nullopt;
  std::int64_t number = 0;
  if (opened) std::memcpy(&number, opened->data(), sizeof number);
  if (!opened || *opened != block_of(number, caller.owner))
    return bad_request(
        "The page token was not issued to this caller by this server; list the jobs from the first page.");
  return std::to_string(number);
}

}  // namespace varimesh::server
