// Errors as values: every failure that a user can cause is returned as an Error with a sentence.
#pragma once

#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace varimesh {

/// A failure that a user can cause. Failures that only a bug can cause are assertions.
struct Error {
  enum class Kind {
    BadInput,   ///< The mesh or file was refused; exit status 3.
    BadOption,  ///< The value of an option, or a combination of options, was refused; exit status 2.
    Output,     ///< The result cannot be written to the given place; exit status 3.
    Internal,   ///< Something happened that should never happen; exit status 1.
  };
  Kind kind = Kind::BadInput;
  /// One sentence that says what was wrong, where (element, node, line, byte) and what to do.
  std::string sentence;
};

/// A value, or the error if there is none.
template <class T>
using Expected = tl::expected<T, Error>;

inline tl::unexpected<Error> bad_input(std::string sentence) {
  return tl::unexpected<Error>({Error::Kind::BadInput, std::move(sentence)});
}

inline tl::unexpected<Error> bad_option(std::string sentence) {
  return tl::unexpected<Error>({Error::Kind::BadOption, std::move(sentence)});
}

}  // namespace varimesh
