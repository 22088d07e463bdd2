// The addresses of --http, in one table: requests are routed by it, and /v1/openapi.json describes it.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "server/access/rights.h"

namespace varimesh::server {

/// A field of the query, and the field of a message of the contract that it fills in.
struct QueryField {
  std::string_view name;     ///< "pageSize"; "labels." with any text after it.
  std::string_view message;  ///< "ListJobsRequest"
  std::string_view field;    ///< "page_size"
  bool is_needed = false;
};

/// A method at an address.
struct Route {
  enum class To {
    Info,
    Document,
    Submit,
    List,
    Get,
    Delete,
    Cancel,
    Events,
    Result,
    Mesh,
    SendMesh,
    QueryUpload,
  };
  To to;
  std::string_view method;  ///< Of HTTP.
  std::string_view path;    ///< "/v1/jobs/{job}/cancel"; {…} is one part, and not empty.
  Method call;              ///< What is called, and what the caller therefore needs.
  std::string_view service, rpc;
  std::vector<std::string_view> bodies;  ///< The types that the body may have. None: there is no body.
  std::string_view answer;               ///< The type of the answer.
  std::vector<QueryField> query;
};

/// All of them.
std::span<const Route> routes();

/// Where a request goes.
struct Routed {
  const Route* route = nullptr;  ///< Null: nowhere.
  std::string id;                ///< What stands for {…}.
  std::string methods;           ///< Those that the address takes, as the header Allow has them; empty: there is none.
};
Routed route(std::string_view method, std::string_view path);

}  // namespace varimesh::server
