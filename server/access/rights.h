// What a caller may do, and what each method asks for.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace varimesh::server {

/// A set of rights.
class Rights {
 public:
  constexpr Rights() = default;
  constexpr explicit Rights(std::uint8_t bits) : bits_(bits) {}
  constexpr bool contains(Rights other) const { return (bits_ & other.bits_) == other.bits_; }
  constexpr Rights operator|(Rights other) const { return Rights(static_cast<std::uint8_t>(bits_ | other.bits_)); }
  constexpr Rights without(Rights other) const { return Rights(static_cast<std::uint8_t>(bits_ & ~other.bits_)); }
  constexpr bool operator==(const Rights&) const = default;

 private:
  std::uint8_t bits_ = 0;
};

inline constexpr Rights kNoRight{0};
inline constexpr Rights kSubmit{1};  ///< Upload meshes and submit jobs.
inline constexpr Rights kRead{2};    ///< See jobs and meshes, and fetch results.
inline constexpr Rights kCancel{4};  ///< Cancel and delete jobs, and delete meshes.
inline constexpr Rights kAdmin{8};   ///< Do all of this with the jobs and meshes of every owner.
inline constexpr Rights kAllRights = kSubmit | kRead | kCancel | kAdmin;

/// Returns the right of this name ("submit", "read", "cancel", "admin"); nothing if there is none. "admin" includes the
/// others.
std::optional<Rights> right_of(std::string_view name);
/// Returns the names of the rights, separated by commas.
std::string names_of(Rights rights);

/// Everything that a client can ask the server for.
enum class Method {
  UploadMesh,
  SendMesh,
  QueryUpload,
  DownloadMesh,
  DeleteMesh,
  SubmitJob,
  GetJob,
  ListJobs,
  CancelJob,
  DeleteJob,
  WatchJob,
  GetResult,
  GetServerInfo,
  Optimise,
  Reflection,
  LivePage,
  LivePageCancel,
};

/// What a method asks of its callers.
struct MethodRule {
  Method method;
  std::string_view name;  ///< As gRPC names it: "/varimesh.v1.JobService/GetJob".
  Rights needed;          ///< No right: every caller that has a token.
};

/// The one table of rights. Health checks are not in it: everybody may ask whether the server is there.
std::span<const MethodRule> method_rules();
const MethodRule& rule_of(Method method);

}  // namespace varimesh::server
