#include "core/solvers/checkpoint.h"

namespace varimesh {
namespace {

/// Names the layout and the meaning of its numbers. Raise the number with every change of either.
constexpr std::string_view kName = "VariMesh checkpoint ", kMark = "VariMesh checkpoint 14\n";
static_assert(kMark.starts_with(kName));
constexpr std::size_t kPiece = 256 << 10;

std::uint64_t mixed(std::uint64_t hash, std::uint64_t word) {
  hash = (hash ^ word) * 0xff51afd7ed558ccd;
  return hash ^ (hash >> 32);
}

}  // namespace

void Fingerprint::add(std::string_view bytes) {
  std::size_t at = 0;
  for (; at + 8 <= bytes.size(); at += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + at, 8);
    hash_ = mixed(hash_, word);
  }
  std::uint64_t last = 0;
  if (at < bytes.size())
    std::memcpy(&last, bytes.data() + at, bytes.size() - at);  // if there are no bytes, the address may be null
  hash_ = mixed(mixed(hash_, last), bytes.size());
}

std::uint64_t fingerprint(const HighOrderMesh& mesh, const std::vector<bool>& fixed, const StretchField& target,
                          const Options& options) {
  Fingerprint print;
  print.add(mesh.dimension);
  print.add(mesh.order);
  print.add(mesh.coordinates);
  for (const ElementBlock& block : mesh.blocks) {
    print.add(block.shape);
    print.add(block.order);
    print.add(block.nodes);
  }
  print.add(std::vector<char>(fixed.begin(), fixed.end()));
  print.add(target.target);
  print.add(target.per);
  print.add(target.components);
  print.add(target.values);
  const Options& o = options;
  for (const auto choice : {int(o.energy), int(o.strain), int(o.volumetric), int(o.winslow), int(o.constants),
                            int(o.regularisation), int(o.method), int(o.colouring), int(o.active_set), int(o.until),
                            o.quadrature_degree, int(o.target), int(o.repair), int(o.objective), int(o.layer_spacing)})
    print.add(choice);
  for (const double number : {o.mu, o.lambda, o.kappa, o.tolerance, o.until_js, o.min_js, o.p_norm}) print.add(number);
  return print.value();
}

bool is_checkpoint(std::string_view bytes) { return bytes.starts_with(kName); }

CheckpointWriter::CheckpointWriter(ByteSink sink, std::uint64_t fingerprint) : sink_(std::move(sink)) {
  pending_.reserve(2 * kPiece);
  put(kMark.data(), kMark.size());
  (*this)(fingerprint);
}

void CheckpointWriter::put(const void* data, std::size_t size) {
  for (std::string_view bytes(static_cast<const char*>(data), size); !bytes.empty();) {
    const std::string_view part = bytes.substr(0, kPiece - pending_.size());
    pending_ += part;
    bytes.remove_prefix(part.size());
    if (pending_.size() == kPiece) flush();
  }
}

void CheckpointWriter::flush() {
  sum_.add(pending_);
  stopped_ = stopped_ || !sink_(pending_);
  pending_.clear();
}

bool CheckpointWriter::finish() {
  flush();
  const std::uint64_t sum = sum_.value();
  pending_.assign(reinterpret_cast<const char*>(&sum), sizeof sum);
  return !stopped_ && sink_(pending_);
}

CheckpointReader::CheckpointReader(std::string_view bytes, std::uint64_t fingerprint) {
  std::uint64_t sum = 0, of = 0;
  failed_ = bytes.size() < kMark.size() + sizeof of + sizeof sum || bytes.substr(0, kMark.size()) != kMark;
  if (failed_) return;
  std::memcpy(&sum, bytes.data() + bytes.size() - sizeof sum, sizeof sum);
  bytes.remove_suffix(sizeof sum);
  Fingerprint body;
  std::size_t at = 0;
  for (; bytes.size() - at >= kPiece; at += kPiece) body.add(bytes.substr(at, kPiece));
  body.add(bytes.substr(at));
  rest_ = bytes.substr(kMark.size());
  (*this)(of);
  failed_ = failed_ || body.value() != sum || of != fingerprint;
}

void CheckpointReader::get(void* data, std::size_t size) {
  failed_ = failed_ || size > rest_.size();
  if (size == 0) return;
  if (failed_) {
    std::memset(data, 0, size);
    return;
  }
  std::memcpy(data, rest_.data(), size);
  rest_.remove_prefix(size);
}

}  // namespace varimesh
