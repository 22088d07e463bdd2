// The table of rights.
#include "server/access/rights.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <utility>

namespace varimesh::server {
namespace {

constexpr std::array<std::pair<std::string_view, Rights>, 4> kNames{
    {{"submit", kSubmit}, {"read", kRead}, {"cancel", kCancel}, {"admin", kAllRights}}};

constexpr std::array kRules{
    MethodRule{Method::UploadMesh, "/varimesh.v1.MeshService/UploadMesh", kSubmit},
    MethodRule{Method::SendMesh, "/varimesh.v1.MeshService/SendMesh", kSubmit},
    MethodRule{Method::QueryUpload, "/varimesh.v1.MeshService/QueryUpload", kSubmit},
    MethodRule{Method::DownloadMesh, "/varimesh.v1.MeshService/DownloadMesh", kRead},
    MethodRule{Method::DeleteMesh, "/varimesh.v1.MeshService/DeleteMesh", kCancel},
    MethodRule{Method::SubmitJob, "/varimesh.v1.JobService/SubmitJob", kSubmit},
    MethodRule{Method::GetJob, "/varimesh.v1.JobService/GetJob", kRead},
    MethodRule{Method::ListJobs, "/varimesh.v1.JobService/ListJobs", kRead},
    MethodRule{Method::CancelJob, "/varimesh.v1.JobService/CancelJob", kCancel},
    MethodRule{Method::DeleteJob, "/varimesh.v1.JobService/DeleteJob", kCancel},
    MethodRule{Method::WatchJob, "/varimesh.v1.JobService/WatchJob", kRead},
    MethodRule{Method::GetResult, "/varimesh.v1.JobService/GetResult", kRead},
    MethodRule{Method::GetServerInfo, "/varimesh.v1.JobService/GetServerInfo", kNoRight},
    // It also delivers the result.
    MethodRule{Method::Optimise, "/varimesh.v1.OptimiseService/Optimise", kSubmit | kRead},
    MethodRule{Method::Reflection, "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", kRead},
    MethodRule{Method::LivePage, "the live page", kRead},
    MethodRule{Method::LivePageCancel, "a cancel on the live page", kCancel},
};

}  // namespace

std::optional<Rights> right_of(std::string_view name) {
  for (const auto& [known, right] : kNames)
    if (known == name) return right;
  return std::nullopt;
}

std::string names_of(Rights rights) {
  if (rights == kAllRights) return "admin";
  std::string names;
  for (const auto& [name, right] : kNames)
    if (right != kAllRights && rights.contains(right)) names += (names.empty() ? "" : ",") + std::string(name);
  return names;
}

std::span<const MethodRule> method_rules() { return kRules; }

const MethodRule& rule_of(Method method) {
  const auto rule = std::ranges::find(kRules, method, &MethodRule::method);
  assert(rule != kRules.end());
  return *rule;
}

}  // namespace varimesh::server
