#include "client/cli/remedies.h"

namespace varimesh::client {
namespace {

/// What to do for a remedy; empty for a kind that this program does not know.
std::string what_to_do(const v1::Remedy& remedy) {
  switch (remedy.kind()) {
    case v1::Remedy::KIND_OPTIMISE:
      return "Try varimesh optimise";
    case v1::Remedy::KIND_MORE_TIME:
      return "Give the run more time";
    case v1::Remedy::KIND_UNTIL_VALID:
    case v1::Remedy::KIND_RAISE_ORDER:
    case v1::Remedy::KIND_SPLIT:
      return "Try " + flags_of(remedy);
    case v1::Remedy::KIND_SLIDE:
      return "Let boundary nodes slide on the CAD model (--geometry MODEL) or on the boundary as it came (" +
             flags_of(remedy) + ")";
    case v1::Remedy::KIND_OTHER_BOUNDARY:
      return "Mesh the boundary anew or refine it";
    default:
      return "";
  }
}

}  // namespace

v1::Remedy to_proto(const Remedy& remedy) {
  using Kind = Remedy::Kind;
  constexpr auto same = [](v1::Remedy::Kind message, Kind kind) { return message == static_cast<int>(kind) + 1; };
  static_assert(same(v1::Remedy::KIND_OPTIMISE, Kind::Optimise) && same(v1::Remedy::KIND_MORE_TIME, Kind::MoreTime) &&
                same(v1::Remedy::KIND_UNTIL_VALID, Kind::UntilValid) &&
                same(v1::Remedy::KIND_RAISE_ORDER, Kind::RaiseOrder) && same(v1::Remedy::KIND_SPLIT, Kind::Split) &&
                same(v1::Remedy::KIND_SLIDE, Kind::Slide) &&
                same(v1::Remedy::KIND_OTHER_BOUNDARY, Kind::OtherBoundary));
  v1::Remedy message;
  message.set_kind(static_cast<v1::Remedy::Kind>(static_cast<int>(remedy.kind) + 1));
  message.set_elements(remedy.elements);
  message.set_order(remedy.order);
  message.set_reason(remedy.reason);
  return message;
}

std::string flags_of(const v1::Remedy& remedy) {
  switch (remedy.kind()) {
    case v1::Remedy::KIND_UNTIL_VALID:
      return "--until valid";
    case v1::Remedy::KIND_RAISE_ORDER:
      return "--order " + std::to_string(remedy.order());
    case v1::Remedy::KIND_SPLIT:
      return "--repair split";
    case v1::Remedy::KIND_SLIDE:
      return "--slide-on boundary";
    case v1::Remedy::KIND_UNSPECIFIED:  // from a server that gives flags and no kind
      return remedy.flags();
    default:
      return "";
  }
}

std::string sentence_of(const v1::Remedy& remedy) {
  const std::string action = what_to_do(remedy);
  return action.empty() ? remedy.sentence() : action + ": " + remedy.reason();
}

}  // namespace varimesh::client
