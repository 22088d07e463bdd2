// Which addresses anybody on the internet may have.
#pragma once

struct sockaddr;

namespace varimesh::server {

/// Whether an address belongs to the public internet. Those of this machine, of private and local networks, of
/// documentation and of tunnels do not, nor do those with which one IP version stands for the other: IANA's registries
/// of special addresses (RFC 6890). A server that calls addresses for strangers calls no others.
bool is_public(const sockaddr& address);

}  // namespace varimesh::server
