// The address of a bucket, and the credentials for it.
#pragma once

#include <string>

#include "core/base/error.h"

namespace varimesh::server {

/// A place for objects in a bucket.
struct S3Address {
  std::string bucket;
  std::string prefix;    ///< Of all keys: empty, or with a slash at its end.
  std::string endpoint;  ///< http(s)://HOST[:PORT], without a slash at its end. The bucket is the first part of a path.
  std::string region = "us-east-1";
};

/// Whether the text is meant to be the address of a bucket: it begins with s3://.
bool is_s3(const std::string& address);

/// Reads s3://BUCKET[/PREFIX][?endpoint=URL][&region=NAME]. Without an endpoint it is Amazon's in this region. Errors:
/// BadOption, also for credentials in the address, which other users could read in the list of processes.
Expected<S3Address> parse_s3_address(const std::string& address);

/// A key of an S3 account. Never written to a log or a message.
struct S3Credentials {
  std::string key_id, secret;
  std::string token;  ///< Of a session; empty: none.
};

/// Reads the credentials from the environment (AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY, AWS_SESSION_TOKEN) or else
/// from the profile AWS_PROFILE ("default") of the file AWS_SHARED_CREDENTIALS_FILE (~/.aws/credentials). Errors:
/// BadOption if there are none.
Expected<S3Credentials> read_s3_credentials();

}  // namespace varimesh::server
