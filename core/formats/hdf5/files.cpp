#include "core/formats/hdf5/files.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>

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

class File : public Hdf5Source {
 public:
  File(std::string_view bytes, const StopToken* stop) {
    constexpr std::size_t kPiece = std::size_t(1) << 20;
    for (std::string_view left = bytes; !left.empty(); left.remove_prefix(std::min(kPiece, left.size()))) {
      look(stop);
      if (!write_all(copy_.descriptor(), left.substr(0, kPiece)))
        throw ReadFailure{
            "The mesh file cannot be read: there is no room for a copy of it in the folder for temporary "
            "files; name another one with TMPDIR."};
    }
    try {
      process_.emplace(Hdf5Process::Mode::Read, copy_, std::int64_t(bytes.size()), stop);
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
      process_->ask(request, path, first, count, out);
    } catch (const Hdf5Failure& failure) {
      fail(failure);
    }
  }

 private:
  Scratch copy_;
  std::optional<Hdf5Process> process_;
};

}  // namespace

bool has_hdf5() { return !hdf5_program().empty(); }

bool begins_like_hdf5(std::string_view bytes) { return bytes.starts_with("\x89HDF\r\n\x1a\n"sv); }

std::unique_ptr<Hdf5Source> open_hdf5(std::string_view bytes, const StopToken* stop) {
  return std::make_unique<File>(bytes, stop);
}

// === Writing =============================================================================================

Hdf5Writer::Hdf5Writer(std::int64_t file_bytes, const StopToken* stop) : stop_(stop) {
  process_.emplace(Hdf5Process::Mode::Write, file_, file_bytes, stop);
}

void Hdf5Writer::group(const std::string& path) { process_->ask(Request::MakeGroup, path); }

void Hdf5Writer::make(Request request, const std::string& what, std::string_view type,
                      std::span<const std::int64_t> dims, std::string_view values) {
  std::string text = what + "\n" + std::string(type) + "\n";
  for (std::size_t i = 0; i < dims.size(); ++i) text += (i > 0 ? " " : "") + std::to_string(dims[i]);
  process_->ask(request, text, values);
}

void Hdf5Writer::array(const std::string& path, std::string_view type, std::span<const std::int64_t> dims,
                       std::string_view values) {
  if (std::int64_t(values.size()) <= hdf5::kMostBytes) return make(Request::MakeArray, path, type, dims, values);
  make(Request::MakeArray, path, type, dims, {});
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
  make(Request::MakeArray, path, type, dims, {});
}

void Hdf5Writer::rows(const std::string& path, std::int64_t first, std::int64_t count, std::string_view values) {
  process_->ask(Request::WriteRows, path, values, first, count);
}

Expected<void> Hdf5Writer::finish(const Sink& sink) {
  process_->ask(Request::Finish, "");
  process_.reset();
  std::vector<char> piece(std::size_t(1) << 20);
  for (off_t at = 0;;) {
    look(stop_);
    const ssize_t n = ::pread(file_.descriptor(), piece.data(), piece.size(), at);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw Hdf5Failure{"the file cannot be read back"};
    if (n == 0) return {};
    if (!sink({piece.data(), std::size_t(n)}))
      return tl::unexpected<Error>(
          {Error::Kind::Output, "Writing stopped before the end of the mesh; the disk may be full."});
    at += n;
  }
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
