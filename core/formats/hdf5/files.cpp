#include "core/formats/hdf5/files.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <utility>

#include "core/base/write_all.h"

namespace varimesh::formats {

namespace {

using hdf5::Kind;
using hdf5::Request;
using namespace std::string_view_literals;

[[noreturn]] void fail(const Hdf5Failure& failure) {
  throw ReadFailure{"The mesh file cannot be read: " + failure.reason +
                    (failure.missing ? "." : "; write or copy it again, or convert it to MSH.")};
}

/// The text up to the next separator, which is removed too.
std::string_view cut(std::string_view& text, char separator) {
  const std::size_t end = std::min(text.find(separator), text.size());
  const std::string_view part = text.substr(0, end);
  text.remove_prefix(std::min(text.size(), end + 1));
  return part;
}

std::int64_t number(std::string_view text) {
  std::int64_t value = 0;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return std::max<std::int64_t>(0, value);
}

/// One line of the answer to List.
Hdf5Item item_of(std::string_view line) {
  Hdf5Item item;
  const std::string_view kind = cut(line, '\t');
  if (!kind.empty()) item.kind = Kind(kind[0]);
  item.attribute = cut(line, '\t') == "a";
  item.width = std::size_t(number(cut(line, '\t')));
  for (std::string_view dims = cut(line, '\t'); !dims.empty();) item.dims.push_back(number(cut(dims, ' ')));
  item.name = line;
  return item;
}

/// Values of a type of the file, as integers or numbers of 8 bytes.
template <class From, class To>
void convert(const char* from, std::span<char> out) {
  for (std::size_t i = 0; i < out.size() / sizeof(To); ++i) {
    From value;
    std::memcpy(&value, from + i * sizeof(From), sizeof(From));
    const To wide = To(value);
    std::memcpy(out.data() + i * sizeof(To), &wide, sizeof(To));
  }
}

/// A type whose values lie in files as they lie in memory.
struct PlainType {
  std::string_view name;
  std::size_t size;
  void (*to_integers)(const char* from, std::span<char> out);
  void (*to_numbers)(const char* from, std::span<char> out);
};
constexpr std::array<PlainType, 6> kPlainTypes = {{
    {"i1", 1, convert<std::int8_t, std::int64_t>, convert<std::int8_t, double>},
    {"i2", 2, convert<std::int16_t, std::int64_t>, convert<std::int16_t, double>},
    {"i4", 4, convert<std::int32_t, std::int64_t>, convert<std::int32_t, double>},
    {"i8", 8, convert<std::int64_t, std::int64_t>, convert<std::int64_t, double>},
    {"f4", 4, nullptr, convert<float, double>},
    {"f8", 8, nullptr, convert<double, double>},
}};

/// Where the values of an array lie.
struct Place {
  const PlainType* type = nullptr;  ///< Null: only HDF5 can read them.
  std::size_t begin = 0;
};

class File : public Hdf5Source {
 public:
  File(std::string_view bytes, const StopToken* stop) : bytes_(bytes) {
    try {
      process_.emplace(bytes, stop);
    } catch (const Hdf5Failure& failure) {
      fail(failure);
    }
  }

  std::vector<Hdf5Item> list(const std::string& group, FileAllowance& allowance) override {
    std::string text;
    try {
      text = process_->ask(Request::List, group, {}, 0, 0,
                           [&](std::int64_t bytes) { allowance.take(std::size_t(bytes), 1); });
    } catch (const Hdf5Failure& failure) {
      fail(failure);
    }
    std::vector<Hdf5Item> items;
    const auto lines = std::size_t(std::ranges::count(text, '\n')) + 1;
    allowance.take(lines, sizeof(Hdf5Item));
    items.reserve(lines);
    for (std::string_view left = text; !left.empty();) {
      const std::string_view line = cut(left, '\n');
      // Every dimension takes two bytes of the line at least, and eight of memory.
      allowance.take(line.size(), 5);
      items.push_back(item_of(line));
    }
    allowance.give_back(text.size());
    return items;
  }

  void read(const std::string& path, Kind kind, std::int64_t first, std::span<char> out, std::int64_t count) override {
    const Request request = kind == Kind::Integers  ? Request::ReadIntegers
                            : kind == Kind::Numbers ? Request::ReadNumbers
                                                    : Request::ReadTexts;
    try {
      if (!read_here(path, kind, first, out, count)) process_->ask(request, path, first, count, out);
    } catch (const Hdf5Failure& failure) {
      fail(failure);
    }
  }

 private:
  /// Reads the rows from the bytes of the file, without asking for copies of them. Returns false if that is not
  /// possible. What HDF5 says of a damaged file may be anything.
  bool read_here(const std::string& path, Kind kind, std::int64_t first, std::span<char> out, std::int64_t count) {
    if (std::endian::native != std::endian::little || kind == Kind::Texts || count <= 0) return false;
    if (path != place_of_) {
      place_ = found_place(path);
      place_of_ = path;
    }
    if (place_.type == nullptr) return false;
    const auto convert = kind == Kind::Integers ? place_.type->to_integers : place_.type->to_numbers;
    const std::size_t values = out.size() / 8, columns = values / std::size_t(count), size = place_.type->size;
    const std::size_t most = (bytes_.size() - std::min(bytes_.size(), place_.begin)) / size;
    if (convert == nullptr || columns == 0 || std::size_t(first) > most / columns ||
        values > most - std::size_t(first) * columns)
      return false;
    convert(bytes_.data() + place_.begin + std::size_t(first) * columns * size, out);
    return true;
  }

  Place found_place(const std::string& path) {
    const std::string answer = process_->ask(Request::Place, path);
    std::string_view text = answer;
    const std::string_view name = cut(text, ' ');
    Place place;
    for (const PlainType& type : kPlainTypes)
      if (type.name == name) place = {&type, std::size_t(number(text))};
    return place;
  }

  std::string_view bytes_;
  std::string place_of_;  ///< The array that was read last.
  Place place_;
  std::optional<Hdf5Process> process_;
};

}  // namespace

bool has_hdf5() { return !hdf5_program().empty(); }

bool begins_like_hdf5(std::string_view bytes) { return bytes.starts_with("\x89HDF\r\n\x1a\n"sv); }

std::unique_ptr<Hdf5Source> open_hdf5(std::string_view bytes, const StopToken* stop) {
  return std::make_unique<File>(bytes, stop);
}

namespace {

constexpr const char* kNotRead = "the file cannot be read back";

/// Reads exactly these bytes of the file.
bool read_all_at(int file, std::span<char> to, off_t at) {
  while (!to.empty()) {
    const ssize_t n = ::pread(file, to.data(), to.size(), at);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    to = to.subspan(std::size_t(n));
    at += n;
  }
  return true;
}

}  // namespace

// === Writing =============================================================================================

Hdf5Writer::Hdf5Writer(std::int64_t file_bytes, const StopToken* stop) : stop_(stop) {
  process_.emplace(file_, file_bytes, stop);
}

void Hdf5Writer::group(const std::string& path) { process_->ask(Request::MakeGroup, path); }

std::string Hdf5Writer::make(Request request, const std::string& what, std::string_view type,
                             std::span<const std::int64_t> dims, std::string_view values) {
  std::string text = what + "\n" + std::string(type) + "\n";
  for (std::size_t i = 0; i < dims.size(); ++i) text += (i > 0 ? " " : "") + std::to_string(dims[i]);
  return process_->ask(request, text, values);
}

void Hdf5Writer::array(const std::string& path, std::string_view type, std::span<const std::int64_t> dims,
                       std::string_view values) {
  if (std::int64_t(values.size()) <= hdf5::kMostBytes) {
    make(Request::MakeArray, path, type, dims, values);
    return;
  }
  array(path, type, dims);
  const std::size_t per_row = values.size() / std::size_t(dims[0]);
  const std::int64_t most = std::max<std::int64_t>(1, hdf5::kMostBytes / std::int64_t(per_row));
  for (std::int64_t first = 0; first < dims[0]; first += most) {
    const std::int64_t count = std::min(most, dims[0] - first);
    rows(path, first, count, values.substr(std::size_t(first) * per_row, std::size_t(count) * per_row));
  }
}

void Hdf5Writer::attribute(const std::string& owner, const std::string& name, std::string_view type,
                           std::span<const std::int64_t> dims, std::string_view values) {
  make(Request::MakeAttribute, owner + "\n" + name, type, dims, values);
}

void Hdf5Writer::array(const std::string& path, std::string_view type, std::span<const std::int64_t> dims) {
  const std::string place = make(Request::MakeArray, path, type, dims, {});
  if (!place.empty()) places_[path] = number(place);
}

void Hdf5Writer::rows(const std::string& path, std::int64_t first, std::int64_t count, std::string_view values) {
  const auto found = places_.find(path);
  if (found == places_.end()) {
    const std::lock_guard lock(asking_);
    process_->ask(Request::WriteRows, path, values, first, count);
    return;
  }
  // HDF5 would get a copy of the values, and only put them there.
  const auto row = std::int64_t(values.size()) / count;
  if (!write_all_at(file_.descriptor(), values, off_t(found->second + first * row)))
    throw Hdf5Failure{"there is no room for it in the folder for temporary files; name another one with TMPDIR"};
}

Expected<void> Hdf5Writer::finish(const Sink& sink, const Team& team) {
  process_->ask(Request::Finish, "");
  process_.reset();
  struct stat status {};
  if (::fstat(file_.descriptor(), &status) != 0) throw Hdf5Failure{kNotRead};
  constexpr std::size_t kPiece = std::size_t(1) << 18;
  const auto size = std::size_t(status.st_size), in_memory = std::size_t(team.threads()) + 2;
  UntouchedVector<char> room(in_memory * kPiece);
  std::size_t at = 0;
  const auto next = [&]() -> std::optional<std::size_t> {
    look(stop_);
    return at < size ? std::optional(std::exchange(at, at + kPiece)) : std::nullopt;
  };
  const auto make = [&](std::size_t begin) {
    const std::span<char> piece(room.data() + begin / kPiece % in_memory * kPiece, std::min(kPiece, size - begin));
    return read_all_at(file_.descriptor(), piece, off_t(begin)) ? piece : std::span<char>();
  };
  bool read = true, stopped = false;
  in_order(team, next, make, [&](std::span<const char> piece) {
    read = !piece.empty();
    stopped = read && !sink({piece.data(), piece.size()});
    return read && !stopped;
  });
  if (!read) throw Hdf5Failure{kNotRead};
  if (!stopped) return {};
  return tl::unexpected<Error>(
      {Error::Kind::Output, "Writing stopped before the end of the mesh; the disk may be full."});
}

Expected<void> written_hdf5(const std::function<Expected<void>()>& body) {
  try {
    return body();
  } catch (const Hdf5Failure& failure) {
    if (failure.missing) return bad_option("HDF5 files cannot be written: " + failure.reason + ".");
    return tl::unexpected<Error>({Error::Kind::Output, "The HDF5 file cannot be written: " + failure.reason + "."});
  }
}

}  // namespace varimesh::formats
