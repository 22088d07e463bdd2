// Texts of a process that may have been taken over by a mesh.
#pragma once

#include <google/protobuf/message.h>

#include "core/base/error.h"
#include "server/isolation/worker.pb.h"

namespace varimesh::server {

/// Makes every text of the message, and of those inside it, one that a terminal or a log only shows (as_plain_text()).
void make_plain(google::protobuf::Message& message);
/// The error that the process tells, as such a text.
Error plain_error(const worker::Failure& failure);

}  // namespace varimesh::server
