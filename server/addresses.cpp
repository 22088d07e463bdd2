// Parsing of addresses.
#include "server/addresses.h"

#include <arpa/inet.h>

#include <charconv>

namespace varimesh::server {
namespace {

/// Returns the host of HOST:PORT or [HOST]:PORT.
std::string host_of(const std::string& address) {
  const auto colon = address.rfind(':');
  std::string host = address.substr(0, colon);
  if (host.size() > 1 && host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
  return host;
}

/// gRPC itself takes the port modulo 65536, and 443 if there is none, so it is checked here.
bool has_valid_port(const std::string& address) {
  const auto colon = address.rfind(':');
  if (colon == std::string::npos || colon + 1 == address.size()) return false;
  unsigned port = 0;
  const auto [end, error] = std::from_chars(address.data() + colon + 1, address.data() + address.size(), port);
  return error == std::errc{} && end == address.data() + address.size() && port <= 65535;
}

}  // namespace

bool is_unix_socket(const std::string& address) { return address.rfind("unix:", 0) == 0; }

bool is_loopback(const std::string& address) {
  if (is_unix_socket(address)) return true;
  const std::string host = host_of(address);
  in_addr v4{};
  in6_addr v6{};
  if (inet_pton(AF_INET, host.c_str(), &v4) == 1) return (ntohl(v4.s_addr) >> 24) == 127;
  if (inet_pton(AF_INET6, host.c_str(), &v6) == 1) return IN6_IS_ADDR_LOOPBACK(&v6);
  return host == "localhost";
}

Expected<void> check_listen_address(const std::string& address, const Protection& protection) {
  if (is_unix_socket(address) && protection.tls)
    return bad_option("A unix socket never leaves this machine and is not encrypted; give --listen HOST:PORT for TLS.");
  if (is_unix_socket(address)) return {};
  if (address.rfind(':') == std::string::npos)
    return bad_option("The address '" + address + "' has no port; write HOST:PORT or unix:PATH.");
  if (!has_valid_port(address))
    return bad_option("The address " + address +
                      " has no port from 0 to 65535; write HOST:PORT, with port 0 for a free port.");
  const bool is_safe = protection.tls && (protection.mutual || protection.tokens);
  if (!is_loopback(address) && !is_safe && !protection.insecure)
    return bad_option("Anybody who can reach " + address + " could " +
                      (protection.tls ? "use this server"
                                      : "use this server or read what its clients send, because nothing is encrypted") +
                      "; listen on 127.0.0.1, or give --tls-certificate and --tls-key, and either --tls-authority or "
                      "--tokens. If you trust the network and everybody in it, add --insecure.");
  return {};
}

Expected<void> check_https_address(const std::string& address, const Protection& protection) {
  if (!protection.tls)
    return bad_option("--https needs --tls-certificate and --tls-key; 'varimesh certificates' makes files to try it.");
  if (is_unix_socket(address)) return bad_option("--https needs HOST:PORT, not the socket '" + address + "'.");
  return check_listen_address(address, protection);
}

std::string peer_address(const std::string& peer) {
  const auto scheme = peer.find(':');
  const std::string kind = peer.substr(0, scheme);
  if (scheme == std::string::npos || (kind != "ipv4" && kind != "ipv6")) return kind;
  std::string address = peer.substr(scheme + 1, peer.rfind(':') - scheme - 1);
  for (const std::string bracket : {"[", "]", "%5B", "%5D"})
    if (const auto at = address.find(bracket); at != std::string::npos) address.erase(at, bracket.size());
  return address;
}

}  // namespace varimesh::server
