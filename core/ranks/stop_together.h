// Ranks stop at the same point of their work.
#pragma once

#include "core/base/stop_token.h"
#include "core/ranks/ranks.h"

namespace varimesh {

/// All ranks stop if one of them is to: because one was asked to, or else because a time limit has passed on one. The
/// ranks must outlive it.
StopToken::Agreement agreement_of(const Ranks& ranks);

/// The token stops only when all ranks do. With one rank it stays as it is.
inline void stop_together(StopToken& token, const Ranks& ranks) {
  if (ranks.count() > 1) token.stop_together(agreement_of(ranks));
}

}  // namespace varimesh
