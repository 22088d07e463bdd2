#include "core/formats/xml/xml.h"

#include <expat.h>

#include <algorithm>
#include <cstring>
#include <exception>
#include <memory>
#include <optional>
#include <string>

#include "core/base/io/scanner.h"
#include "core/base/utf8.h"
#include "core/formats/common/file_allowance.h"

namespace varimesh::formats {

namespace {

constexpr int kDeepest = 64;
// Expat takes an int for a length. Between pieces the walk can skip raw text, and reading can be stopped.
constexpr std::size_t kPiece = std::size_t(1) << 16, kMostAtOnce = std::size_t(1) << 29;

// Expat 2.9 has 64-bit functions and warns of the older ones. Earlier versions have only the older ones.
#if XML_MAJOR_VERSION > 2 || (XML_MAJOR_VERSION == 2 && XML_MINOR_VERSION >= 9)
constexpr auto kByteIndex = XML_GetCurrentByteIndex64;
constexpr auto kByteCount = XML_GetCurrentByteCount64;
#else
constexpr auto kByteIndex = XML_GetCurrentByteIndex;
constexpr auto kByteCount = XML_GetCurrentByteCount;
#endif

/// Where the present event begins in what the parser has got; 0 if there is no event.
std::size_t event_begin(XML_Parser parser) {
  return static_cast<std::size_t>(std::max<std::int64_t>(0, kByteIndex(parser)));
}

/// How many bytes it has.
std::size_t event_size(XML_Parser parser) { return static_cast<std::size_t>(kByteCount(parser)); }

/// The length of the piece that expat gets next.
/// @param seen  what it has got so far
/// @param left  what is still to come
std::size_t next_piece(XML_Parser parser, std::size_t seen, std::size_t left) {
  // Expat begins anew with a tag or a comment that it has only in part. As it then gets as much again, it looks at each
  // byte a few times at most, however long the tag is.
  const std::size_t begun = event_begin(parser);
  return std::min({std::max(kPiece, seen - std::min(begun, seen)), kMostAtOnce, left});
}

/// The state of a walk. Exceptions must not pass through expat, which is written in C, so they wait here.
class Walk {
 public:
  Walk(std::string_view bytes, XmlVisitor& visitor, const FileAllowance& allowance)
      : bytes_(bytes), visitor_(visitor), allowance_(allowance), parser_(XML_ParserCreate(nullptr), XML_ParserFree) {
    if (!parser_) throw std::bad_alloc();
    XML_SetUserData(parser_.get(), this);
    XML_SetElementHandler(parser_.get(), start, end);
    XML_SetXmlDeclHandler(parser_.get(), declaration);
    XML_SetStartDoctypeDeclHandler(parser_.get(), doctype);
  }

  void run() {
    bool last = false;
    for (std::size_t at = 0; !last;) {
      allowance_.look_now();
      const std::size_t length = next_piece(parser_.get(), at - skipped_, bytes_.size() - at);
      last = at + length == bytes_.size();
      if (XML_Parse(parser_.get(), bytes_.data() + at, int(length), last ? 1 : 0) == XML_STATUS_ERROR) {
        if (failure_) std::rethrow_exception(failure_);
        if (!ended_) fail(XML_ErrorString(XML_GetErrorCode(parser_.get())));
        return;
      }
      at += length;
      if (!last && !ended_) at += raw_text(at);
    }
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    Scanner scan(bytes_);
    scan.go_to(std::min(position(), bytes_.size()));
    if (scan.at_end()) scan.fail_truncated("the end of the XML");
    scan.fail("it is not well-formed XML: " + what);
  }

  /// How many bytes of raw text follow that expat need not see. The walk must be inside the text, not inside a tag.
  std::size_t raw_text(std::size_t at) {
    if (!visitor_.has_raw_text() || bytes_.substr(text_, at - text_).find('<') != std::string_view::npos) return 0;
    const std::size_t length = std::min(bytes_.find('<', at), bytes_.size()) - at;
    skipped_ += length;
    return length;
  }

  std::size_t position() const { return skipped_ + event_begin(parser_.get()); }

  template <class Body>
  void guarded(const Body& body) {
    if (failure_ || ended_) return;
    try {
      body();
    } catch (...) {
      failure_ = std::current_exception();
    }
    if (failure_ || ended_) XML_StopParser(parser_.get(), XML_FALSE);
  }

  static void start(void* self, const XML_Char* name, const XML_Char** attributes) {
    auto& walk = *static_cast<Walk*>(self);
    walk.guarded([&] {
      if (++walk.depth_ > kDeepest) walk.fail("its elements are nested too deeply");
      walk.element_.name = name;
      walk.element_.begin = walk.position();
      walk.element_.attributes.clear();
      for (; attributes[0] != nullptr; attributes += 2)
        walk.element_.attributes.emplace_back(attributes[0], attributes[1]);
      walk.text_ = walk.position() + event_size(walk.parser_.get());
      if (!walk.visitor_.begins(walk.element_)) walk.ended_ = true;
    });
  }

  static void end(void* self, const XML_Char* name) {
    auto& walk = *static_cast<Walk*>(self);
    walk.guarded([&] {
      --walk.depth_;
      const std::size_t at = walk.position();
      walk.visitor_.ends(name, {std::min(walk.text_, at), at - std::min(walk.text_, at)});
      walk.text_ = at + event_size(walk.parser_.get());
    });
  }

  static void declaration(void* self, const XML_Char*, const XML_Char* encoding, int) {
    auto& walk = *static_cast<Walk*>(self);
    walk.guarded([&] {
      std::string lower(encoding == nullptr ? "utf-8" : encoding);
      std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return char(std::tolower(c)); });
      if (lower != "utf-8" && lower != "us-ascii") walk.fail("its encoding is not UTF-8; convert it with iconv");
    });
  }

  static void doctype(void* self, const XML_Char*, const XML_Char*, const XML_Char*, int) {
    auto& walk = *static_cast<Walk*>(self);
    walk.guarded(
        [&] { walk.fail("it declares a document type, which mesh files do not need; remove the declaration"); });
  }

  std::string_view bytes_;
  XmlVisitor& visitor_;
  const FileAllowance& allowance_;
  std::unique_ptr<XML_ParserStruct, decltype(&XML_ParserFree)> parser_;
  std::exception_ptr failure_;
  bool ended_ = false;
  std::size_t skipped_ = 0;  // bytes before the position that expat has not seen
  int depth_ = 0;
  XmlElement element_;    // kept, so that elements need no allocation of their own
  std::size_t text_ = 0;  // where the text began that may end next
};

}  // namespace

const std::string_view* XmlElement::find(std::string_view attribute) const {
  for (const auto& [name, value] : attributes)
    if (name == attribute) return &value;
  return nullptr;
}

std::string_view XmlElement::get(std::string_view attribute) const {
  const std::string_view* value = find(attribute);
  return value == nullptr ? std::string_view() : *value;
}

void walk_xml(std::string_view bytes, XmlVisitor& visitor, const FileAllowance& allowance) {
  Walk(bytes, visitor, allowance).run();
}

namespace {

/// Blanks the comments of `copy`.
struct Comments {
  XML_Parser parser;
  std::string copy;
  std::string last_element;

  static void comment(void* self, const XML_Char*) {
    auto& own = *static_cast<Comments*>(self);
    const std::size_t begin = event_begin(own.parser), length = event_size(own.parser);
    for (std::size_t i = begin; i < std::min(begin + length, own.copy.size()); ++i)
      if (own.copy[i] != '\n') own.copy[i] = ' ';
  }
  static void start(void* self, const XML_Char* name, const XML_Char**) {
    auto& own = *static_cast<Comments*>(self);
    if (name == own.last_element) XML_StopParser(own.parser, XML_FALSE);
  }
};

}  // namespace

std::string without_comments(std::string_view bytes, std::string_view last_element, const FileAllowance& allowance) {
  const std::string_view before = bytes.substr(0, bytes.find("<" + std::string(last_element)));
  if (before.find("<!--") == std::string_view::npos) return {};
  const std::unique_ptr<XML_ParserStruct, decltype(&XML_ParserFree)> parser(XML_ParserCreate(nullptr), XML_ParserFree);
  if (!parser) throw std::bad_alloc();
  Comments comments{parser.get(), std::string(bytes), std::string(last_element)};
  XML_SetUserData(parser.get(), &comments);
  XML_SetCommentHandler(parser.get(), Comments::comment);
  XML_SetStartElementHandler(parser.get(), Comments::start);
  // A file that is not well-formed is refused by the walk that follows.
  for (std::size_t at = 0, length = 0; at < bytes.size(); at += length) {
    allowance.look_now();
    length = next_piece(parser.get(), at, bytes.size() - at);
    if (XML_Parse(parser.get(), bytes.data() + at, int(length), at + length == bytes.size() ? 1 : 0) != XML_STATUS_OK)
      break;
  }
  return std::move(comments.copy);
}

std::string escaped_xml(std::string_view text) {
  std::string escaped;
  const std::string utf8 = as_utf8(text);
  for (std::size_t at = 0; at < utf8.size(); ++at) {
    const char c = utf8[at];
    if (c == '&')
      escaped += "&amp;";
    else if (c == '<')
      escaped += "&lt;";
    else if (c == '"')
      escaped += "&quot;";
    else if (c == '\t' || c == '\n' || c == '\r')
      escaped += "&#" + std::to_string(int(c)) + ";";  // as they are, they would be read as blanks
    else if (static_cast<unsigned char>(c) < ' ')
      escaped += as_plain_text({&c, 1});
    else if (utf8.compare(at, 2, "\xef\xbf") == 0 && static_cast<unsigned char>(utf8[at + 2]) >= 0xBE)
      escaped += utf8[at += 2] == '\xbe' ? "\\ufffe" : "\\uffff";
    else
      escaped += c;
  }
  return escaped;
}

bool begins_with_element(std::string_view bytes, std::string_view name) {
  std::string_view text = bytes.substr(0, 1 << 16);
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);  // the mark of UTF-8
  const auto skip = [&](std::string_view open, std::string_view close) {
    if (!text.starts_with(open)) return false;
    const std::size_t stop = text.find(close);
    text = stop == std::string_view::npos ? std::string_view() : text.substr(stop + close.size());
    return true;
  };
  do {
    while (!text.empty() && static_cast<unsigned char>(text.front()) <= ' ') text.remove_prefix(1);
  } while (skip("<?", "?>") || skip("<!--", "-->") || skip("<!DOCTYPE", text.find('[') < text.find('>') ? "]>" : ">"));
  if (!text.starts_with('<')) return false;
  text.remove_prefix(1);
  return text.starts_with(name) && text.size() > name.size() &&
         (static_cast<unsigned char>(text[name.size()]) <= ' ' || text[name.size()] == '>' || text[name.size()] == '/');
}

}  // namespace varimesh::formats
