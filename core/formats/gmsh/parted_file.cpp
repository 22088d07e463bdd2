#include "core/formats/gmsh/parted_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <system_error>

#include "core/base/io/scanner.h"
#include "core/formats/gmsh/read.h"

namespace varimesh::formats {
namespace {

constexpr std::size_t kNumber = sizeof(std::int64_t);
constexpr std::size_t kPlace = 3 * sizeof(double);
constexpr std::size_t kBlockHead = 20;
constexpr std::int64_t kNodesPerRun = 16384;
constexpr std::size_t kNumbersToSort = std::size_t{1} << 20;
constexpr std::string_view kHead{"$MeshFormat\n4.1 1 8\n\1\0\0\0\n$EndMeshFormat\n", 40};

template <class T>
void append(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

template <class T>
T taken(const char* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return value;
}

[[noreturn]] void fail_reading(const std::string& why) {
  throw ReadFailure{"The mesh file cannot be read: " + why + "."};
}

std::string reason() { return std::system_category().message(errno); }

/// What work() returns; an error that names the file if it throws.
template <class Work>
auto guarded(const std::string& path, const Work& work) -> Expected<decltype(work())> {
  try {
    return work();
  } catch (const ReadFailure& failure) {
    return bad_input("'" + path + "': " + failure.sentence);
  }
}

}  // namespace

// === Opening =============================================================================================

Expected<PartedFile> PartedFile::open(const std::string& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return bad_input("'" + path + "' cannot be opened: " + reason() + ".");
  struct stat status {};
  PartedFile file(path, descriptor, 0);
  if (::fstat(descriptor, &status) != 0) return bad_input("'" + path + "' cannot be read: " + reason() + ".");
  if (S_ISDIR(status.st_mode)) return bad_input("'" + path + "' is a folder; name a mesh file in it.");
  if (!S_ISREG(status.st_mode))
    return bad_input("'" + path + "' is no regular file, so ranks cannot read parts of it; save the mesh as a file.");
  file.size_ = status.st_size;
  const auto done = guarded(path, [&] { return file.find_records(), true; });
  if (!done) return tl::unexpected(done.error());
  return file;
}

PartedFile::PartedFile(PartedFile&& other) noexcept
    : path_(std::move(other.path_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      size_(other.size_),
      nodes_(other.nodes_),
      dimension_(other.dimension_),
      node_records_(std::move(other.node_records_)),
      element_records_(std::move(other.element_records_)) {}

PartedFile::~PartedFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

void PartedFile::read_bytes(std::int64_t at, void* to, std::size_t count) const {
  for (auto* target = static_cast<char*>(to); count > 0;) {
    const ssize_t n = ::pread(descriptor_, target, count, at);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail_reading("reading failed at byte " + std::to_string(at) + ": " + reason());
    if (n == 0) fail_reading("it became shorter while it was read");
    at += n;
    target += n;
    count -= std::size_t(n);
  }
}

std::int64_t PartedFile::elements(int dimension) const {
  std::int64_t total = 0;
  for (const ElementRecords& block : element_records_)
    if (block.dimension == dimension) total += block.count;
  return total;
}

int PartedFile::order() const {
  for (const ElementRecords& block : element_records_)
    if (block.dimension == dimension_) return gmsh_type(block.type).order;
  return 0;
}

std::int64_t PartedFile::aligned(std::int64_t place, std::int64_t multiple) const {
  for (const ElementRecords& block : element_records_)
    if (block.dimension == dimension_ && place >= block.first && place < block.first + block.count)
      return place - (place - block.first) % multiple;
  return place;
}

Wanted PartedFile::one_of_each_block() const {
  Wanted wanted;
  for (const ElementRecords& block : element_records_)
    if (block.dimension >= dimension_ - 1)
      (block.dimension == dimension_ ? wanted.cells : wanted.borders).push_back({block.first, 1});
  return wanted;
}

// === Reading parts =======================================================================================

/// The small file with some elements and their nodes.
class PartedFile::Cut {
 public:
  Cut(const PartedFile& file, std::vector<std::int64_t>* places) : file_(file), places_(places) {}

  std::string make(const Wanted& wanted) {
    add_elements(wanted);
    std::string nodes = nodes_section();
    std::string bytes(kHead);
    bytes += nodes;
    nodes = {};
    elements_at_ = bytes.size();
    bytes += elements_;
    return bytes;
  }

  /// The sentence of the reader, with the byte of the file instead of that of the small file.
  std::string in_file(std::string sentence) const {
    const std::size_t word = sentence.rfind("byte ");
    if (word == std::string::npos || sentence.find("$Elements") == std::string::npos) return sentence;
    const std::size_t digits = word + 5, end = sentence.find_first_not_of("0123456789", digits);
    const std::size_t at = std::stoull(sentence.substr(digits, end - digits)) - elements_at_;
    for (const Piece& piece : pieces_)
      if (at >= piece.at && at <= piece.at + piece.size)
        return sentence.replace(digits, end - digits, std::to_string(piece.from + std::int64_t(at - piece.at)));
    return sentence;
  }

 private:
  struct Piece {
    std::size_t at, size;
    std::int64_t from;
  };

  void add_elements(const Wanted& wanted) {
    std::int64_t block_count = 0, total = 0;
    std::size_t size = 0;
    const auto each = [&](const auto& visit) {
      for (const ElementRecords& block : file_.element_records_) {
        if (block.dimension < file_.dimension_ - 1) continue;
        for (const ElementRange& range : block.dimension == file_.dimension_ ? wanted.cells : wanted.borders) {
          const std::int64_t first = std::max(range.first, block.first);
          const std::int64_t end = std::min(range.first + range.count, block.first + block.count);
          if (first < end) visit(block, first, end - first);
        }
      }
    };
    each([&](const ElementRecords& block, std::int64_t, std::int64_t count) {
      ++block_count;
      total += count;
      size += kBlockHead + std::size_t(count) * block.stride;
    });
    elements_.reserve(size + 64);
    elements_ = "$Elements\n";
    for (const std::int64_t head : {block_count, total, std::int64_t{1}, total}) append(elements_, head);
    each([&](const ElementRecords& block, std::int64_t first, std::int64_t count) { add(block, first, count); });
    elements_ += "\n$EndElements\n";
    sort_needed();
  }

  void add(const ElementRecords& block, std::int64_t first, std::int64_t count) {
    append(elements_, block.dimension);
    append(elements_, block.entity);
    append(elements_, block.type);
    append(elements_, count);
    const std::size_t at = elements_.size(), size = std::size_t(count) * block.stride;
    const std::int64_t from = block.at + (first - block.first) * std::int64_t(block.stride);
    elements_.resize(at + size);
    file_.read_bytes(from, elements_.data() + at, size);
    pieces_.push_back({at, size, from});
    for (std::size_t k = 0; k < size; k += kNumber) {
      if (k % block.stride == 0) continue;
      needed_.push_back(taken<std::int64_t>(elements_.data() + at + k));
      if (needed_.size() >= most_) sort_needed();
    }
  }

  void sort_needed() {
    std::ranges::sort(needed_);
    needed_.erase(std::unique(needed_.begin(), needed_.end()), needed_.end());
    most_ = 2 * needed_.size() + kNumbersToSort;
  }

  /// Looks through the numbers of all nodes for those that are needed.
  std::string nodes_section() {
    std::string blocks;
    std::int64_t block_count = 0, total = 0;
    std::vector<std::int64_t> numbers;
    std::size_t next = 0;  // numbers mostly ascend, so the next one that is needed is mostly this one
    for (const NodeRecords& block : file_.node_records_) {
      std::vector<std::int64_t> found;  // places in the block
      std::string found_numbers;
      for (std::int64_t first = 0; first < block.count; first += kNodesPerRun) {
        numbers.resize(std::size_t(std::min(kNodesPerRun, block.count - first)));
        file_.read_bytes(block.numbers + first * std::int64_t(kNumber), numbers.data(), numbers.size() * kNumber);
        for (std::size_t k = 0; k < numbers.size(); ++k) {
          if (next >= needed_.size() || needed_[next] != numbers[k]) {
            const auto at = std::ranges::lower_bound(needed_, numbers[k]);
            next = std::size_t(at - needed_.begin());
            if (at == needed_.end() || *at != numbers[k]) continue;
          }
          ++next;
          found.push_back(first + std::int64_t(k));
          append(found_numbers, numbers[k]);
        }
      }
      if (found.empty()) continue;
      append(blocks, block.dimension);
      append(blocks, block.entity);
      append(blocks, std::int32_t{0});
      append(blocks, std::int64_t(found.size()));
      blocks += found_numbers;
      add_coordinates(block, found, blocks);
      if (places_ != nullptr)
        for (const std::int64_t place : found) places_->push_back(block.first + place);
      ++block_count;
      total += std::int64_t(found.size());
    }
    std::string section = "$Nodes\n";
    for (const std::int64_t head : {block_count, total, std::int64_t{1}, total}) append(section, head);
    return section + blocks + "\n$EndNodes\n";
  }

  void add_coordinates(const NodeRecords& block, const std::vector<std::int64_t>& found, std::string& bytes) {
    std::string window;
    std::int64_t begin = 0, end = 0;  // nodes of the block that are in the window
    for (const std::int64_t place : found) {
      if (place >= end) {
        begin = place;
        end = std::min(block.count, place + kNodesPerRun);
        // A few nodes of many need not read those between them.
        end = std::min(end, std::max(place + 16, found.back() + 1));
        window.resize(std::size_t(end - begin) * block.stride);
        file_.read_bytes(block.coordinates + begin * std::int64_t(block.stride), window.data(), window.size());
      }
      bytes.append(window, std::size_t(place - begin) * block.stride, kPlace);
    }
  }

  const PartedFile& file_;
  std::vector<std::int64_t>* places_;
  std::vector<std::int64_t> needed_;   // numbers of nodes; in the end ascending and distinct
  std::size_t most_ = kNumbersToSort;  // how many may be there before they are made distinct
  std::vector<Piece> pieces_;
  std::string elements_;
  std::size_t elements_at_ = 0;
};

Expected<HighOrderMesh> PartedFile::read(const Wanted& wanted, int threads, std::vector<std::int64_t>* places) const {
  Cut cut(*this, places);
  const auto bytes = guarded(path_, [&] { return cut.make(wanted); });
  if (!bytes) return tl::unexpected(bytes.error());
  try {
    const Team team(threads);
    Expected<MeshFile> file;
    team.run([&] { file = read_gmsh(*bytes, team); });
    return std::move(file->mesh);
  } catch (const ReadFailure& failure) {
    return bad_input("'" + path_ + "': " + cut.in_file(failure.sentence));
  }
}

Expected<std::int64_t> PartedFile::node_number(std::int64_t place) const {
  return guarded(path_, [&] {
    const auto block =
        std::ranges::find_if(node_records_, [&](const NodeRecords& each) { return place < each.first + each.count; });
    std::int64_t number = 0;
    read_bytes(block->numbers + (place - block->first) * std::int64_t(kNumber), &number, sizeof number);
    return number;
  });
}

}  // namespace varimesh::formats
