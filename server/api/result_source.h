// The result of a job as the source of a stream. GetResult and Optimise share it.
#pragma once

#include <memory>
#include <optional>

#include "server/api/context.h"
#include "server/streams/pump.h"
#include "varimesh/v1/service.pb.h"

namespace varimesh::server {

/// Gives the result of a job piece by piece: the job, its history in batches, then the bytes of its meshes.
class ResultSource {
 public:
  ResultSource(const ApiContext& api, v1::Job job, bool with_meshes)
      : api_(api), job_(std::move(job)), with_meshes_(with_meshes) {}

  /// A piece of the result; exactly one of the three has a value.
  struct Piece {
    std::optional<v1::Job> job;
    std::optional<v1::History> history;
    std::optional<v1::ResultChunk> chunk;
  };
  /// Fills in the next piece, unless it answers that the end has come or that it is to be asked again.
  Answer<Pull> pull(Piece* piece);

 private:
  Answer<Pull> pull_chunk(Piece* piece);

  const ApiContext& api_;
  const v1::Job job_;
  const bool with_meshes_;
  bool job_sent_ = false;
  std::optional<v1::History> history_;
  int next_iteration_ = 0;
  int result_ = 0;
  std::optional<std::unique_ptr<BlobCheck>> check_;
  std::unique_ptr<BlobReader> reader_;
  std::int64_t offset_ = 0;
};

}  // namespace varimesh::server
