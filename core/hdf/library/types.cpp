#include "core/hdf/library/types.h"

#include <charconv>
#include <utility>
#include <vector>

namespace varimesh::hdf {

Handle::Handle(hid_t id, Close close, const char* what) : id_(id), close_(close) {
  if (id < 0) throw Refusal(what);
}

Handle::~Handle() {
  if (id_ >= 0) close_(id_);
}

void check(herr_t result, const char* what) {
  if (result < 0) throw Refusal(what);
}

namespace {

/// Reads the name of a type from left to right.
class Parser {
 public:
  explicit Parser(std::string_view text) : left_(text) {}

  Handle all() {
    Handle type = one();
    if (!left_.empty()) throw Refusal("a type has a name that is too long");
    return type;
  }

 private:
  bool accept(char c) {
    if (!left_.starts_with(c)) return false;
    left_.remove_prefix(1);
    return true;
  }
  void expect(char c) {
    if (!accept(c)) throw Refusal("the name of a type is incomplete");
  }
  std::size_t number() {
    std::size_t value = 0;
    const auto [stop, error] = std::from_chars(left_.data(), left_.data() + left_.size(), value);
    if (error != std::errc() || value == 0 || value > 1'000'000) throw Refusal("a type has a wrong size");
    left_.remove_prefix(std::size_t(stop - left_.data()));
    return value;
  }
  static Handle copy(hid_t type) { return {H5Tcopy(type), H5Tclose, "a type cannot be made"}; }

  static Handle truth() {
    Handle type(H5Tenum_create(H5T_STD_I8LE), H5Tclose, "a type cannot be made");
    for (const signed char value : {0, 1})
      check(H5Tenum_insert(type, value == 0 ? "FALSE" : "TRUE", &value), "a type cannot be made");
    return type;
  }

  Handle members() {
    std::vector<std::pair<std::string, Handle>> all;
    std::size_t size = 0;
    do {
      const std::size_t end = left_.find(':');
      if (end == std::string_view::npos) throw Refusal("a member of a type has no name");
      std::string name(left_.substr(0, end));
      left_.remove_prefix(end + 1);
      all.emplace_back(std::move(name), one());
      size += H5Tget_size(all.back().second);
    } while (accept(','));
    expect('}');
    Handle type(H5Tcreate(H5T_COMPOUND, size), H5Tclose, "a type cannot be made");
    std::size_t offset = 0;
    for (const auto& [name, member] : all) {
      check(H5Tinsert(type, name.c_str(), offset, member), "a type cannot be made");
      offset += H5Tget_size(member);
    }
    return type;
  }

  Handle plain() {
    if (accept('{')) return members();
    if (left_.empty()) throw Refusal("the name of a type is incomplete");
    const char letter = left_.front();
    left_.remove_prefix(1);
    const std::size_t size = number();
    if (letter == 'b' && size == 1) return truth();
    if (letter == 'f' && size == 4) return copy(H5T_IEEE_F32LE);
    if (letter == 'f' && size == 8) return copy(H5T_IEEE_F64LE);
    if (letter == 'u' && size == 2) return copy(H5T_STD_U16LE);
    if (letter == 'i' && size == 1) return copy(H5T_STD_I8LE);
    if (letter == 'i' && size == 2) return copy(H5T_STD_I16LE);
    if (letter == 'i' && size == 4) return copy(H5T_STD_I32LE);
    if (letter == 'i' && size == 8) return copy(H5T_STD_I64LE);
    if (letter != 'S' && letter != 'F') throw Refusal("a type has an unknown name");
    Handle text = copy(H5T_C_S1);
    check(H5Tset_size(text, size), "a type cannot be made");
    check(H5Tset_strpad(text, letter == 'S' ? H5T_STR_NULLPAD : H5T_STR_SPACEPAD), "a type cannot be made");
    return text;
  }

  Handle one() {
    Handle type = plain();
    if (!accept('[')) return type;
    const hsize_t count = number();
    expect(']');
    return {H5Tarray_create2(type, 1, &count), H5Tclose, "a type cannot be made"};
  }

  std::string_view left_;
};

}  // namespace

Handle type_of(std::string_view name) { return Parser(name).all(); }

formats::hdf5::Kind kind_of(hid_t type) {
  using formats::hdf5::Kind;
  switch (H5Tget_class(type)) {
    case H5T_INTEGER:
      return Kind::Integers;
    case H5T_FLOAT:
      return Kind::Numbers;
    case H5T_STRING:
      return Kind::Texts;
    default:
      return Kind::Other;
  }
}

}  // namespace varimesh::hdf
