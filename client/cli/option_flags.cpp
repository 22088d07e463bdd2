#include "client/cli/option_flags.h"

#include <CLI/CLI.hpp>
#include <cassert>

#include "client/cli/names.h"
#include "client/cli/refusals.h"
#include "client/client.h"
#include "client/library/input_file.h"
#include "client/process/interrupts.h"
#include "core/options/option_table.h"
#include "core/problem/target_field.h"
#include "core/reference/shape.h"

namespace varimesh::client {
namespace {

using google::protobuf::FieldDescriptor;

void add_enum(CLI::App& command, const std::string& flag, const FieldDescriptor& field, const OptionInfo& option,
              v1::Options* options) {
  command
      .add_option_function<std::string>(
          flag,
          [options, &field](const std::string& name) {
            const auto* value = value_of(*field.enum_type(), name);
            if (value == nullptr) {
              throw CLI::ValidationError("--" + dashed(field.name()),
                                         no_such_word(name, spellings(*field.enum_type())));
            }
            v1::Options::GetReflection()->SetEnum(options, &field, value);
          },
          help_text(option))
      ->type_name(joined(spellings(*field.enum_type()), "|"));
}

/// A flag without a value that says on, and one that says off.
void add_switch(CLI::App& command, const std::string& flag, const FieldDescriptor* field, const OptionInfo& option,
                v1::Options* options) {
  const std::string names = flag + ",!--" + dashed(std::string(option.opposite));  // CLI11 counts down at the second
  command.add_flag_function(
      names, [=](std::int64_t count) { v1::Options::GetReflection()->SetBool(options, field, count > 0); },
      help_text(option));
}

/// A flag for the names of groups, or for the numbers of nodes. It may be repeated.
void add_list(CLI::App& command, const std::string& flag, const FieldDescriptor* field, const OptionInfo& option,
              v1::Options* options) {
  const auto* reflection = v1::Options::GetReflection();
  if (field->cpp_type() == FieldDescriptor::CPPTYPE_STRING)
    Flag(command.add_option_function<std::vector<std::string>>(
             flag,
             [=](const std::vector<std::string>& groups) {
               for (const std::string& group : groups) reflection->AddString(options, field, group);
             },
             help_text(option)))
        .value("GROUP")
        .utf8()
        .one_value_each();
  else
    command
        .add_option_function<std::vector<std::int64_t>>(
            flag,
            [=](const std::vector<std::int64_t>& numbers) {
              for (const std::int64_t number : numbers) reflection->AddInt64(options, field, number);
            },
            help_text(option))
        ->type_name("N,N,…")
        ->delimiter(',')
        ->allow_extra_args(false);
}

/// A flag for a file with a target field. The file is read and checked when the flag is parsed.
void add_target_field(CLI::App& command, const std::string& flag, const OptionInfo& option, v1::Options* options) {
  command
      .add_option_function<std::string>(
          flag,
          [=](const std::string& path) {
            const auto text = read_whole(path, interrupt_ends_calls);
            if (!text) throw CLI::ValidationError(flag, text.error().sentence);
            const auto field = read_target_field(*text);
            if (!field) throw CLI::ValidationError(flag, path + ": " + field.error().sentence);
            v1::TargetField& message = *options->mutable_target_field();
            message.set_per(field->per == Per::Cell ? v1::PER_CELL : v1::PER_VERTEX);
            message.set_components(field->components);
            message.mutable_numbers()->Assign(field->numbers.begin(), field->numbers.end());
            message.mutable_values()->Assign(field->values.begin(), field->values.end());
          },
          help_text(option))
      ->type_name("FILE");
}

void add_one(CLI::App& command, const OptionInfo& option, v1::Options* options) {
  const FieldDescriptor* field = v1::Options::descriptor()->FindFieldByName(std::string(option.name));
  assert(field != nullptr);
  const std::string flag = "--" + dashed(std::string(option.name));
  const auto* reflection = v1::Options::GetReflection();
  if (field->is_repeated()) return add_list(command, flag, field, option, options);
  if (!option.opposite.empty()) return add_switch(command, flag, field, option, options);
  switch (field->cpp_type()) {
    case FieldDescriptor::CPPTYPE_ENUM:
      add_enum(command, flag, *field, option, options);
      break;
    case FieldDescriptor::CPPTYPE_DOUBLE:
      command.add_option_function<double>(
          flag, [=](double value) { reflection->SetDouble(options, field, value); }, help_text(option));
      break;
    case FieldDescriptor::CPPTYPE_BOOL:
      command
          .add_option_function<std::string>(
              flag, [=](const std::string& value) { reflection->SetBool(options, field, value == "on"); },
              help_text(option))
          ->check(CLI::IsMember({"on", "off"}))
          ->type_name("on|off");
      break;
    case FieldDescriptor::CPPTYPE_INT32:
      command.add_option_function<int>(
          flag, [=](int value) { reflection->SetInt32(options, field, value); }, help_text(option));
      break;
    case FieldDescriptor::CPPTYPE_MESSAGE:
      add_target_field(command, flag, option, options);
      break;
    default:
      assert(!"this type of field has no flag");
  }
}

}  // namespace

std::string help_text(const OptionInfo& option) {
  const std::string text(option.help), usual = default_text(option);
  return usual.empty() || usual == "0" ? text : text + "; default " + usual;
}

void add_options(Command command, v1::Options* options) {
  for (const OptionInfo& option : option_table()) {
    add_one(command.app(), option, options);
    command["--" + dashed(std::string(option.name))].group("Optimisation");
  }
}

void require_curved_order(Command command) {
  command["--order"]
      .required()
      .from(2, kMaxOrder)
      .help("The order of the curved mesh, 2 to " + std::to_string(kMaxOrder));
}

}  // namespace varimesh::client
