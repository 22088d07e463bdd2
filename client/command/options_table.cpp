// The table, and flags from it by the message's own description.
#include "client/command/options_table.h"

#include <array>
#include <cassert>

#include "client/command/names.h"

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
    OptionRow{"constants", "Where mu, lambda and kappa come from; default reference"},
    OptionRow{"mu", "Shear modulus; 0: from --constants"},
    OptionRow{"lambda", "First Lamé constant; 0: from --constants"},
    OptionRow{"kappa", "Bulk modulus; 0: from --constants"},
    OptionRow{"regularisation", "One δ an element or a node's patch; default element"},
    OptionRow{"method", "How the energy is minimised; default auto: sweeps, then Newton"},
    OptionRow{"colouring", "What moves together in a sweep; default group"},
    OptionRow{"tolerance", "Stop at this residual, relative to the mesh's size; default 1e-6"},
    OptionRow{"max_iterations", "Stop after this many; default 1000; 0 checks and reports only"},
    OptionRow{"threads", "Threads to use; 0: all. The result does not depend on it"},
    OptionRow{"quadrature_degree", "Degree integrated exactly; 0: twice the order"},
};

void add_enum(CLI::App& command, const std::string& flag, const FieldDescriptor& field, const OptionRow& row,
              v1::Options* options) {
  command
      .add_option_function<std::string>(
          flag,
          [options, &field](const std::string& name) {
            const auto* value = value_of(*field.enum_type(), name);
            if (value == nullptr) {
              std::string known;
              for (const std::string& one : spellings(*field.enum_type())) known += (known.empty() ? "" : ", ") + one;
              throw CLI::ValidationError("--" + dashed(field.name()),
                                         "there is no '" + name + "'; take one of " + known);
            }
            options->GetReflection()->SetEnum(options, &field, value);
          },
          std::string(row.help))
      ->type_name([&field] {
        std::string names;
        for (const std::string& one : spellings(*field.enum_type())) names += (names.empty() ? "" : "|") + one;
        return names;
      }());
}

}  // namespace

std::span<const OptionRow> option_rows() { return kRows; }

void add_options(CLI::App& command, v1::Options* options) {
  for (const OptionRow& row : kRows) {
    const FieldDescriptor* field = v1::Options::descriptor()->FindFieldByName(std::string(row.field));
    assert(field != nullptr);
    const std::string flag = "--" + dashed(std::string(row.field));
    const auto* reflection = options->GetReflection();
    switch (field->cpp_type()) {
      case FieldDescriptor::CPPTYPE_ENUM:
        add_enum(command, flag, *field, row, options);
        break;
      case FieldDescriptor::CPPTYPE_DOUBLE:
        command.add_option_function<double>(
            flag, [=](double value) { reflection->SetDouble(options, field, value); }, std::string(row.help));
        break;
      case FieldDescriptor::CPPTYPE_INT32:
        command.add_option_function<int>(
            flag, [=](int value) { reflection->SetInt32(options, field, value); }, std::string(row.help));
        break;
      default:
        assert(!"an option of a type that has no flag");
    }
  }
}

}  // namespace varimesh::client
