// Compression of meshes that nobody uses.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>

#include "server/meshes/zstd.h"
#include "tests/server/meshes/stores.h"

namespace varimesh::server::testing {
namespace {

/// A directory, and a store in it that compresses meshes after ten idle minutes.
class IdleMesh : public ::testing::Test {
 protected:
  IdleMesh() {
    std::string name = ::testing::TempDir() + "varimesh-rest-XXXXXX";
    directory_ = ::mkdtemp(name.data());
    open();
  }
  ~IdleMesh() override {
    store_.reset();
    std::filesystem::remove_all(directory_);
  }
  void open() {
    store_.reset();
    DirectoryMeshSettings settings = settings_with([this] { return now_; });
    settings.compress_after = std::chrono::minutes(10);
    settings.log = [this](const std::string& line) { lines_.push_back(line); };
    store_ = std::move(*DirectoryMeshStore::open_directory(directory_.string(), settings));
  }
  void rest() {
    now_ += std::chrono::minutes(11);
    store_->compress_idle(needed_, [] { return false; });
  }
  bool is_compressed(const std::string& digest) const {
    const bool compressed = std::filesystem::exists(directory_ / (digest + ".zst"));
    EXPECT_NE(compressed, std::filesystem::exists(directory_ / digest)) << "exactly one of the two files";
    return compressed;
  }
  std::string whole(const std::string& digest) const {
    const auto blob = store_->open(digest);
    return blob ? std::string((*blob)->bytes()) : blob.error().sentence;
  }
  std::string in_pieces(const std::string& digest, std::int64_t offset, bool zstd) const {
    const auto reader = store_->read(digest);
    if (!reader) return reader.error().sentence;
    std::string all, content;
    while (true) {
      const auto piece = (*reader)->read(offset, zstd);
      if (!piece || piece->size == 0) return piece ? all : piece.error().sentence;
      EXPECT_TRUE(zstd || !piece->is_zstd);
      offset += piece->size;
      const bool good = !piece->is_zstd || zstd_decompress(piece->bytes, 1 << 20, &content);
      EXPECT_TRUE(good);
      all += piece->is_zstd ? content : piece->bytes;
    }
  }

  Time now_ = Time(std::chrono::hours(500'000));
  std::filesystem::path directory_;
  std::unique_ptr<DirectoryMeshStore> store_;
  std::set<std::string> needed_;
  std::vector<std::string> lines_;  ///< The lines of its log.
};

TEST_F(IdleMesh, IsCompressedAfterAWhile) {
  const std::string bytes = long_text(50'000);
  const StoredBytes stored = write(*store_, bytes);
  store_->compress_idle(needed_, [] { return false; });
  EXPECT_FALSE(is_compressed(stored.digest)) << "it was just used";
  rest();
  EXPECT_TRUE(is_compressed(stored.digest));
  EXPECT_LT(std::filesystem::file_size(directory_ / (stored.digest + ".zst")), bytes.size() / 2);
  EXPECT_EQ(whole(stored.digest), bytes);
  for (const bool zstd : {false, true})
    for (const std::int64_t offset : {0, 1, 256 * 1024, 300'000, 524'287})
      EXPECT_EQ(in_pieces(stored.digest, offset, zstd), bytes.substr(static_cast<std::size_t>(offset)));
  EXPECT_EQ(in_pieces(stored.digest, stored.size, false), "");
  EXPECT_EQ(write(*store_, bytes).digest, stored.digest) << "the same bytes again";
  EXPECT_FALSE(is_compressed(stored.digest)) << "the new file replaces the old one, which may be damaged";
  EXPECT_EQ(whole(stored.digest), bytes);
  rest();
  EXPECT_TRUE(is_compressed(stored.digest));
  EXPECT_EQ(whole(stored.digest), bytes);
}

TEST_F(IdleMesh, StaysReadableForItsOpenReaders) {
  const std::string bytes = long_text(50'000);
  const StoredBytes stored = write(*store_, bytes);
  const auto blob = *store_->open(stored.digest);
  const auto reader = std::move(*store_->read(stored.digest));
  rest();
  ASSERT_TRUE(is_compressed(stored.digest));
  EXPECT_EQ(blob->bytes(), bytes);
  EXPECT_EQ(reader->read(0, false)->bytes, bytes.substr(0, 256 * 1024));
}

TEST_F(IdleMesh, IsTheSameAfterARestart) {
  const std::string bytes = long_text(50'000);
  const StoredBytes stored = write(*store_, bytes);
  rest();
  // As if the process had ended before it could remove the plain file.
  std::ofstream(directory_ / stored.digest) << bytes;
  open();
  EXPECT_TRUE(is_compressed(stored.digest));
  EXPECT_EQ(whole(stored.digest), bytes);
  EXPECT_TRUE(store_->query_upload("", stored.digest)->complete);
  EXPECT_EQ(store_->query_upload("", stored.digest)->committed, stored.size);
  store_->retain(stored.digest);
  now_ += std::chrono::hours(25);
  store_->sweep();
  EXPECT_EQ(whole(stored.digest), bytes) << "it has a reference";
  store_->release(stored.digest);
  now_ += std::chrono::hours(25);
  store_->sweep();
  EXPECT_TRUE(std::filesystem::is_empty(directory_));
}

TEST_F(IdleMesh, IsDeletedWithItsLastReference) {
  const StoredBytes stored = write(*store_, long_text(50'000));
  rest();
  ASSERT_TRUE(is_compressed(stored.digest));
  store_->release(stored.digest);
  EXPECT_TRUE(std::filesystem::is_empty(directory_));
}

TEST_F(IdleMesh, IsNotCompressedIfItIsSmallOrDoesNotShrink) {
  std::string noise(1'000'000, '\0');
  std::uint32_t state = 1;
  for (char& c : noise) c = static_cast<char>((state = state * 1664525 + 1013904223) >> 24);
  const StoredBytes dense = write(*store_, noise), small = write(*store_, long_text(100));
  rest();
  EXPECT_FALSE(is_compressed(dense.digest));
  EXPECT_FALSE(is_compressed(small.digest));
  EXPECT_EQ(whole(dense.digest), noise);
}

TEST_F(IdleMesh, IsNotCompressedIfAJobNeedsIt) {
  const StoredBytes stored = write(*store_, long_text(50'000)), other = write(*store_, long_text(50'001));
  needed_ = {stored.digest};
  rest();
  EXPECT_FALSE(is_compressed(stored.digest));
  EXPECT_TRUE(is_compressed(other.digest));
  needed_.clear();
  rest();
  EXPECT_TRUE(is_compressed(stored.digest));
}

TEST_F(IdleMesh, IsCompressedAlthoughOthersCannotBeRead) {
  std::vector<StoredBytes> all;
  for (int i = 0; i < 4; ++i) all.push_back(write(*store_, long_text(50'000 + i)));
  std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.digest < b.digest; });
  ASSERT_TRUE(store_->pin(all[0].digest));
  store_->release(all[0].digest);
  for (int i = 0; i < 3; ++i) std::filesystem::remove(directory_ / all[i].digest);
  std::filesystem::create_symlink(all[2].digest, directory_ / all[2].digest);  // a link to itself cannot be opened
  rest();
  EXPECT_TRUE(is_compressed(all[3].digest));
  EXPECT_EQ(lines_.size(), 3u);
  EXPECT_FALSE(store_->query_upload("", all[0].digest)) << "it is lost and can be uploaded again";
  rest();
  EXPECT_EQ(lines_.size(), 3u) << "each is reported once";
}

TEST_F(IdleMesh, IsUnchangedIfCompressionIsGivenUp) {
  const std::string bytes = long_text(50'000);
  const StoredBytes stored = write(*store_, bytes);
  now_ += std::chrono::minutes(11);
  int asked = 0;
  store_->compress_idle(needed_, [&] { return ++asked > 3; });
  EXPECT_FALSE(is_compressed(stored.digest));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(directory_), {}), 1);
  EXPECT_EQ(whole(stored.digest), bytes);
}

TEST_F(IdleMesh, IsRefusedIfItIsDamaged) {
  const std::string bytes = long_text(50'000);
  const StoredBytes stored = write(*store_, bytes);
  rest();
  const std::filesystem::path path = directory_ / (stored.digest + ".zst");
  {
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(5000);
    file << "damage";
  }
  EXPECT_EQ(store_->read(stored.digest).error().code, Failure::Code::DataLoss);
  EXPECT_FALSE(std::filesystem::exists(path));
  write(*store_, bytes);
  EXPECT_EQ(whole(stored.digest), bytes) << "the same mesh is taken again";
  rest();
  std::filesystem::resize_file(path, 1000);
  EXPECT_EQ(store_->open(stored.digest).error().code, Failure::Code::DataLoss) << "its table is lost";
}

}  // namespace
}  // namespace varimesh::server::testing
