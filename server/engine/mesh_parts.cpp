// Reads and writes sequences of MeshPart messages.
#include "server/engine/mesh_parts.h"

#include <google/protobuf/io/coded_stream.h>

#include <algorithm>
#include <limits>
#include <optional>

#include "core/base/io/allowance.h"
#include "core/base/utf8.h"

namespace varimesh::server {
namespace {

using google::protobuf::io::CodedInputStream;
using google::protobuf::io::CodedOutputStream;

constexpr std::uint32_t kMaxPart = 1 << 20;

const char* const kTooMuchMemory =
    "up to here the mesh takes more memory than 8 times its parts, which are too many and too small; send more "
    "elements "
    "in each part";

/// Assembles a mesh from its parts. Each method returns what is wrong with its part; empty: nothing.
class Assembler {
 public:
  /// `bytes`: the size of all parts together. `stop` may be null.
  explicit Assembler(std::size_t bytes, const StopToken* stop)
      : bytes_(bytes),
        allowance_(most_mesh_memory(static_cast<std::int64_t>(bytes)), stop, WithheldMemory::current()) {}

  std::string take(const v1::MeshPart& part) {
    allowance_.look();
    if (!started_ && part.part_case() != v1::MeshPart::kHeader) return "the header must come first";
    switch (part.part_case()) {
      case v1::MeshPart::kHeader:
        return take_header(part.header());
      case v1::MeshPart::kCoordinates:
        return take_coordinates(part.coordinates());
      case v1::MeshPart::kElements:
        return take_elements(part.elements());
      case v1::MeshPart::kPhysicalGroup:
        return take_group(part.physical_group());
      case v1::MeshPart::kFixedNodes:
        return "fixed nodes are not supported by this server; leave them out";
      case v1::MeshPart::kCellQuality:
        return "a mesh does not contain the quality of its cells; leave it out";
      case v1::MeshPart::PART_NOT_SET:
        return "it has no content that this server knows";
    }
    return "";
  }

  /// Returns what is missing after the last part; empty: nothing.
  std::string missing() const {
    if (!started_) return "there is no header";
    if (mesh_.node_count() != nodes_)
      return "the header declares " + std::to_string(nodes_) + " nodes, but there are coordinates for " +
             std::to_string(mesh_.node_count());
    return "";
  }

  /// Nothing if there is too little memory.
  std::optional<HighOrderMesh> take_mesh() {
    if (!allowance_.reserve(mesh_.node_numbers, nodes_)) return std::nullopt;
    mesh_.node_numbers.resize(nodes_);
    for (std::size_t i = 0; i < nodes_; ++i) mesh_.node_numbers[i] = static_cast<std::int64_t>(i) + 1;
    mesh_.node_blocks = {{-1, 0, 0, static_cast<std::int32_t>(nodes_)}};
    return std::move(mesh_);
  }

 private:
  std::string take_header(const v1::MeshHeader& header) {
    if (started_) return "there is a second header";
    if (header.dimension() < 2 || header.dimension() > 3) return "the dimension must be 2 or 3";
    if (header.order() < 1 || header.order() > kMaxOrder) return "the order must be 1 to 10";
    if (header.nodes() < 1 || header.nodes() > std::numeric_limits<std::int32_t>::max())
      return "the number of nodes must be 1 to 2147483647";
    if (header.node_set() != v1::NODE_SET_EQUISPACED) return "the node set must be NODE_SET_EQUISPACED";
    started_ = true;
    mesh_.dimension = header.dimension();
    mesh_.order = header.order();
    nodes_ = static_cast<std::size_t>(header.nodes());
    // The header may announce more than the parts contain.
    const std::size_t most = std::min(nodes_, bytes_ / (3 * sizeof(double)));
    return allowance_.reserve(mesh_.coordinates, 3 * most) ? "" : kTooMuchMemory;
  }

  std::string take_coordinates(const v1::NodeCoordinates& part) {
    if (part.xyz_size() % 3 != 0) return "the number of coordinates is not a multiple of three";
    if (mesh_.coordinates.size() + static_cast<std::size_t>(part.xyz_size()) > 3 * nodes_)
      return "there are more coordinates than the header's " + std::to_string(nodes_) + " nodes";
    if (!allowance_.make_room(mesh_.coordinates, static_cast<std::size_t>(part.xyz_size()))) return kTooMuchMemory;
    mesh_.coordinates.insert(mesh_.coordinates.end(), part.xyz().begin(), part.xyz().end());
    return "";
  }

  std::string take_group(const v1::PhysicalGroup& group) {
    if (!allowance_.take(group.name().size() + kAllocation) || !allowance_.make_room(mesh_.physical_groups, 1))
      return kTooMuchMemory;
    mesh_.physical_groups.push_back({group.dimension(), group.tag(), group.name()});
    return "";
  }

  std::string take_elements(const v1::ElementPart& part) {
    if (!v1::Shape_IsValid(part.shape()) || part.shape() == v1::SHAPE_UNSPECIFIED)
      return "the shape of its elements is unknown";
    const auto shape = static_cast<Shape>(static_cast<int>(part.shape()) - 1);
    const int dimension = reference::info(shape).dimension;
    if (dimension > mesh_.dimension) return "its elements have a higher dimension than the header declares";
    const int nodes = dimension == 0 ? 1 : reference::node_count(shape, mesh_.order);
    if (part.nodes_size() % nodes != 0)
      return "the number of its nodes is not a multiple of " + std::to_string(nodes) + ", the nodes per element";
    for (const std::int32_t node : part.nodes())
      if (node < 0 || static_cast<std::size_t>(node) >= nodes_)
        return "node " + std::to_string(node) + " does not exist; nodes are counted from 0";
    const auto count = static_cast<std::size_t>(part.nodes_size() / nodes);
    if (count == 0) return "";
    ElementBlock* block = block_for(part, shape);
    if (block == nullptr || !grow(block->numbers, count) ||
        !grow(block->nodes, count * static_cast<std::size_t>(nodes)))
      return kTooMuchMemory;
    block->nodes.insert(block->nodes.end(), part.nodes().begin(), part.nodes().end());
    for (std::size_t i = 0; i < count; ++i) block->numbers.push_back(++elements_);
    return "";
  }

  /// The block of these elements: the last one if it is of the same kind, otherwise a new one. Null if there is too
  /// little memory.
  ElementBlock* block_for(const v1::ElementPart& part, Shape shape) {
    if (!mesh_.blocks.empty()) {
      ElementBlock& last = mesh_.blocks.back();
      if (last.shape == shape && last.entity == part.entity() && std::ranges::equal(last.physical, part.physical()))
        return &last;
    }
    const std::size_t groups = static_cast<std::size_t>(part.physical_size()) * sizeof(int);
    if (!allowance_.take(groups + kAllocation) || !allowance_.make_room(mesh_.blocks, 1)) return nullptr;
    ElementBlock& block = mesh_.blocks.emplace_back();
    block.shape = shape;
    block.order = reference::info(shape).dimension == 0 ? 1 : mesh_.order;
    block.entity = part.entity();
    block.physical.assign(part.physical().begin(), part.physical().end());
    return &block;
  }

  /// Makes room for `more` values, and for half as many as there are.
  template <class T>
  bool grow(std::vector<T>& values, std::size_t more) {
    const std::size_t size = values.size() + more;
    return size <= values.capacity() || allowance_.reserve(values, std::max(size, values.size() * 3 / 2));
  }

  std::size_t bytes_;
  Allowance allowance_;
  HighOrderMesh mesh_;
  std::size_t nodes_ = 0;
  std::int64_t elements_ = 0;
  bool started_ = false;
};

/// Writes one part, preceded by its length.
Expected<void> put(const v1::MeshPart& part, const Sink& sink) {
  std::string bytes(CodedOutputStream::VarintSize32(static_cast<std::uint32_t>(part.ByteSizeLong())), '\0');
  CodedOutputStream::WriteVarint32ToArray(static_cast<std::uint32_t>(part.ByteSizeLong()),
                                          reinterpret_cast<std::uint8_t*>(bytes.data()));
  part.AppendToString(&bytes);
  if (sink(bytes)) return {};
  return tl::unexpected(Error{Error::Kind::Output, "The result cannot be stored: the disk is full."});
}

Expected<void> put_header(const HighOrderMesh& mesh, const Sink& sink) {
  v1::MeshPart part;
  v1::MeshHeader& header = *part.mutable_header();
  header.set_dimension(mesh.dimension);
  header.set_order(mesh.order);
  header.set_node_set(v1::NODE_SET_EQUISPACED);
  header.set_nodes(static_cast<std::int64_t>(mesh.node_count()));
  return put(part, sink);
}

Expected<void> put_coordinates(const HighOrderMesh& mesh, const Sink& sink) {
  constexpr std::size_t kNodes = 32768;  // 768 KiB of coordinates
  v1::MeshPart part;
  for (std::size_t first = 0; first < mesh.coordinates.size(); first += 3 * kNodes) {
    const std::size_t last = std::min(first + 3 * kNodes, mesh.coordinates.size());
    part.mutable_coordinates()->mutable_xyz()->Assign(mesh.coordinates.begin() + static_cast<std::ptrdiff_t>(first),
                                                      mesh.coordinates.begin() + static_cast<std::ptrdiff_t>(last));
    if (auto done = put(part, sink); !done) return done;
  }
  return {};
}

Expected<void> put_elements(const ElementBlock& block, const Sink& sink) {
  const std::size_t nodes = block.numbers.empty() ? 1 : block.nodes.size() / block.numbers.size();
  const std::size_t step = std::max<std::size_t>(1, 131072 / nodes) * nodes;  // at most 5 bytes per node
  v1::MeshPart part;
  for (std::size_t first = 0; first < block.nodes.size(); first += step) {
    const std::size_t last = std::min(first + step, block.nodes.size());
    v1::ElementPart& elements = *part.mutable_elements();
    elements.Clear();
    elements.set_shape(static_cast<v1::Shape>(static_cast<int>(block.shape) + 1));
    elements.set_entity(block.entity);
    elements.mutable_physical()->Assign(block.physical.begin(), block.physical.end());
    elements.mutable_nodes()->Assign(block.nodes.begin() + static_cast<std::ptrdiff_t>(first),
                                     block.nodes.begin() + static_cast<std::ptrdiff_t>(last));
    if (auto done = put(part, sink); !done) return done;
  }
  return {};
}

Expected<void> put_group(const PhysicalGroup& group, const Sink& sink) {
  if (!is_utf8(group.name))
    return tl::unexpected(Error{
        Error::Kind::Output, "The name of the physical group with dimension " + std::to_string(group.dimension) +
                                 " and tag " + std::to_string(group.tag) +
                                 " is not UTF-8, and parts of a mesh cannot contain it; rename the group, or ask for "
                                 "an MSH file."});
  v1::MeshPart part;
  part.mutable_physical_group()->set_dimension(group.dimension);
  part.mutable_physical_group()->set_tag(group.tag);
  part.mutable_physical_group()->set_name(group.name);
  return put(part, sink);
}

}  // namespace

Expected<HighOrderMesh> read_mesh_parts(std::string_view bytes, const StopToken* stop) try {
  Assembler assembler(bytes.size(), stop);
  std::size_t offset = 0;
  for (int number = 1; offset < bytes.size(); ++number) {
    const auto refuse = [&](const std::string& what) {
      return bad_input("Part " + std::to_string(number) + " of the mesh, at byte " + std::to_string(offset) + ": " +
                       what + ".");
    };
    const std::size_t left = std::min<std::size_t>(bytes.size() - offset, kMaxPart + 16);
    CodedInputStream input(reinterpret_cast<const std::uint8_t*>(bytes.data()) + offset, static_cast<int>(left));
    std::uint32_t size = 0;
    if (!input.ReadVarint32(&size)) return refuse("its length is cut off; send the whole mesh");
    if (size > kMaxPart) return refuse("it is longer than 1 MiB; split it");
    const auto prefix = static_cast<std::size_t>(input.CurrentPosition());
    if (size > bytes.size() - offset - prefix) return refuse("it is cut off; send the whole mesh");
    v1::MeshPart part;
    if (!part.ParseFromArray(bytes.data() + offset + prefix, static_cast<int>(size)))
      return refuse("it is not a MeshPart message");
    if (const std::string wrong = assembler.take(part); !wrong.empty()) return refuse(wrong);
    offset += prefix + size;
  }
  if (const std::string wrong = assembler.missing(); !wrong.empty())
    return bad_input("The parts of the mesh are incomplete: " + wrong + ".");
  auto mesh = assembler.take_mesh();
  if (!mesh) return bad_input(std::string("The parts of the mesh cannot be read: ") + kTooMuchMemory + ".");
  return std::move(*mesh);
} catch (const Interrupted&) {
  return bad_input("Reading the parts of the mesh was stopped before their end.");
}

Expected<void> write_mesh_parts(const HighOrderMesh& mesh, const Sink& sink) {
  if (auto done = put_header(mesh, sink); !done) return done;
  if (auto done = put_coordinates(mesh, sink); !done) return done;
  for (const ElementBlock& block : mesh.blocks)
    if (auto done = put_elements(block, sink); !done) return done;
  for (const PhysicalGroup& group : mesh.physical_groups)
    if (auto done = put_group(group, sink); !done) return done;
  return {};
}

Expected<void> write_cell_quality(const HighOrderMesh& mesh, std::span<const double> scaled_jacobians,
                                  const std::function<v1::CellAnswer(std::size_t cell)>& answer_of, const Sink& sink) {
  constexpr std::size_t kCells = 32768;  // at most 19 bytes per cell
  std::vector<std::int64_t> numbers;
  for (const ElementBlock& block : mesh.blocks)
    if (reference::info(block.shape).dimension == mesh.dimension)
      numbers.insert(numbers.end(), block.numbers.begin(), block.numbers.end());
  v1::MeshPart part;
  for (std::size_t first = 0; first < numbers.size(); first += kCells) {
    v1::CellQuality& cells = *part.mutable_cell_quality();
    cells.Clear();
    for (std::size_t i = first; i < std::min(first + kCells, numbers.size()); ++i) {
      cells.add_numbers(numbers[i]);
      cells.add_scaled_jacobians(scaled_jacobians[i]);
      cells.add_answers(answer_of(i));
    }
    if (auto done = put(part, sink); !done) return done;
  }
  return {};
}

}  // namespace varimesh::server
