// Lists of a Nektar++ file: finds entries by their ids, sorts them, and unpacks compressed ones.
#include <algorithm>

#include "core/formats/nektar/file.h"
#include "core/formats/scanner.h"
#include "core/formats/xml/encoding.h"

namespace varimesh::formats {

void NektarIds::add(std::int64_t id) {
  if (ids_.empty() && id != std::int64_t(count_))
    for (std::size_t i = 0; i < count_; ++i) ids_.push_back(std::int64_t(i));
  if (!ids_.empty() || id != std::int64_t(count_)) ids_.push_back(id);
  ++count_;
}

bool NektarIds::finish(std::int64_t& twice) {
  if (are_consecutive()) return true;
  for (std::size_t i = 0; i < ids_.size(); ++i) sorted_.emplace_back(ids_[i], std::int32_t(i));
  std::sort(sorted_.begin(), sorted_.end());
  const auto same = [](const auto& a, const auto& b) { return a.first == b.first; };
  const auto found = std::adjacent_find(sorted_.begin(), sorted_.end(), same);
  if (found != sorted_.end()) twice = found->first;
  return found == sorted_.end();
}

std::int32_t NektarIds::find(std::int64_t id) const {
  if (sorted_.empty()) return id >= 0 && id < std::int64_t(count_) ? std::int32_t(id) : -1;
  const auto found = std::lower_bound(sorted_.begin(), sorted_.end(), std::pair(id, std::int32_t(-1)));
  return found == sorted_.end() || found->first != id ? -1 : found->second;
}

void sort_parts(NektarParts& parts) {
  bool is_sorted = true;
  for (std::size_t e = 1; e < parts.ids.size(); ++e) is_sorted = is_sorted && parts.ids[e - 1] <= parts.ids[e];
  if (is_sorted) return;
  std::vector<std::pair<std::int64_t, std::size_t>> order;  // number, position
  std::vector<std::size_t> first;                           // of its sides
  std::size_t sides = 0;
  for (std::size_t e = 0; e < parts.ids.size(); ++e) {
    order.emplace_back(parts.ids[e], e);
    first.push_back(sides);
    sides += std::size_t(nektar_sides(parts.shapes[e]));
  }
  std::sort(order.begin(), order.end());
  NektarParts sorted;
  for (const auto& [number, at] : order) {
    sorted.ids.add(number);
    sorted.shapes.push_back(parts.shapes[at]);
    const auto begin = parts.sides.begin() + std::ptrdiff_t(first[at]);
    sorted.sides.insert(sorted.sides.end(), begin, begin + nektar_sides(parts.shapes[at]));
  }
  parts = std::move(sorted);
}

void unpack_nektar(std::string_view file, XmlText text, std::size_t record, FileAllowance& allowance,
                   const std::function<void(std::string_view)>& body) {
  std::size_t size = 0;
  const auto pass_on = [&](std::string_view bytes) {
    allowance.look();
    size += bytes.size();
    body(bytes.substr(0, bytes.size() / record * record));
  };
  Scanner scan(file.substr(0, text.begin + text.length));
  scan.go_to(text.begin);
  const Unpacked result = unpack_base64_zlib(scan.rest(), record, pass_on);
  if (result == Unpacked::NotBase64) scan.fail("the text is not base64");
  if (result == Unpacked::Damaged) scan.fail("the compressed data is damaged or incomplete");
  if (size % record != 0)
    scan.fail("the compressed data has " + std::to_string(size) + " bytes, no multiple of " + std::to_string(record));
}

int nektar_sides(Shape shape) {
  constexpr std::array kSides = {0, 2, 3, 4, 4, 5, 5, 6};
  return kSides[std::size_t(shape)];
}

std::optional<NektarPoints> points_of(std::string_view name) {
  if (name == "PolyEvenlySpaced" || name == "NodalTriEvenlySpaced") return NektarPoints::EvenlySpaced;
  if (name == "GaussLobattoLegendre") return NektarPoints::GaussLobatto;
  if (name == "NodalTriElec" || name == "NodalTriFekete") return NektarPoints::OtherTriangle;
  return std::nullopt;
}

std::string_view name_of_points(std::int64_t number) {
  switch (number) {
    case 4:
      return "GaussLobattoLegendre";
    case 17:
      return "PolyEvenlySpaced";
    case 22:
      return "NodalTriElec";
    case 23:
      return "NodalTriFekete";
    case 24:
      return "NodalTriEvenlySpaced";
    default:
      return "";
  }
}

char nektar_letter(Shape shape) { return "VETQAPRH"[std::size_t(shape)]; }

}  // namespace varimesh::formats
