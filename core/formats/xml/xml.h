// Walks through an XML file with expat. Internal to core/formats.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace varimesh::formats {

class FileAllowance;

/// An element of an XML file, as it begins.
struct XmlElement {
  std::string_view name;
  std::vector<std::pair<std::string_view, std::string_view>> attributes;
  std::size_t begin = 0;  ///< The byte of the file where its tag begins.

  /// The value of an attribute; null if the element does not have it.
  const std::string_view* find(std::string_view attribute) const;
  /// The value, or nothing.
  std::string_view get(std::string_view attribute) const;
};

/// Bytes of the file: offset and length. They stay in the file, which may be much larger than memory for copies.
struct XmlText {
  std::size_t begin = 0, length = 0;
};

/// Receives the elements of a file in order. May throw ReadFailure.
class XmlVisitor {
 public:
  virtual ~XmlVisitor() = default;
  /// An element begins. Return true to go on inside it, false to end the walk.
  virtual bool begins(const XmlElement& element) = 0;
  /// An element ends. `text` are the bytes since its last child, or since its tag if it has none.
  virtual void ends(std::string_view name, XmlText text) = 0;
  /// Whether the text of the element that began last is checked by the visitor, byte for byte, so that the walk need
  /// not look at it up to the next tag.
  virtual bool has_raw_text() const { return false; }
};

/// Walks through the file. Throws ReadFailure if it is not well-formed, declares a document type (which can make a
/// small file huge), nests elements deeper than 64, or is not in UTF-8 or ASCII; Interrupted if reading is to stop.
void walk_xml(std::string_view bytes, XmlVisitor& visitor, const FileAllowance& allowance);

/// The file with blanks in place of its comments, at the same bytes; empty if it has none. What follows an element with
/// this name stays as it is: it may be raw bytes. Throws Interrupted if reading is to stop.
std::string without_comments(std::string_view bytes, std::string_view last_element, const FileAllowance& allowance);

/// The text as an attribute in quotation marks has it. What XML cannot hold is written as \xNN or \uNNNN: control
/// characters, bytes that are not UTF-8, U+FFFE and U+FFFF.
std::string escaped_xml(std::string_view text);

/// Whether the bytes are XML whose first element has this name.
bool begins_with_element(std::string_view bytes, std::string_view name);

}  // namespace varimesh::formats
