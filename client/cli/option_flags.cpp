#include "client/cli/option_flags.h"

#include <CLI/CLI.hpp>
#include <cassert>

#include "client/cli/names.h"
#include "client/cli/refusals.h"
#include "client/client.h"
#include "client/library/input_file.h"
#include "client/process/interrupts.h"
#include "core/command_line/facts.h"
#include "core/options/option_table.h"
#include "core/problem/target_field.h"
#include "core/reference/shape.h"

namespace varimesh::client {

template <class Of>
std::string flag_of(const OptionOf<Of>& option) {
  return "--" + dashed(std::string(option.flag.empty() ? option.name : option.flag));
}
template std::string flag_of(const OptionInfo&);
template std::string flag_of(const GeometryOption&);
template std::string flag_of(const LayerOption&);

namespace {

using google::protobuf::FieldDescriptor;

/// A flag and the field of a message that it sets.
struct FieldFlag {
  CLI::App& command;
  std::string name;
  const FieldDescriptor& field;
  std::string help;
  google::protobuf::Message* options;

  const google::protobuf::Reflection& reflection() const { return *options->GetReflection(); }
};

void add_enum(const FieldFlag& flag) {
  flag.command
      .add_option_function<std::string>(
          flag.name,
          [flag](const std::string& name) {
            const auto* value = value_of(*flag.field.enum_type(), name);
            if (value == nullptr)
              throw CLI::ValidationError(flag.name, no_such_word(name, spellings(*flag.field.enum_type())));
            flag.reflection().SetEnum(flag.options, &flag.field, value);
          },
          flag.help)
      ->type_name(joined(spellings(*flag.field.enum_type()), "|"));
}

/// A flag without a value that says on, and one that says off if there is an opposite.
void add_switch(const FieldFlag& flag, std::string_view opposite) {
  // CLI11 counts down at the second.
  const std::string names = flag.name + (opposite.empty() ? "" : ",!--" + dashed(std::string(opposite)));
  flag.command.add_flag_function(
      names, [flag](std::int64_t count) { flag.reflection().SetBool(flag.options, &flag.field, count > 0); },
      flag.help);
}

void add_on_off(const FieldFlag& flag) {
  flag.command
      .add_option_function<std::string>(
          flag.name,
          [flag](const std::string& value) { flag.reflection().SetBool(flag.options, &flag.field, value == "on"); },
          flag.help)
      ->check(CLI::IsMember({"on", "off"}))
      ->type_name("on|off");
}

/// A flag for the names of groups. It may be repeated.
void add_names(const FieldFlag& flag) {
  Flag(flag.command.add_option_function<std::vector<std::string>>(
           flag.name,
           [flag](const std::vector<std::string>& groups) {
             for (const std::string& group : groups) flag.reflection().AddString(flag.options, &flag.field, group);
           },
           flag.help))
      .value("GROUP")
      .utf8()
      .one_value_each();
}

/// A flag for the numbers of nodes. It may be repeated.
void add_numbers(const FieldFlag& flag) {
  flag.command
      .add_option_function<std::vector<std::int64_t>>(
          flag.name,
          [flag](const std::vector<std::int64_t>& numbers) {
            for (const std::int64_t number : numbers) flag.reflection().AddInt64(flag.options, &flag.field, number);
          },
          flag.help)
      ->type_name("N,N,…")
      ->delimiter(',')
      ->allow_extra_args(false);
}

/// A flag for numbers with commas between them. It may be repeated.
void add_lengths(const FieldFlag& flag) {
  flag.command
      .add_option_function<std::vector<double>>(
          flag.name,
          [flag](const std::vector<double>& values) {
            for (const double value : values) flag.reflection().AddDouble(flag.options, &flag.field, value);
          },
          flag.help)
      ->type_name("H,H,…")
      ->delimiter(',')
      ->allow_extra_args(false);
}

/// A flag for a file with a target field. The file is read and checked when the flag is parsed.
void add_target_field(const FieldFlag& flag) {
  flag.command
      .add_option_function<std::string>(
          flag.name,
          [flag](const std::string& path) {
            const auto text = read_whole(path, interrupt_ends_calls);
            if (!text) throw CLI::ValidationError(flag.name, text.error().sentence);
            const auto field = read_target_field(*text);
            if (!field) throw CLI::ValidationError(flag.name, path + ": " + field.error().sentence);
            auto& message =
                dynamic_cast<v1::TargetField&>(*flag.reflection().MutableMessage(flag.options, &flag.field));
            message.set_per(field->per == Per::Cell ? v1::PER_CELL : v1::PER_VERTEX);
            message.set_components(field->components);
            message.mutable_numbers()->Assign(field->numbers.begin(), field->numbers.end());
            message.mutable_values()->Assign(field->values.begin(), field->values.end());
          },
          flag.help)
      ->type_name("FILE");
}

/// The flag for an option of the struct `Of`, whose type says what it takes.
template <class Of>
struct AddFlag {
  const FieldFlag& flag;
  const OptionOf<Of>& option;

  void operator()(double Of::*) const {
    flag.command.add_option_function<double>(
        flag.name, [flag = flag](double value) { flag.reflection().SetDouble(flag.options, &flag.field, value); },
        flag.help);
  }
  void operator()(int Of::*) const {
    flag.command.add_option_function<int>(
        flag.name, [flag = flag](int value) { flag.reflection().SetInt32(flag.options, &flag.field, value); },
        flag.help);
  }
  void operator()(bool Of::*member) const { Of().*member ? add_on_off(flag) : add_switch(flag, option.opposite); }
  void operator()(std::vector<std::string> Of::*) const { add_names(flag); }
  void operator()(std::vector<std::int64_t> Of::*) const { add_numbers(flag); }
  void operator()(std::vector<double> Of::*) const { add_lengths(flag); }
  void operator()(const ChoiceOf<Of>&) const { add_enum(flag); }
  void operator()(TargetField Of::*) const { add_target_field(flag); }
};

template <class Of>
CLI::Option* add_one(CLI::App& command, const OptionOf<Of>& option, google::protobuf::Message* options) {
  const FieldDescriptor* field = options->GetDescriptor()->FindFieldByName(std::string(option.name));
  assert(field != nullptr);
  const FieldFlag flag{command, flag_of(option), *field, help_text(option), options};
  std::visit(AddFlag<Of>{flag, option}, option.member);
  return command.get_option(flag.name);
}

}  // namespace

template <class Of>
std::string help_text(const OptionOf<Of>& option) {
  const std::string text(option.help), usual = default_text(option);
  const bool is_said = usual.empty() || usual == "0" || usual == "off";
  return is_said ? text : text + "; default " + usual;
}
template std::string help_text(const OptionInfo&);
template std::string help_text(const GeometryOption&);
template std::string help_text(const LayerOption&);

void add_options(Command command, v1::Options* options) {
  for (const OptionInfo& option : option_table()) add_one(command.app(), option, options)->group("Optimisation");
}

void add_geometry_options(Command command, v1::Geometry* geometry, bool has_slide_on) {
  for (const GeometryOption& option : geometry_option_table()) {
    // --order is an option of the optimisation, which curve and mesh hand on.
    const bool is_left_out = option.name == "order" || (option.name == "slide_on" && !has_slide_on);
    if (!is_left_out) add_one(command.app(), option, geometry)->group("Geometry");
  }
}

void add_layer_options(Command command, v1::Layers* layers, bool has_spacing) {
  for (const LayerOption& option : layer_option_table())
    if (has_spacing || option.name != "spacing") add_one(command.app(), option, layers)->group("Layers");
}

void require_curved_order(Command command) {
  command["--order"]
      .required()
      .from(2, kMaxOrder)
      .help("The order of the curved mesh, 2 to " + std::to_string(kMaxOrder));
}

}  // namespace varimesh::client
