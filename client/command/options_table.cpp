// The table, and flags from it by the message's own description.
#include "client/command/options_table.h"

#include <array>
#include <cassert>

#include "client/client.h"
#include "client/command/command.h"
#include "client/command/names.h"
#include "client/input_file.h"
#include "core/base/nearest_word.h"
#include "core/problem/target_field.h"

namespace varimesh::client {
namespace {

using google::protobuf::FieldDescriptor;

constexpr std::array kRows{
    OptionRow{"energy", "What is minimised; default hyperelastic"},
    OptionRow{"strain",
              "Strain of the linear elastic energy; default green-lagrange. With small strain the result "
              "depends on how the mesh is rotated"},
    OptionRow{"volumetric",
              "Volumetric part of the linear elastic energy; default log. trace has no barrier and cannot "
              "keep a mesh valid"},
    OptionRow{"winslow", "Form of the Winslow energy in 3-D; default true"},
    OptionRow{"constants", "Where mu, lambda and kappa come from; default standard"},
    OptionRow{"mu", "Shear modulus; 0: from --constants"},
    OptionRow{"lambda", "First Lamé constant; 0: from --constants"},
    OptionRow{"kappa", "Bulk modulus; 0: from --constants"},
    OptionRow{"regularisation", "One δ an element or a node's patch; default element"},
    OptionRow{"method", "How the energy is minimised; default auto: sweeps, then Newton"},
    OptionRow{"colouring", "What moves together in a sweep; default group"},
    OptionRow{"active_set", "Whether sweeps pass over nodes that are at rest; default on"},
    OptionRow{"tolerance", "Stop at this residual, relative to the mesh's size; default 1e-6"},
    OptionRow{"max_iterations", "Stop after this many; default 1000; 0 checks and reports only"},
    OptionRow{"until",
              "valid: stop as soon as every element is certified valid, named unrepairable, or ten iterations "
              "bring no more; default tolerance"},
    OptionRow{"repair",
              "What is done about elements that no movement of nodes can repair; default report: name them and keep "
              "them out of the others' way. split gives tetrahedra new nodes, straighten straight sides; none treats "
              "them like any other"},
    OptionRow{"until_js", "Stop when this scaled Jacobian is proved for every element, and return the best mesh"},
    OptionRow{"time_limit", "Stop after so many seconds, at the end of an iteration; 0: never"},
    OptionRow{"threads", "Threads to use; 0: all. The result does not depend on it"},
    OptionRow{"quadrature_degree", "Degree integrated exactly; 0: twice the order"},
    OptionRow{"objective",
              "worst: raise the lowest scaled Jacobian as far as it goes, at two to twenty times the cost; default "
              "energy"},
    OptionRow{"p_norm", "Sum the cells' mean energies to this power; default 1; more presses on the worst"},
    OptionRow{"order", "Raise or lower the mesh to this order on the way in; 0: as it is"},
    OptionRow{"target", "What each cell would like to be; default straight-sided. size and strain want --target-field"},
    OptionRow{"target_field",
              "Sizes, metrics or strains: a first line 'elements' or 'nodes', then a line 'number value' each, "
              "or 'number xx xy yy [xz yz zz]'"},
    OptionRow{"fix", "Physical group whose nodes stay, by name, tag or dimension:tag; may be repeated"},
    OptionRow{"free", "Group of interface elements whose nodes may move; may be repeated"},
    OptionRow{"fix_nodes", "Numbers of nodes that stay, with the edge or face they lie in"},
    OptionRow{"free_nodes", "Numbers of nodes that may move, likewise"},
    OptionRow{"region_below", "Move nodes only near cells with a scaled Jacobian below this; 0: everywhere"},
    OptionRow{"rings", "With --region-below, layers of cells around those; default 2"},
};

/// What may have been meant by a value that does not exist.
std::string meant(const std::string& name, const google::protobuf::EnumDescriptor& type) {
  const auto known = spellings(type);
  std::string list;
  for (const std::string& one : known) list += (list.empty() ? "" : ", ") + one;
  const std::string near = nearest_word(name, known);
  return (near.empty() ? "" : "did you mean '" + near + "'? There are ") + (near.empty() ? "take one of " : "") + list +
         ".";
}

void add_enum(CLI::App& command, const std::string& flag, const FieldDescriptor& field, const OptionRow& row,
              v1::Options* options) {
  command
      .add_option_function<std::string>(
          flag,
          [options, &field](const std::string& name) {
            const auto* value = value_of(*field.enum_type(), name);
            if (value == nullptr) {
              throw CLI::ValidationError("--" + dashed(field.name()),
                                         "there is no '" + name + "'; " + meant(name, *field.enum_type()));
            }
            v1::Options::GetReflection()->SetEnum(options, &field, value);
          },
          std::string(row.help))
      ->type_name([&field] {
        std::string names;
        for (const std::string& one : spellings(*field.enum_type())) names += (names.empty() ? "" : "|") + one;
        return names;
      }());
}

/// Group names and node numbers; the flag may be repeated.
void add_list(CLI::App& command, const std::string& flag, const FieldDescriptor* field, const OptionRow& row,
              v1::Options* options) {
  const auto* reflection = v1::Options::GetReflection();
  if (field->cpp_type() == FieldDescriptor::CPPTYPE_STRING)
    command
        .add_option_function<std::vector<std::string>>(
            flag,
            [=](const std::vector<std::string>& groups) {
              for (const std::string& group : groups) reflection->AddString(options, field, group);
            },
            std::string(row.help))
        ->type_name("GROUP")
        ->check(is_text())
        ->allow_extra_args(false);
  else
    command
        .add_option_function<std::vector<std::int64_t>>(
            flag,
            [=](const std::vector<std::int64_t>& numbers) {
              for (const std::int64_t number : numbers) reflection->AddInt64(options, field, number);
            },
            std::string(row.help))
        ->type_name("N,N,…")
        ->delimiter(',')
        ->allow_extra_args(false);
}

/// The field comes from a file, read and checked when the flag is.
void add_target_field(CLI::App& command, const std::string& flag, const OptionRow& row, v1::Options* options) {
  command
      .add_option_function<std::string>(
          flag,
          [=](const std::string& path) {
            const auto text = read_whole(path, [] { return interrupts() > 0; });
            if (!text) throw CLI::ValidationError(flag, text.error().sentence);
            const auto field = read_target_field(*text);
            if (!field) throw CLI::ValidationError(flag, path + ": " + field.error().sentence);
            v1::TargetField& message = *options->mutable_target_field();
            message.set_per(field->per == Per::Cell ? v1::PER_CELL : v1::PER_VERTEX);
            message.set_components(field->components);
            message.mutable_numbers()->Assign(field->numbers.begin(), field->numbers.end());
            message.mutable_values()->Assign(field->values.begin(), field->values.end());
          },
          std::string(row.help))
      ->type_name("FILE");
}

void add_one(CLI::App& command, const OptionRow& row, v1::Options* options) {
  const FieldDescriptor* field = v1::Options::descriptor()->FindFieldByName(std::string(row.field));
  assert(field != nullptr);
  const std::string flag = "--" + dashed(std::string(row.field));
  const auto* reflection = v1::Options::GetReflection();
  if (field->is_repeated()) return add_list(command, flag, field, row, options);
  switch (field->cpp_type()) {
    case FieldDescriptor::CPPTYPE_ENUM:
      add_enum(command, flag, *field, row, options);
      break;
    case FieldDescriptor::CPPTYPE_DOUBLE:
      command.add_option_function<double>(
          flag, [=](double value) { reflection->SetDouble(options, field, value); }, std::string(row.help));
      break;
    case FieldDescriptor::CPPTYPE_BOOL:
      command
          .add_option_function<std::string>(
              flag, [=](const std::string& value) { reflection->SetBool(options, field, value == "on"); },
              std::string(row.help))
          ->check(CLI::IsMember({"on", "off"}))
          ->type_name("on|off");
      break;
    case FieldDescriptor::CPPTYPE_INT32:
      command.add_option_function<int>(
          flag, [=](int value) { reflection->SetInt32(options, field, value); }, std::string(row.help));
      break;
    case FieldDescriptor::CPPTYPE_MESSAGE:
      add_target_field(command, flag, row, options);
      break;
    default:
      assert(!"an option of a type that has no flag");
  }
}

}  // namespace

std::span<const OptionRow> option_rows() { return kRows; }

void add_options(CLI::App& command, v1::Options* options) {
  for (const OptionRow& row : kRows) {
    add_one(command, row, options);
    command.get_option("--" + dashed(std::string(row.field)))->group("Optimisation");
  }
}

}  // namespace varimesh::client
