// The content of HDF5 files, as HDF5 gives it to the readers: reading it takes bounded memory and gives a whole mesh or
// a sentence. An input is a list of groups and arrays (pack_hdf5.py makes one from a file), so that the fuzzer changes
// what the readers see and not the bytes of HDF5. An input that begins with "mesh" is instead what a captured
// varimesh_hdf5 answers: receiving it takes bounded memory too, and gives a whole mesh, which is sent again alike, or a
// sentence.
#include <algorithm>
#include <cstring>
#include <map>
#include <string>

#include "core/formats/hdf5/mesh_bytes.h"
#include "core/hdf/read_content.h"
#include "tests/fuzz/program/meshes.h"

namespace {

using namespace varimesh;
using formats::Hdf5Item;
using formats::hdf5::Kind;

class Content : public formats::Hdf5Source {
 public:
  explicit Content(std::string_view bytes) : left_(bytes) {
    while (left_.size() > 4) add();
  }

  std::vector<Hdf5Item> list(const std::string& group, formats::FileAllowance& allowance) override {
    std::vector<Hdf5Item> items;
    for (const auto& [path, array] : arrays_) {
      if (array.parent != group) continue;
      allowance.take(2, sizeof(Hdf5Item) + array.item.name.size() + 8 * array.item.dims.size());
      items.push_back(array.item);
    }
    return items;
  }

  void read(const std::string& path, Kind kind, std::int64_t first, std::span<char> out, std::int64_t count) override {
    const auto found = arrays_.find(path);
    if (found == arrays_.end()) throw ReadFailure{"The mesh file cannot be read: an array is missing."};
    const Array& array = found->second;
    fuzz::expect(first >= 0 && count >= 0 && first + count <= array.item.rows(), "rows are read that are not there");
    const std::size_t bytes_each = kind == Kind::Texts ? array.item.width : 8;
    const std::size_t columns = std::size_t(array.item.columns());
    fuzz::expect(out.size() == std::size_t(count) * columns * bytes_each, "room of the wrong size");
    for (std::size_t i = 0; i < out.size() / bytes_each; ++i)
      value(array, std::size_t(first) * columns + i, kind, out.data() + i * bytes_each);
  }

 private:
  struct Array {
    std::string parent;
    Hdf5Item item;
    std::string_view values;
  };

  std::string_view take(std::size_t count) {
    const std::string_view part = left_.substr(0, count);
    left_.remove_prefix(part.size());
    return part;
  }
  std::size_t number(std::size_t bytes) {
    std::size_t value = 0;
    for (const char c : take(bytes)) value = value << 8 | static_cast<unsigned char>(c);
    return value;
  }

  void add() {
    Array array;
    array.item.kind = Kind(number(1));
    array.item.attribute = number(1) != 0;
    const std::string path(take(number(1)));
    const std::size_t slash = path.rfind(array.item.attribute ? '\n' : '/');
    array.parent = slash == std::string::npos || slash == 0 ? "/" : path.substr(0, slash);
    array.item.name = slash == std::string::npos ? path : path.substr(slash + 1);
    array.item.width = number(1);
    const std::size_t rank = number(1) % 4;
    std::size_t count = 1;
    for (std::size_t k = 0; k < rank; ++k) {
      array.item.dims.push_back(std::int64_t(number(2)));
      count *= std::size_t(array.item.dims.back());
    }
    array.values = take(std::min(left_.size(), number(2)));
    // Values that the input does not have are zero, but an array is no larger than a file of some size can be.
    if (count > 1'000'000) return;
    arrays_[path] = array;
  }

  /// Integers are stored with four bytes, numbers with eight.
  static void value(const Array& array, std::size_t i, Kind kind, char* out) {
    const std::size_t stored = array.item.kind == Kind::Integers  ? 4
                               : array.item.kind == Kind::Numbers ? 8
                                                                  : array.item.width;
    char raw[256] = {};
    if (stored <= sizeof raw && (i + 1) * stored <= array.values.size())
      std::memcpy(raw, array.values.data() + i * stored, stored);
    if (kind == Kind::Texts) {
      std::memcpy(out, raw, array.item.width);
    } else if (array.item.kind == Kind::Integers) {
      std::int32_t integer = 0;
      std::memcpy(&integer, raw, sizeof integer);
      const std::int64_t wide = integer;
      const double real = integer;
      std::memcpy(out, kind == Kind::Numbers ? static_cast<const void*>(&real) : &wide, 8);
    } else {
      std::memcpy(out, raw, 8);
    }
  }

  std::string_view left_;
  std::map<std::string, Array> arrays_;
};

constexpr std::size_t kFileBytes = 1 << 20;
constexpr std::string_view kAnswer = "mesh";

std::string sent(const HighOrderMesh& mesh) {
  std::string bytes;
  formats::hdf5::Outgoing to([&](std::string_view part) { bytes += part; });
  formats::hdf5::send_mesh(mesh, to);
  to.flush();
  return bytes;
}

/// The mesh that these bytes are. Behind their end the program is gone.
HighOrderMesh received(std::string_view bytes) {
  formats::FileAllowance allowance(kFileBytes);
  formats::hdf5::Incoming from([&](std::span<char> to) {
    const std::size_t count = std::min(to.size(), bytes.size());
    if (count == 0) throw ReadFailure{"The program is gone."};
    std::copy_n(bytes.begin(), count, to.begin());
    bytes.remove_prefix(count);
    return count;
  });
  return formats::hdf5::receive_mesh(from, allowance);
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  varimesh::fuzz::count_memory();
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view input(reinterpret_cast<const char*>(data), size);
  fuzz::within_memory(formats::most_memory_to_read(kFileBytes), [&] {
    try {
      if (input.starts_with(kAnswer)) {
        const HighOrderMesh mesh = received(input.substr(kAnswer.size()));
        fuzz::expect_whole(mesh, true);
        fuzz::expect(input.substr(kAnswer.size()).starts_with(sent(mesh)), "a mesh is sent otherwise than it came");
      } else {
        Content content(input);
        formats::FileAllowance allowance(kFileBytes);
        // Who asked for the file completes its serendipity elements.
        fuzz::expect_whole(formats::read_hdf5_content(content, allowance).mesh, true);
      }
    } catch (const ReadFailure& failure) {
      fuzz::expect(!failure.sentence.empty(), "a refusal has no sentence");
    }
    return 0;
  });
  return 0;
}
