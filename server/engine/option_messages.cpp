// Fields of the message have the names of the table. The value of an enum is that of the library plus one, since 0
// means "not said". Tests compare the message with the table.
#include "server/engine/option_messages.h"

#include <google/protobuf/reflection.h>

#include <algorithm>
#include <cassert>
#include <string>
#include <string_view>

#include "core/options/option_table.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Reflection;

template <class Message>
const FieldDescriptor& field_of(std::string_view option) {
  const FieldDescriptor* field = Message::descriptor()->FindFieldByName(std::string(option));
  assert(field != nullptr);
  return *field;
}

/// Reads one option of the struct `Of`; called with its member. False if this server does not know the value.
template <class Of, class Message>
struct FromMessage {
  const Message& message;
  const FieldDescriptor& field;
  Of& options;
  const Reflection& reflection = *Message::GetReflection();

  /// A number without presence has the default 0 in the library as well.
  bool is_given() const { return !field.has_presence() || reflection.HasField(message, &field); }

  bool operator()(double Of::*member) const {
    if (is_given()) options.*member = reflection.GetDouble(message, &field);
    return true;
  }
  bool operator()(int Of::*member) const {
    if (is_given()) options.*member = reflection.GetInt32(message, &field);
    return true;
  }
  bool operator()(bool Of::*member) const {
    if (is_given()) options.*member = reflection.GetBool(message, &field);
    return true;
  }
  bool operator()(std::vector<std::string> Of::*member) const {
    const auto values = reflection.template GetRepeatedFieldRef<std::string>(message, &field);
    (options.*member).assign(values.begin(), values.end());
    return true;
  }
  bool operator()(std::vector<std::int64_t> Of::*member) const {
    const auto values = reflection.template GetRepeatedFieldRef<std::int64_t>(message, &field);
    (options.*member).assign(values.begin(), values.end());
    return true;
  }
  bool operator()(std::vector<double> Of::*member) const {
    const auto values = reflection.template GetRepeatedFieldRef<double>(message, &field);
    (options.*member).assign(values.begin(), values.end());
    return true;
  }
  bool operator()(const ChoiceOf<Of>& member) const {
    const int value = reflection.GetEnumValue(message, &field);
    if (value < 0 || value > static_cast<int>(member.words.size())) return false;
    if (value > 0) member.set(options, value - 1);
    return true;
  }
  bool operator()(TargetField Of::*member) const {
    if constexpr (requires { message.target_field(); }) {
      const v1::TargetField& from = message.target_field();
      if (!v1::Per_IsValid(from.per())) return false;
      TargetField& to = options.*member;
      if (from.per() != v1::PER_UNSPECIFIED) to.per = from.per() == v1::PER_CELL ? Per::Cell : Per::Vertex;
      if (is_given()) to.components = from.components();
      to.numbers.assign(from.numbers().begin(), from.numbers().end());
      to.values.assign(from.values().begin(), from.values().end());
    }
    return true;
  }
};

/// Reads all options of a table.
template <class Of, class Message>
Answer<Of> read_all(std::span<const OptionOf<Of>> table, const Message& message) {
  Of options;
  for (const OptionOf<Of>& option : table)
    if (!std::visit(FromMessage<Of, Message>{message, field_of<Message>(option.name), options}, option.member)) {
      // Of a field, only the enum inside it can be unknown.
      const bool is_field = std::holds_alternative<TargetField Of::*>(option.member);
      const std::string name = std::string(option.name) + (is_field ? ".per" : "");
      return invalid_option(
          "The option '" + name + "' has a value that this server does not know; GetServerInfo returns its version.",
          {{"option", name}});
    }
  return options;
}

/// Writes one option; called with its member.
struct ToMessage {
  const Options& options;
  const FieldDescriptor& field;
  v1::Options& message;
  const Reflection& reflection = *v1::Options::GetReflection();

  void operator()(double Options::*member) const { reflection.SetDouble(&message, &field, options.*member); }
  void operator()(int Options::*member) const { reflection.SetInt32(&message, &field, options.*member); }
  void operator()(bool Options::*member) const { reflection.SetBool(&message, &field, options.*member); }
  void operator()(std::vector<std::string> Options::*member) const {
    for (const std::string& value : options.*member) reflection.AddString(&message, &field, value);
  }
  void operator()(std::vector<std::int64_t> Options::*member) const {
    for (const std::int64_t value : options.*member) reflection.AddInt64(&message, &field, value);
  }
  void operator()(std::vector<double> Options::*member) const {
    for (const double value : options.*member) reflection.AddDouble(&message, &field, value);
  }
  void operator()(const ChoiceMember& member) const {
    reflection.SetEnumValue(&message, &field, member.get(options) + 1);
  }
  void operator()(TargetField Options::*member) const {
    const TargetField& from = options.*member;
    if (from.values.empty()) return;
    v1::TargetField& to = *message.mutable_target_field();
    to.set_per(from.per == Per::Cell ? v1::PER_CELL : v1::PER_VERTEX);
    to.set_components(from.components);
    to.mutable_numbers()->Assign(from.numbers.begin(), from.numbers.end());
    to.mutable_values()->Assign(from.values.begin(), from.values.end());
  }
};

/// Whether an option of the energy is said, even with its default.
bool names_energy(const v1::Options& message) {
  return std::ranges::any_of(option_table(), [&](const OptionInfo& option) {
    return is_of_energy(option) && v1::Options::GetReflection()->HasField(message, &field_of<v1::Options>(option.name));
  });
}

}  // namespace

Answer<Options> options_from(const v1::Options& message) {
  auto options = read_all(option_table(), message);
  if (options && options->objective == Objective::Auto && names_energy(message)) options->objective = Objective::Energy;
  return options;
}

Answer<GeometryOptions> options_from(const v1::Geometry& message) { return read_all(geometry_option_table(), message); }

Answer<LayerOptions> options_from(const v1::Layers& message) { return read_all(layer_option_table(), message); }

v1::Options to_proto(const Options& options) {
  v1::Options message;
  for (const OptionInfo& option : option_table()) {
    // To name an option of the energy would ask for the energy's optimum.
    if (options.objective == Objective::Auto && is_of_energy(option) && is_default(option, options)) continue;
    std::visit(ToMessage{options, field_of<v1::Options>(option.name), message}, option.member);
  }
  return message;
}

}  // namespace varimesh::server
