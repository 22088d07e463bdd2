// Reads the history and the meshes of a job.
#include "server/api/result_source.h"

namespace varimesh::server {

Answer<Pull> ResultSource::pull(Piece* piece) {
  constexpr int kBatch = 1000;
  if (!job_sent_) {
    job_sent_ = true;
    piece->job = job_;
    return Pull::Message;
  }
  if (!history_) {
    auto history = api_.scheduler.history(job_.name());
    if (!history) return tl::unexpected(history.error());
    history_ = std::move(*history);
  }
  if (next_iteration_ < history_->iterations_size()) {
    piece->history.emplace();
    const int end = std::min(next_iteration_ + kBatch, history_->iterations_size());
    for (; next_iteration_ < end; ++next_iteration_)
      piece->history->add_iterations()->Swap(history_->mutable_iterations(next_iteration_));
    return Pull::Message;
  }
  return with_meshes_ ? pull_chunk(piece) : Answer<Pull>(Pull::End);
}

Answer<Pull> ResultSource::pull_chunk(Piece* piece) {
  while (result_ < job_.results_size()) {
    if (reader_ == nullptr) {
      const std::string& digest = job_.results(result_).digest();
      if (!check_) check_ = api_.meshes.check(digest);
      if (*check_ != nullptr && (*check_)->step()) return Pull::Again;
      check_.reset();
      auto reader = api_.meshes.read(digest);
      if (!reader) return tl::unexpected(reader.error());
      reader_ = std::move(*reader);
      offset_ = 0;
    }
    auto data = reader_->read(offset_, false);
    if (!data) return tl::unexpected(data.error());
    if (data->size > 0) {
      v1::ResultChunk& chunk = piece->chunk.emplace();
      chunk.set_result(result_);
      chunk.mutable_chunk()->set_offset(offset_);
      chunk.mutable_chunk()->set_data(std::move(data->bytes));
      offset_ += data->size;
      return Pull::Message;
    }
    reader_.reset();
    ++result_;
  }
  return Pull::End;
}

}  // namespace varimesh::server
