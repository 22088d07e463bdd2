// How the library talks to varimesh_hdf5, the program that reads and writes HDF5 files (core/hdf). Internal to the
// library and to this program.
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace varimesh::formats::hdf5 {

/// The program, which lies beside the command or in lib/varimesh.
inline constexpr const char* kProgram = "varimesh_hdf5";

/// The program's open files: the socket over which it gets requests, and the HDF5 file that it writes. The file that it
/// reads stays with whoever asks, who first sends its size (std::int64_t), and then the bytes that the program needs.
inline constexpr int kSocket = 3, kFile = 4;

/// The most bytes of numbers in one request or answer.
inline constexpr std::int64_t kMostBytes = std::int64_t(1) << 22;
/// The most bytes of text in a request.
inline constexpr std::uint32_t kMostText = 1 << 16;

enum class Request : std::uint32_t {
  /// Text: a group's path. Answer: text with a line for every member of the group and every attribute, which has, with
  /// tabs between them: the Kind's letter, `a` for an attribute or `m` for a member, the bytes of a text, the
  /// dimensions with blanks between them, and the name.
  List = 1,
  /// Text: a path; for an attribute its owner's path, a line feed, and its name. Answer: the rows from `first` to
  /// `first + count - 1`, as numbers of 8 bytes or as texts.
  ReadIntegers,
  ReadNumbers,
  ReadTexts,
  /// Text: the path of an array. Answer: if its values lie in the file one after another as they are, their type (i1 to
  /// i8, f4 or f8), a blank, and the byte of the file where they begin. Otherwise nothing.
  Place,
  /// Text: the path of a group that is made.
  MakeGroup,
  /// Text: a path (for an attribute as above), a line feed, a type, a line feed, and the dimensions with blanks between
  /// them. Makes the array. If bytes follow the text, they are its values. If none follow, the answer is the byte of
  /// the file where the values of the array belong, and whoever asked may put them there; it is empty if they have no
  /// place.
  ///
  /// Types: i1, i2, i4, i8, u2, f4, f8; b1 (a truth value); S9 (text of 9 bytes, the rest zero); F9 (the rest blanks);
  /// a type
  /// with a count in square brackets, such as i8[27]; members with names in braces, such as {cidx:i2,off:i8}, which lie
  /// side by side without gaps.
  MakeArray,
  MakeAttribute,
  /// Text: a path. The bytes are the rows from `first` to `first + count - 1`.
  WriteRows,
  /// Ends the file and the program.
  Finish,
};

/// What comes first in a request; then come `text` bytes of text and `bytes` bytes of values.
struct RequestHead {
  Request request = Request::List;
  std::uint32_t text = 0;
  std::int64_t first = 0, count = 0;
  std::int64_t bytes = 0;
};

enum class Answer : std::int64_t {
  Values = 0,
  Failure = 1,  ///< The request failed. The bytes are a sentence.
  Need = 2,     ///< No bytes follow: the program needs `bytes` bytes of the file from `first` on before it can answer.
};

/// What comes first in an answer; then come `bytes` bytes.
struct AnswerHead {
  Answer what = Answer::Values;
  std::int64_t bytes = 0;
  std::int64_t first = 0;
};

static_assert(std::is_trivially_copyable_v<RequestHead> && std::is_trivially_copyable_v<AnswerHead>);

/// What an array consists of.
enum class Kind : char {
  Group = 'g',
  Integers = 'i',
  Numbers = 'f',
  Texts = 's',
  Other = 'o',  ///< Anything that cannot be read: records, references, links, external and virtual arrays.
};

}  // namespace varimesh::formats::hdf5
