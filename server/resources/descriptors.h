// The descriptors that this process may have open.
#pragma once

namespace varimesh::server {

/// Raises the limit of open descriptors to the largest that the system allows this process. Each connection takes one,
/// and a server without free ones accepts nobody. Returns the limit; 0 if it cannot be found out.
long raise_descriptor_limit();

}  // namespace varimesh::server
