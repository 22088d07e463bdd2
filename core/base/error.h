// What went wrong, as a value: every failure that a user can cause is one of these, with a sentence.
#pragma once

#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace varimesh {

/// A failure that a user can cause. Failures that only a bug can cause are assertions.
struct Error {
  enum class Kind {
    BadInput,   ///< The mesh or file was refused; exit status 3.
    BadOption,  ///< An option's value or combination was refused; exit status 2.
    Output,     ///< The result cannot be written there; exit status 3.
    Internal,   ///< Something that should not happen did; exit status 1.
  };
  Kind kind = Kind::BadInput;
  /// One sentence: what was wrong, where (element, node, line, byte) and what to do about it.
  std::string sentence;
};

/// A value, or the reason why there is none.
template <class T>
using Expected = tl::expected<T, Error>;

inline tl::unexpected<Error> bad_input(std::string sentence) {
  return tl::unexpected<Error>({Error::Kind::BadInput, std::move(sentence)});
}

inline tl::unexpected<Error> bad_option(std::string sentence) {
  return tl::unexpected<Error>({Error::Kind::BadOption, std::move(sentence)});
}

}  // namespace varimesh
