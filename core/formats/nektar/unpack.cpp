// Unpacks the compressed lists of a Nektar++ file.
#include <algorithm>
#include <cstring>
#include <exception>
#include <map>
#include <mutex>
#include <optional>

#include "core/formats/nektar/file.h"
#include "core/formats/xml/encoding.h"

namespace varimesh::formats {

namespace {

std::optional<NektarPoints> points_of(std::string_view name) {
  if (name == "PolyEvenlySpaced" || name == "NodalTriEvenlySpaced") return NektarPoints::EvenlySpaced;
  if (name == "GaussLobattoLegendre") return NektarPoints::GaussLobatto;
  if (name == "NodalTriElec" || name == "NodalTriFekete") return NektarPoints::OtherTriangle;
  return std::nullopt;
}

/// By the numbers of Nektar++'s PointsType.
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

/// The allowance of all threads.
struct SharedAllowance {
  FileAllowance& allowance;
  std::mutex mutex;
};

/// Unpacks a list by one thread.
class Unpacker {
 public:
  Unpacker(NektarFile& file, const NektarPackedList& list, SharedAllowance& shared)
      : file_(file), list_(list), shared_(shared), scan_(file.bytes) {
    scan_.go_to(list.text.begin);
  }

  void unpack() {
    using Kind = NektarPackedList::Kind;
    switch (list_.kind) {
      case Kind::Vertices:
        return for_each<NektarPackedPoint>(file_.vertices, 3, [&](const NektarPackedPoint& vertex) {
          const auto name = [&] { return "vertex " + std::to_string(vertex.id); };
          for (const double x : vertex.x) scan_.finite(x, name);
          file_.vertex_ids.add(vertex.id);
          file_.vertices.insert(file_.vertices.end(), vertex.x, vertex.x + 3);
        });
      case Kind::Edges:
        return for_each<std::array<std::int64_t, 3>>(file_.edges, 2, [&](const auto& edge) {
          file_.edge_ids.add(edge[0]);
          for (std::size_t k = 1; k < 3; ++k) file_.edges.push_back(small(edge[k]));
        });
      case Kind::Faces:
        return parts(file_.faces);
      case Kind::Elements:
        return parts(file_.elements);
      case Kind::CurvedEdges:
        return curves(file_.curved_edges);
      case Kind::CurvedFaces:
        return curves(file_.curved_faces);
      case Kind::Index:
        for_each<std::int64_t>(file_.index, 0, [&](std::int64_t number) { add_index(number); });
        return;
      case Kind::Points:
        return for_each<NektarPackedPoint>(file_.points, 3, [&](const NektarPackedPoint& point) {
          for (const double x : point.x) scan_.finite(x, [&] { return nektar_packed_point(file_.points.size() / 3); });
          file_.points.insert(file_.points.end(), point.x, point.x + 3);
        });
    }
  }

 private:
  void parts(NektarParts& list) {
    switch (nektar_sides(list_.shape)) {
      case 3:
        return parts<3>(list);
      case 4:
        return parts<4>(list);
      case 5:
        return parts<5>(list);
      default:
        return parts<6>(list);
    }
  }

  template <std::size_t Sides>
  void parts(NektarParts& list) {
    for_each<std::array<std::int64_t, 1 + Sides>>(list.sides, Sides, [&](const auto& numbers) {
      list.ids.add(numbers[0]);
      list.shapes.push_back(list_.shape);
      for (std::size_t k = 1; k <= Sides; ++k) list.sides.push_back(small(numbers[k]));
    });
    list.shapes.shrink_to_fit();
  }

  void curves(std::vector<NektarCurve>& list) {
    struct Info {
      std::int64_t id, of, count, points, first, type;
    };
    for_each<Info>(list, 1, [&](const Info& info) {
      if (info.count < 0 || info.first < 0) scan_.fail("a curve has a negative number of points");
      list.push_back({small(info.of), std::uint32_t(small(info.first)), nektar_count_of(scan_, info.count),
                      nektar_points_of(scan_, info.of, name_of_points(info.type))});
    });
  }

  /// Numbers 0, 1, 2, … need no list.
  void add_index(std::int64_t number) {
    const std::size_t before = file_.indices++;
    if (file_.index.empty() && number == std::int64_t(before)) return;
    if (file_.index.empty()) {
      make_room(file_.index, before + 1);
      for (std::size_t i = 0; i < before; ++i) file_.index.push_back(std::int32_t(i));
    }
    make_room(file_.index, 1);
    file_.index.push_back(small(number));
  }

  std::int32_t small(std::int64_t number) const {
    if (!is_nektar_number(number)) fail_nektar_number(scan_, number);
    return std::int32_t(number);
  }

  /// Calls body(record) for each record; `each`: how many values of the list it makes.
  template <class Record, class T, class Body>
  void for_each(std::vector<T>& list, std::size_t each, const Body& body) {
    begun_ = list.size();
    unpack_nektar(file_.bytes, list_.text, sizeof(Record), [&](std::string_view bytes, std::size_t done) {
      {
        const std::lock_guard lock(shared_.mutex);
        shared_.allowance.take(bytes.size() / sizeof(Record), sizeof(std::int64_t));  // its id
      }
      done_ = double(done) / double(list_.text.length);
      if (each > 0) make_room(list, each * (bytes.size() / sizeof(Record)));
      for (std::size_t at = 0; at < bytes.size(); at += sizeof(Record)) {
        Record record;
        std::memcpy(&record, bytes.data() + at, sizeof(Record));
        body(record);
      }
    });
    // A copy to save less would take more memory for a moment.
    if (list.capacity() - list.size() > list.size() / 8) list.shrink_to_fit();
  }

  /// Makes room for `more` values, and for those that follow if the rest of the text has as many as the text so far.
  /// While the list grows, it is in memory twice.
  template <class T>
  void make_room(std::vector<T>& values, std::size_t more) {
    const std::size_t before = values.capacity(), size = values.size() + more;
    if (size <= before) return;
    constexpr double kMore = 1.02;
    const auto whole = begun_ + std::size_t(kMore * double(size - begun_) / std::max(done_, 1e-3));
    const std::size_t wanted = std::max({size, whole, before + before / 16});
    const std::lock_guard lock(shared_.mutex);
    shared_.allowance.take(wanted, sizeof(T));
    values.reserve(wanted);
    shared_.allowance.give_back(before * sizeof(T));
  }

  NektarFile& file_;
  const NektarPackedList& list_;
  SharedAllowance& shared_;
  Scanner scan_;
  double done_ = 0;        // the part of the text that has been unpacked
  std::size_t begun_ = 0;  // how many values the texts before this one have made
};

}  // namespace

void unpack_nektar_lists(NektarFile& file, const std::vector<NektarPackedList>& lists, FileAllowance& allowance,
                         const Team& team) {
  // Lists of one kind are one after another in memory, so one thread unpacks them.
  std::map<NektarPackedList::Kind, std::vector<const NektarPackedList*>> by_kind;
  for (const NektarPackedList& list : lists) by_kind[list.kind].push_back(&list);
  struct Task {
    std::vector<const NektarPackedList*> lists;
    std::size_t bytes = 0;
    std::exception_ptr failure;
  };
  std::vector<Task> tasks;
  for (auto& [_, own] : by_kind) {
    tasks.push_back({own, 0, nullptr});
    for (const NektarPackedList* list : own) tasks.back().bytes += list->text.length;
  }
  std::stable_sort(tasks.begin(), tasks.end(), [](const Task& a, const Task& b) { return a.bytes > b.bytes; });
  SharedAllowance shared{allowance, {}};
  team.for_each(std::int32_t(tasks.size()), 1, [&](std::int32_t t) {
    Task& task = tasks[std::size_t(t)];
    try {
      for (const NektarPackedList* list : task.lists) Unpacker(file, *list, shared).unpack();
    } catch (...) {
      task.failure = std::current_exception();
    }
  });
  // The first of the file, whatever the threads did.
  const Task* first = nullptr;
  for (const Task& task : tasks)
    if (task.failure && (first == nullptr || task.lists[0]->text.begin < first->lists[0]->text.begin)) first = &task;
  if (first != nullptr) std::rethrow_exception(first->failure);
}

void unpack_nektar(std::string_view file, XmlText text, std::size_t record,
                   const std::function<void(std::string_view bytes, std::size_t done)>& body) {
  std::size_t size = 0;
  const auto pass_on = [&](std::string_view bytes, std::size_t done) {
    size += bytes.size();
    body(bytes.substr(0, bytes.size() / record * record), done);
  };
  Scanner scan(file.substr(0, text.begin + text.length));
  scan.go_to(text.begin);
  const Unpacked result = unpack_base64_zlib(scan.rest(), record, pass_on);
  if (result == Unpacked::NotBase64) scan.fail("the text is not base64");
  if (result == Unpacked::Damaged) scan.fail("the compressed data is damaged or incomplete");
  if (size % record != 0)
    scan.fail("the compressed data has " + std::to_string(size) + " bytes, no multiple of " + std::to_string(record));
}

NektarPoints nektar_points_of(const Scanner& scan, std::int64_t curve, std::string_view name) {
  const auto points = points_of(name);
  if (!points)
    scan.fail("the curve of " + std::to_string(curve) + " has points of the type '" + std::string(name.substr(0, 40)) +
              "'; VariMesh reads PolyEvenlySpaced, GaussLobattoLegendre and NodalTriEvenlySpaced");
  return *points;
}

std::int16_t nektar_count_of(const Scanner& scan, std::int64_t count) {
  if (count > std::numeric_limits<std::int16_t>::max())
    scan.fail("a curve has " + std::to_string(count) + " points, which nothing of order 1 to 10 has");
  return std::int16_t(count);
}

void fail_nektar_number(const Scanner& scan, std::int64_t number) {
  scan.fail("the number " + std::to_string(number) + " of a vertex, edge, face, element or point is not from 0 to " +
            std::to_string(std::numeric_limits<std::int32_t>::max()));
}

}  // namespace varimesh::formats
