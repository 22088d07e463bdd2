// Objects in a bucket, and how two servers agree on deleting one.
#include "server/meshes/s3/bucket_objects.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <map>
#include <set>

#include "core/base/sha256.h"
#include "server/meshes/blobs.h"
#include "server/meshes/disk.h"
#include "server/meshes/s3/file_cache.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

using std::chrono::steady_clock;

/// How often the whole bucket is listed.
constexpr std::chrono::minutes kLookEvery{5};
/// A sweeper that has not been seen at work for this long has ended.
constexpr std::chrono::minutes kSweeperLost{12};
constexpr char kSweeper[] = "sweeper";
constexpr Patience kPatience{10'000};

constexpr std::size_t kDigest = 64, kMeshes = sizeof("meshes/") - 1, kUpload = sizeof("upload-") - 1;

/// What is written into objects whose tag must change.
std::string random_digits() { return random_name().substr(0, 16); }

std::string folder_of(const std::string& digest) { return "meshes/" + digest + "/"; }
std::string upload_folder(const std::string& key) { return "uploads/" + key.substr(kUpload) + "/"; }

std::string part_key(const std::string& key, std::int64_t offset) {
  char digits[32];
  std::snprintf(digits, sizeof digits, "p-%016llx", static_cast<unsigned long long>(offset));
  return upload_folder(key) + digits;
}

/// The key of a note, or of what an upload is.
std::string key_of(const std::string& name) {
  const std::size_t dot = name.find('.');
  const std::string stem = name.substr(0, dot), ending = name.substr(dot + 1);
  if (name.starts_with("upload-")) return upload_folder(stem) + ending;
  return folder_of(stem) + (is_sha256(ending) ? "o-" : "") + ending;
}

struct Copy {
  std::string name;
  std::int64_t size = 0;
  bool marked = false;  ///< Somebody is about to delete it.
};

/// What the bucket has of a mesh.
struct Seen {
  std::vector<Copy> copies;
  std::string used;  ///< The tag of `used`; empty: there is none.
  std::int64_t changed = 0;
  std::set<std::string> marks;
  std::vector<Object> notes;

  void add(const std::string& digest, const std::string& name, const S3Object& object) {
    if (name.starts_with("g-")) copies.push_back({name.substr(2), object.size});
    if (name.starts_with("x-")) marks.insert(name.substr(2));
    if (name == "used") used = object.tag;
    if (name == "used" || name.starts_with("g-")) changed = std::max(changed, object.changed);
    const bool is_owner = name.starts_with("o-");
    // The rest of a mesh that is gone is swept like its notes.
    if (!name.starts_with("g-"))
      notes.push_back({digest + "." + (is_owner ? name.substr(2) : name), object.size, object.tag, object.changed});
  }
  void mark_copies() {
    for (Copy& copy : copies) {
      const auto mark = marks.lower_bound(copy.name);
      copy.marked = mark != marks.end() && mark->starts_with(copy.name + "-");
    }
  }
  /// The copy that stays, as far as anybody can see now.
  const Copy* good() const {
    const auto found = std::ranges::find(copies, false, &Copy::marked);
    return found == copies.end() ? nullptr : &*found;
  }
};

class BucketObjects : public ObjectStore {
 public:
  BucketObjects(std::shared_ptr<S3Client> client, const std::string& directory, std::int64_t max_cache_bytes,
                std::function<void(const std::string&)> log)
      : client_(std::move(client)), cache_(directory, max_cache_bytes), log_(std::move(log)) {}

  const std::filesystem::path& scratch() const override { return cache_.directory(); }
  const std::filesystem::path& directory() const override { return cache_.directory(); }
  std::filesystem::path new_path() override { return cache_.new_path(); }

  Answer<std::string> put_file(const std::string& digest, const std::filesystem::path& path, std::int64_t size,
                               Patience patience) override;
  Answer<void> put(const std::string& name, std::string_view bytes, Patience patience) override {
    const std::string random = random_digits();
    return client_->put(key_of(name), bytes.empty() ? random : bytes, patience).map([](const std::string&) {});
  }
  Answer<std::optional<Object>> find(const std::string& name, Patience patience) override;
  Answer<std::optional<Object>> use(const std::string& digest, Patience patience) override;
  Answer<OpenObject> get(const std::string& digest, bool again, Patience patience) override;
  Answer<std::vector<Object>> list(const std::string& beginning, Patience patience) override;
  Answer<void> remove(const std::string& name, Patience patience) override {
    return client_->remove(key_of(name), patience);
  }
  Answer<bool> remove_unused(const std::string& digest, const std::string& tag,
                             const std::function<Answer<bool>()>& may_go, Patience patience) override;
  /// The copies were compared when they were downloaded; it is this server's disk that fails.
  bool set_aside(const std::string&, const std::string&) override { return false; }

  std::shared_ptr<const void> hold(const std::string&, bool) override { return std::make_shared<const int>(); }
  Answer<UploadState> upload_state(const std::string& key, Patience patience) override;
  std::optional<std::filesystem::path> upload_file(const std::string&) const override { return std::nullopt; }
  Answer<void> put_part(const std::string& key, std::int64_t offset, std::string_view bytes,
                        Patience patience) override {
    return client_->put(part_key(key, offset), bytes, patience).map([](const std::string&) {});
  }
  Answer<void> get_parts(const std::string& key, std::int64_t size, int file, Patience patience) override;
  Answer<void> remove_upload(const std::string& key, Patience patience) override;
  bool may_sweep(steady_clock::time_point now) override;

 private:
  Answer<Seen> look_at(const std::string& digest, Patience patience);
  Answer<std::string> note_use(const std::string& digest, Patience patience) {
    return client_->put(folder_of(digest) + "used", random_digits(), patience);
  }
  Answer<OpenObject> download(const std::string& digest, const Copy& copy, Patience patience);
  /// Moves a damaged copy, which is in a file, to where nobody looks for it.
  Answer<void> set_copy_aside(const std::string& digest, const Copy& copy, const std::filesystem::path& path,
                              Patience patience);

  const std::shared_ptr<S3Client> client_;
  FileCache cache_;
  const std::function<void(const std::string&)> log_;
  // Of the server's sweeps, one at a time:
  std::string sweeper_;  ///< The object `sweeper` when it was last read, and when it changed:
  steady_clock::time_point sweeper_changed_{};
  bool sweeps_ = false;
  std::optional<steady_clock::time_point> looked_;
};

// ===== what the bucket has =====

Answer<Seen> BucketObjects::look_at(const std::string& digest, Patience patience) {
  const std::string folder = folder_of(digest);
  const auto objects = client_->list(folder, patience);
  if (!objects) return tl::unexpected(objects.error());
  Seen seen;
  for (const S3Object& object : *objects) seen.add(digest, object.key.substr(folder.size()), object);
  seen.mark_copies();
  return seen;
}

Answer<std::optional<Object>> BucketObjects::find(const std::string& name, Patience patience) {
  using Result = std::optional<Object>;
  if (is_sha256(name)) {
    const auto seen = look_at(name, patience);
    if (!seen) return tl::unexpected(seen.error());
    if (seen->copies.empty()) return Result();
    return Result(Object{name, seen->copies.front().size, seen->used, seen->changed});
  }
  const std::string key = key_of(name);
  const auto objects = client_->list(key, patience);
  if (!objects) return tl::unexpected(objects.error());
  for (const S3Object& object : *objects)
    if (object.key == key) return Result(Object{name, object.size, object.tag, object.changed});
  return Result();
}

Answer<std::vector<Object>> BucketObjects::list(const std::string& beginning, Patience patience) {
  std::vector<Object> all;
  const auto add = [&](Object object) {
    if (object.name.starts_with(beginning)) all.push_back(std::move(object));
  };
  const bool is_of_mesh = beginning.size() > kDigest && is_sha256(beginning.substr(0, kDigest));
  const auto objects = client_->list(is_of_mesh ? folder_of(beginning.substr(0, kDigest)) : "meshes/", patience);
  if (!objects) return tl::unexpected(objects.error());
  std::map<std::string, Seen> meshes;
  for (const S3Object& object : *objects) {
    if (object.key.size() < kMeshes + kDigest + 2) continue;  // not of this store
    const std::string digest = object.key.substr(kMeshes, kDigest);
    if (is_sha256(digest)) meshes[digest].add(digest, object.key.substr(kMeshes + kDigest + 1), object);
  }
  for (auto& [digest, seen] : meshes) {
    if (!seen.copies.empty()) add({digest, seen.copies.front().size, seen.used, seen.changed});
    for (Object& note : seen.notes) add(std::move(note));
  }
  if (is_of_mesh) return all;
  const auto uploads = client_->list("uploads/", patience);
  if (!uploads) return tl::unexpected(uploads.error());
  for (const S3Object& object : *uploads) {
    const std::string rest = object.key.substr(sizeof("uploads/") - 1);
    const std::size_t slash = rest.find('/');
    if (slash == kDigest)
      add({"upload-" + rest.substr(0, slash) + "." + rest.substr(slash + 1), object.size, object.tag, object.changed});
  }
  return all;
}

Answer<std::optional<Object>> BucketObjects::use(const std::string& digest, Patience patience) {
  using Result = std::optional<Object>;
  const auto before = look_at(digest, patience);
  if (!before) return tl::unexpected(before.error());
  if (before->copies.empty()) return Result();
  // Written first and looked at afterwards: see the header.
  const auto tag = note_use(digest, patience);
  if (!tag) return tl::unexpected(tag.error());
  const auto seen = look_at(digest, patience);
  if (!seen) return tl::unexpected(seen.error());
  const Copy* const copy = seen->good();
  return copy == nullptr ? Result() : Result(Object{digest, copy->size, *tag, seen->changed});
}

// ===== bytes =====

Answer<std::string> BucketObjects::put_file(const std::string& digest, const std::filesystem::path& path,
                                            std::int64_t size, Patience patience) {
  const auto used = use(digest, patience);
  if (!used) return tl::unexpected(used.error());
  Answer<std::string> tag = *used ? (*used)->tag : "";
  if (!*used) {
    const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
    if (file < 0) return cannot_store("a file cannot be opened");
    const auto put = client_->put_file(folder_of(digest) + "g-" + random_digits(), file, size, patience);
    ::close(file);
    if (!put) return tl::unexpected(put.error());
    tag = note_use(digest, patience);
  }
  if (!tag) return tag;
  if (const int copy = cache_.adopt(path, digest, size); copy >= 0) ::close(copy);
  return tag;
}

Answer<void> BucketObjects::set_copy_aside(const std::string& digest, const Copy& copy,
                                           const std::filesystem::path& path, Patience patience) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
  if (file < 0) return cannot_store("a file cannot be opened");
  auto done = client_->put_file("damaged/" + digest + "-" + copy.name, file, copy.size, patience);
  ::close(file);
  if (done) done = client_->remove(folder_of(digest) + "g-" + copy.name, patience);
  if (done)
    log_("The stored mesh " + digest +
         " is damaged (its bytes have changed) and was moved to 'damaged/' in the bucket; the next upload with this "
         "digest is taken.");
  return done;
}

Answer<OpenObject> BucketObjects::download(const std::string& digest, const Copy& copy, Patience patience) {
  const std::filesystem::path path = cache_.new_path();
  // Bytes may change on the way, so a copy is damaged only if they are wrong twice.
  for (const bool again : {false, true}) {
    const int part = ::open(path.c_str(), O_CREAT | O_TRUNC | O_RDWR | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (part < 0) return cannot_store("a file cannot be created");
    const auto got = client_->get_file(folder_of(digest) + "g-" + copy.name, copy.size, part, patience);
    ::close(part);
    if (got && is_whole(path, Form::Plain, digest)) {
      const int file = cache_.adopt(path, digest, copy.size);
      if (file >= 0) return OpenObject{file, copy.size, copy.name};
      ::unlink(path.c_str());
      return cannot_store("a file cannot be renamed");
    }
    const int reason = errno;
    Answer<void> done = got;
    if (got && reason != EBADMSG) done = cannot_store("a file cannot be read");
    if (done && again) done = set_copy_aside(digest, copy, path, patience);
    if (!done || again) ::unlink(path.c_str());
    if (!done) return tl::unexpected(done.error());
  }
  return damaged_mesh(digest, "its bytes have changed");
}

Answer<OpenObject> BucketObjects::get(const std::string& digest, bool again, Patience patience) {
  if (again) cache_.drop(digest);
  const int cached = cache_.open(digest);
  // With a copy here there is no need to wait for the bucket.
  const auto seen = look_at(digest, cached >= 0 ? std::min(patience, kPatience) : patience);
  const bool is_gone = seen && seen->copies.empty();
  if (cached >= 0 && !is_gone) {
    if (seen) [[maybe_unused]]
      const auto noted = note_use(digest, std::min(patience, kPatience));
    return OpenObject{cached, static_cast<std::int64_t>(::lseek(cached, 0, SEEK_END)), {}};
  }
  if (cached >= 0) ::close(cached);
  if (!seen) return tl::unexpected(seen.error());
  if (is_gone) return mesh_not_found(digest);
  // A copy that somebody is about to delete is as good for reading.
  if (const auto noted = note_use(digest, patience); !noted) return tl::unexpected(noted.error());
  Answer<OpenObject> fetched = mesh_not_found(digest);
  for (const Copy& copy : seen->copies)
    if (fetched = download(digest, copy, patience); fetched || fetched.error().code == Failure::Code::Unavailable)
      break;
  return fetched;
}

// ===== removing =====

Answer<bool> BucketObjects::remove_unused(const std::string& digest, const std::string& tag,
                                          const std::function<Answer<bool>()>& may_go, Patience patience) {
  const std::string folder = folder_of(digest), name = random_digits();
  const auto before = look_at(digest, patience);
  if (!before) return tl::unexpected(before.error());
  for (const Copy& copy : before->copies)
    if (const auto marked = client_->put(folder + "x-" + copy.name + "-" + name, random_digits(), patience); !marked)
      return tl::unexpected(marked.error());
  // Nobody who looks from now on takes these copies for good; whoever has looked before has written `used` before.
  const auto now = look_at(digest, patience);
  Answer<bool> goes = false;
  if (!now)
    goes = tl::unexpected(now.error());
  else if (now->used == tag)
    goes = may_go();
  const bool removes = goes && *goes;
  Answer<void> done;
  for (const Copy& copy : before->copies) {
    if (removes) done = client_->remove(folder + "g-" + copy.name, patience);
    if (!done) return tl::unexpected(done.error());  // its mark stays, and another sweep deletes it
    done = client_->remove(folder + "x-" + copy.name + "-" + name, patience);
    for (const std::string& mark : before->marks)
      if (removes && mark.starts_with(copy.name + "-")) done = client_->remove(folder + "x-" + mark, patience);
  }
  if (removes) cache_.drop(digest);
  return goes;
}

// ===== uploads =====

Answer<UploadState> BucketObjects::upload_state(const std::string& key, Patience patience) {
  const std::string folder = upload_folder(key);
  const auto objects = client_->list(folder, patience);
  if (!objects) return tl::unexpected(objects.error());
  UploadState state;
  bool has_about = false;
  for (const S3Object& object : *objects) {
    has_about = has_about || object.key == folder + "about";
    if (object.key == part_key(key, state.committed)) state.committed += object.size;
  }
  if (!has_about) return UploadState{};
  auto about = client_->get_small(folder + "about", patience);
  if (!about && about.error().code == Failure::Code::NotFound) return UploadState{};
  if (!about) return tl::unexpected(about.error());
  state.about = std::move(*about);
  return state;
}

Answer<void> BucketObjects::get_parts(const std::string& key, std::int64_t size, int file, Patience patience) {
  const auto parts = client_->list(upload_folder(key) + "p-", patience);
  if (!parts) return tl::unexpected(parts.error());
  std::int64_t have = 0;
  for (const S3Object& part : *parts) {
    if (have == size) break;
    if (part.key != part_key(key, have)) continue;
    if (const auto got = client_->get_file(part.key, part.size, file, patience); !got) return got;
    have += part.size;
  }
  if (have != size) return upload_taken_over();
  return {};
}

Answer<void> BucketObjects::remove_upload(const std::string& key, Patience patience) {
  const auto objects = client_->list(upload_folder(key), patience);
  if (!objects) return tl::unexpected(objects.error());
  for (const S3Object& object : *objects)
    if (const auto removed = client_->remove(object.key, patience); !removed) return removed;
  return {};
}

bool BucketObjects::may_sweep(steady_clock::time_point now) {
  if (looked_ && now - *looked_ < kLookEvery) return false;
  looked_ = now;
  const auto found = client_->get_small(kSweeper, kPatience);
  if (!found && found.error().code != Failure::Code::NotFound) return false;
  const std::string text = found.value_or("");
  if (text != sweeper_) {
    sweeps_ = false;  // another server is at work
    sweeper_changed_ = now;
    sweeper_ = text;
  }
  sweeps_ = sweeps_ || text.empty() || now - sweeper_changed_ >= kSweeperLost;
  if (!sweeps_) return false;
  sweeper_ = random_digits();
  sweeper_changed_ = now;
  return client_->put(kSweeper, sweeper_, kPatience).has_value();
}

}  // namespace

std::unique_ptr<ObjectStore> bucket_objects(std::shared_ptr<S3Client> client, const std::string& directory,
                                            std::int64_t max_cache_bytes, std::function<void(const std::string&)> log) {
  return std::make_unique<BucketObjects>(std::move(client), directory, max_cache_bytes, std::move(log));
}

}  // namespace varimesh::server
