// What shows the server who calls, and the client who answers.
#pragma once

#include <grpcpp/client_context.h>
#include <grpcpp/security/credentials.h>

#include "client/client.h"

namespace varimesh::client {

/// Returns the token of the credentials, from their file if it is in one; empty if there is none.
Outcome<std::string> token_of(const Credentials& credentials);

/// Returns the credentials of a channel. `encrypted`: the address says that it is; otherwise it is if there is an
/// authority or a certificate.
Outcome<std::shared_ptr<grpc::ChannelCredentials>> channel_credentials(const Credentials& credentials, bool encrypted);

/// Adds the token to a call, if there is one.
void authorise(const Settings& settings, grpc::ClientContext* call);

}  // namespace varimesh::client
