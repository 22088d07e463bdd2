// Uploads into the store, by streams of two owners that begin, are cut, take each other over and end in any order. An
// input is a sequence of calls; every answer is compared with that of a plain model.
#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/base/sha256.h"
#include "server/meshes/directory_mesh_store.h"
#include "tests/fuzz/program/memory.h"

namespace {

using namespace varimesh;
using namespace varimesh::server;
using fuzz::expect;

/// The meshes that are uploaded.
const std::string& content(std::size_t number) {
  static const std::string all[] = {"", "a", "some mesh", std::string(300, 'm')};
  return all[number % std::size(all)];
}

std::string owner(std::size_t number) { return number % 2 == 0 ? "ann" : "bob"; }

/// What the model knows of an upload that has not ended.
struct Upload {
  std::string digest;
  std::int64_t size = 0;
  std::string bytes;
  std::int64_t generation = 0;
  std::chrono::steady_clock::time_point touched;
};

struct Ticket {
  UploadTicket ticket;
  std::int64_t made = 0;  ///< Which of all uploads of this owner and id it is for.
};

class Trial {
 public:
  Trial() {
    DirectoryMeshSettings settings;
    settings.max_mesh_bytes = 1000;
    settings.clock = [this] { return now_; };
    static const std::string folder =
        std::filesystem::is_directory("/dev/shm") ? "/dev/shm" : std::filesystem::temp_directory_path().string();
    auto made = DirectoryMeshStore::create(folder, std::move(settings));
    expect(made.has_value(), "no store can be made");
    store_ = std::move(*made);
  }

  void run(std::string_view input) {
    while (input.size() >= 3) {
      const auto at = [&](std::size_t i) { return static_cast<std::size_t>(static_cast<unsigned char>(input[i])); };
      step(at(0), at(1), at(2));
      input.remove_prefix(3);
    }
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t who = 0; who < 2; ++who) check_stored(content(i), owner(who));
  }

 private:
  using Key = std::pair<std::string, std::string>;

  void step(std::size_t what, std::size_t one, std::size_t other) {
    switch (what % 8) {
      case 0:
      case 1:
        return begin(std::to_string(one % 3), content(one >> 2U), owner(one >> 4U), other);
      case 2:
      case 3:
      case 4:
        return append(one, other);
      case 5:
        return finish(one);
      case 6:
        return query(std::to_string(one % 3), content(one >> 2U), owner(one >> 4U));
      default:
        now_ += std::chrono::minutes(other % 12);
        if (one % 2 == 0) store_->sweep(), drop_old();
    }
  }

  void drop_old() {
    std::erase_if(uploads_, [&](const auto& one) { return now_ - one.second.touched > kUploadLifetime; });
  }

  bool has(const std::string& digest, const std::string& who) const { return stored_.contains({who, digest}); }

  void begin(const std::string& id, const std::string& bytes, const std::string& who, std::size_t lie) {
    const std::string digest = lie % 7 == 1 ? sha256("another mesh") : lie % 31 == 2 ? "no digest" : sha256(bytes);
    const std::int64_t size = lie % 11 == 3   ? -1
                              : lie % 13 == 4 ? 2000
                                              : static_cast<std::int64_t>(bytes.size()) + (lie % 17 == 5 ? 1 : 0);
    const auto begun = store_->begin_upload(id, digest, size, who);
    if (size < 0 || size > 1000 || !is_sha256(digest)) return expect(!begun, "a wrong header was taken");
    if (has(digest, who)) return expect(begun && begun->complete, "a stored mesh is to be sent again");
    drop_old();
    Upload& upload = uploads_[{who, id}];
    if (upload.digest.empty()) upload = {digest, size, "", 0, now_}, ++made_[{who, id}];
    if (upload.digest != digest || upload.size != size)
      return expect(!begun && begun.error().reason == "UPLOAD_ID_USED", "an id was used for two meshes");
    expect(begun && !begun->complete, "an upload cannot begin");
    expect(begun->committed == static_cast<std::int64_t>(upload.bytes.size()), "other bytes are committed");
    expect(begun->generation > 0 && begun->generation != upload.generation, "two streams have one number");
    upload.generation = begun->generation;
    upload.touched = now_;
    tickets_.push_back({*begun, made_[{who, id}]});
  }

  /// The upload that a ticket may write; null if another stream has taken it over, or it has ended.
  Upload* upload_of(const Ticket& ticket) {
    const Key key{ticket.ticket.owner, ticket.ticket.id};
    const auto found = uploads_.find(key);
    const bool is_it = found != uploads_.end() && made_[key] == ticket.made;
    return is_it && found->second.generation == ticket.ticket.generation ? &found->second : nullptr;
  }

  void append(std::size_t which, std::size_t how) {
    if (tickets_.empty()) return;
    const Ticket& ticket = tickets_[which % tickets_.size()];
    Upload* const upload = upload_of(ticket);
    const std::int64_t committed = upload == nullptr ? 0 : static_cast<std::int64_t>(upload->bytes.size());
    std::string_view rest = "some other bytes";
    for (std::size_t i = 0; i < 4 && upload != nullptr; ++i)
      if (sha256(content(i)) == upload->digest && content(i).size() >= upload->bytes.size())
        rest = std::string_view(content(i)).substr(upload->bytes.size());
    const std::string bytes = how % 19 == 6   ? "wrong"
                              : how % 23 == 7 ? std::string(400, 'x')
                                              : std::string(rest.substr(0, how % 2 == 0 ? rest.size() : how / 8));
    const std::int64_t offset = committed + (how % 29 == 8 ? 1 : how % 31 == 9 ? -1 : 0);
    const auto appended = store_->append(ticket.ticket, offset, bytes);
    if (upload == nullptr || offset != committed) return expect(!appended, "bytes that do not follow were taken");
    if (committed + static_cast<std::int64_t>(bytes.size()) > upload->size) {
      expect(!appended, "more bytes were taken than announced");
      uploads_.erase({ticket.ticket.owner, ticket.ticket.id});
      return;
    }
    upload->bytes += bytes;
    upload->touched = now_;
    expect(appended && *appended == static_cast<std::int64_t>(upload->bytes.size()), "bytes were not taken");
  }

  void finish(std::size_t which) {
    if (tickets_.empty()) return;
    const Ticket& ticket = tickets_[which % tickets_.size()];
    Upload* const upload = upload_of(ticket);
    const auto finished = store_->finish_upload(ticket.ticket);
    if (upload == nullptr || static_cast<std::int64_t>(upload->bytes.size()) != upload->size)
      return expect(!finished && !finished.error().sentence.empty(), "an upload ended that is not whole");
    const bool is_it = sha256(upload->bytes) == upload->digest;
    expect(finished.has_value() == is_it, "an upload ended with another digest, or did not end");
    if (is_it) stored_.insert({{ticket.ticket.owner, upload->digest}, upload->bytes});
    uploads_.erase({ticket.ticket.owner, ticket.ticket.id});
  }

  void query(const std::string& id, const std::string& bytes, const std::string& who) {
    const std::string digest = sha256(bytes);
    const auto known = store_->query_upload(id, digest, who);
    if (has(digest, who)) return expect(known && known->complete, "a stored mesh is not known");
    const auto found = uploads_.find({who, id});
    if (found == uploads_.end()) return expect(!known, "an upload is known that was not begun");
    expect(known && !known->complete && known->committed == static_cast<std::int64_t>(found->second.bytes.size()),
           "an upload is not known as it is");
  }

  void check_stored(const std::string& bytes, const std::string& who) {
    const std::string digest = sha256(bytes);
    expect(store_->belongs_to(digest, who) == has(digest, who), "a mesh belongs to somebody who has not sent it");
    if (!has(digest, who)) return;
    const auto blob = store_->open(digest);
    expect(blob && (*blob)->bytes() == bytes, "a stored mesh has other bytes");
  }

  std::chrono::steady_clock::time_point now_{};
  std::unique_ptr<DirectoryMeshStore> store_;
  std::map<Key, Upload> uploads_;      ///< By owner and id.
  std::map<Key, std::int64_t> made_;   ///< How many uploads there were of an owner and id.
  std::map<Key, std::string> stored_;  ///< By owner and digest.
  std::vector<Ticket> tickets_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::size_t kMostBytes = 600;
  Trial().run({reinterpret_cast<const char*>(data), std::min(size, kMostBytes)});
  return 0;
}
