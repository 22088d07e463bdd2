// Whom the server calls at the end of jobs, how often it tries, and what is told of it.
#pragma once

#include <chrono>
#include <functional>
#include <string>

#include "server/fetch/post.h"

namespace varimesh::server {

struct WebhookSettings {
  std::string file;       ///< Of the receivers. Empty: nobody is called, and no job may have a webhook.
  std::string authority;  ///< As PostRequest::authority.
  /// The pause before the second attempt. Each later one is twice as long, up to an hour.
  std::chrono::milliseconds first_pause{5'000};
  int most_attempts = 24;  ///< After so many a call is given up; with the pauses above, that is after half a day.
  std::function<Expected<int>(const PostRequest&)> post;
};

/// What is told of each call.
enum class CallEnd { Delivered, Failed, GivenUp };

}  // namespace varimesh::server
