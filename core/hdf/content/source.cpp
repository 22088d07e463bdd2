#include "core/hdf/content/source.h"

#include <algorithm>

namespace varimesh::formats {

using hdf5::Kind;

std::int64_t Hdf5Item::columns() const {
  constexpr std::int64_t kMost = std::int64_t(1) << 40;
  std::int64_t count = 1;
  for (std::size_t i = 1; i < dims.size(); ++i)
    count =
        dims[i] > 0 && count > kMost / dims[i] ? kMost : std::min(kMost, count * std::max<std::int64_t>(0, dims[i]));
  return count;
}

Hdf5Group::Hdf5Group(Hdf5Source& source, FileAllowance& allowance, std::string path)
    : source_(&source), allowance_(&allowance), path_(std::move(path)), items_(source.list(path_, allowance)) {}

const Hdf5Item* Hdf5Group::find(std::string_view name, bool attribute) const {
  const auto found = std::find_if(items_.begin(), items_.end(), [&](const Hdf5Item& item) {
    return item.name == name && item.attribute == attribute;
  });
  return found == items_.end() ? nullptr : &*found;
}

Hdf5Group Hdf5Group::group(std::string_view name) const {
  need(name, Kind::Group, false);
  return {*source_, *allowance_, path_of(name)};
}

std::string Hdf5Group::path_of(std::string_view name, bool attribute) const {
  if (attribute) return path_ + "\n" + std::string(name);
  return (path_ == "/" ? path_ : path_ + "/") + std::string(name);
}

void Hdf5Group::fail(std::string_view name, const std::string& fault, std::int64_t row) const {
  std::string shown;
  for (const char c : path_of(name).substr(0, 100)) shown += c < ' ' ? '?' : c;
  throw ReadFailure{"The mesh file cannot be read: '" + shown + "' " + fault +
                    (row < 0 ? "." : " (row " + std::to_string(row + 1) + ", counted from 1).")};
}

const Hdf5Item& Hdf5Group::need(std::string_view name, Kind kind, bool attribute) const {
  const Hdf5Item* item = find(name, attribute);
  if (item == nullptr) fail(name, attribute ? "is a missing attribute" : "is missing");
  if (item->kind != kind && !(item->kind == Kind::Integers && kind == Kind::Numbers)) {
    if (item->kind == Kind::Other)
      fail(name,
           "leads to another file or has values that VariMesh does not read; let the program that wrote the "
           "file put everything into it");
    fail(name, kind == Kind::Group      ? "is not a group"
               : kind == Kind::Integers ? "is not an array of integers"
               : kind == Kind::Numbers  ? "is not an array of numbers"
                                        : "is not a text");
  }
  return *item;
}

std::int64_t Hdf5Group::slice(std::string_view name, const Hdf5Item& item, std::size_t bytes_each) const {
  if (item.columns() > hdf5::kMostBytes / std::int64_t(bytes_each)) fail(name, "has rows that are too long");
  constexpr std::int64_t kSlice = std::int64_t(1) << 19;  // stays in a core's cache
  return std::max<std::int64_t>(1, kSlice / std::int64_t(bytes_each) / std::max<std::int64_t>(1, item.columns()));
}

std::int64_t Hdf5Group::attribute(std::string_view name) const {
  const Hdf5Item& item = need(name, Kind::Integers, true);
  if (item.rows() != 1 || item.columns() != 1) fail(name, "is not a single number");
  std::int64_t value = 0;
  source_->read(path_of(name, true), Kind::Integers, 0, {reinterpret_cast<char*>(&value), sizeof value}, 1);
  return value;
}

std::vector<std::int64_t> Hdf5Group::integers(std::string_view name) const {
  const Hdf5Item& item = need(name, Kind::Integers, false);
  allowance_->take(std::size_t(std::max<std::int64_t>(0, item.rows())),
                   std::size_t(item.columns()) * sizeof(std::int64_t));
  std::vector<std::int64_t> all;
  all.reserve(std::size_t(std::max<std::int64_t>(0, item.rows()) * item.columns()));
  for_rows<std::int64_t>(name, 0, [&](std::int64_t, std::int64_t count, const std::int64_t* values) {
    all.insert(all.end(), values, values + count * item.columns());
  });
  return all;
}

std::vector<std::string> Hdf5Group::texts(std::string_view name, bool attribute) const {
  const Hdf5Item& item = need(name, Kind::Texts, attribute);
  // Neither number is larger than what one request takes, so their product is no overflow.
  const bool is_wide = item.width > std::size_t(hdf5::kMostBytes) || item.columns() > hdf5::kMostBytes;
  const std::int64_t each = is_wide ? 0 : std::int64_t(item.width) * item.columns();
  if (each <= 0 || item.rows() > hdf5::kMostBytes / each) fail(name, "is too long");
  allowance_->take(std::size_t(item.rows() * item.columns()), item.width + sizeof(std::string));
  std::string bytes(std::size_t(each * item.rows()), '\0');
  if (!bytes.empty())
    source_->read(path_of(name, attribute), Kind::Texts, 0, {bytes.data(), bytes.size()}, item.rows());
  std::vector<std::string> all;
  for (std::size_t at = 0; at < bytes.size(); at += item.width) {
    std::string text = bytes.substr(at, item.width);
    text.resize(std::min(text.size(), text.find('\0')));
    while (!text.empty() && text.back() == ' ') text.pop_back();
    all.push_back(std::move(text));
  }
  return all;
}

}  // namespace varimesh::formats
