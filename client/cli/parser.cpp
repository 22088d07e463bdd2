#include "client/cli/parser.h"

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <type_traits>

#include "client/cli/help.h"
#include "client/cli/refusals.h"
#include "client/process/exit_status.h"
#include "core/base/utf8.h"

namespace varimesh::client {
namespace {

std::string refusal_unless_utf8(const std::string& value) {
  return is_utf8(value) ? ""
                        : "'" + as_utf8(value) +
                              "' is not UTF-8 and cannot be sent; a physical group can also be named by its tag.";
}

/// The parser's ranges let NaN pass. The text is that of its ranges.
std::string refuse_nan(const std::string& value) {
  return std::isnan(std::strtod(value.c_str(), nullptr)) ? "Value " + value + " not in range 0 to 1e308" : "";
}

std::string name_standard_input(std::string& value) {
  if (value == "-") value = "/dev/stdin";
  return "";
}

std::string name_standard_output(std::string& value) {
  if (value == "-") value = "/dev/stdout";
  return "";
}

/// Prints what is wrong with the command line and where to find help.
int refuse(const CLI::App& app, const CLI::ParseError& error, const std::vector<std::string>& words) {
  const std::string unknown = unknown_word(app, words);
  const auto used = app.get_subcommands();
  std::cerr << "varimesh: " << (unknown.empty() ? refusal_text(app, error) : unknown) << "\nvarimesh "
            << (used.empty() ? "" : used.front()->get_name() + " ") << "--help shows examples"
            << (!used.empty() && has_brief_help(used.front()->get_name()) ? ", and --help-all all options."
                                                                          : " and all options.")
            << std::endl;
  return kUsage;
}

}  // namespace

Flag& Flag::value(const std::string& placeholder) {
  option_->type_name(placeholder);
  return *this;
}

Flag& Flag::help(const std::string& text) {
  option_->description(text);
  return *this;
}

Flag& Flag::group(const std::string& heading) {
  option_->group(heading);
  return *this;
}

Flag& Flag::required() {
  option_->required();
  return *this;
}

Flag& Flag::needs(const std::string& other) {
  option_->needs(other);
  return *this;
}

Flag& Flag::excludes(const std::string& other) {
  option_->excludes(other);
  return *this;
}

Flag& Flag::from_environment(const std::string& variable) {
  option_->envname(variable);
  return *this;
}

Flag& Flag::one_value_each() {
  option_->allow_extra_args(false);
  return *this;
}

Flag& Flag::shows_default() {
  option_->capture_default_str();
  return *this;
}

Flag& Flag::from(int least, int most) {
  option_->check(CLI::Range(least, most));
  return *this;
}

Flag& Flag::from(double least, double most) {
  option_->check(CLI::Range(least, most))->check(refuse_nan);
  return *this;
}

Flag& Flag::positive() {
  option_->check(CLI::PositiveNumber)->check(refuse_nan);
  return *this;
}

Flag& Flag::not_negative() {
  option_->check(CLI::NonNegativeNumber)->check(refuse_nan);
  return *this;
}

Flag& Flag::one_of(const std::vector<std::string>& words) {
  option_->check(CLI::IsMember(words));
  return *this;
}

Flag& Flag::utf8() {
  option_->check(CLI::Validator(refusal_unless_utf8, "", "text"));
  return *this;
}

Flag& Flag::or_standard_input() {
  option_->transform(CLI::Validator(name_standard_input, "", "file"));
  return *this;
}

Flag& Flag::or_standard_output() {
  option_->transform(CLI::Validator(name_standard_output, "", "file"));
  return *this;
}

void Command::describe(const std::string& name, const std::string& purpose, const std::string& version) {
  app_->name(name);
  app_->description(purpose);
  app_->formatter(std::make_shared<Help>());
  app_->set_help_flag("-h,--help", "Print this help and exit");
  app_->set_version_flag("--version", version, "Print the version and exit");
  app_->require_subcommand(1);
}

Command Command::add_command(const std::string& name, const std::string& purpose) {
  CLI::App& command = *app_->add_subcommand(name, purpose);
  if (has_brief_help(name)) command.set_help_all_flag("--help-all", "Print the help with all options and exit");
  return command;
}

void Command::alias(const std::string& name) { app_->alias(name); }

Flag Command::add(const std::string& names, const Target& target, const std::string& help) {
  return Flag(std::visit(
      [&](const auto& to) {
        using To = std::decay_t<decltype(to)>;
        if constexpr (std::is_same_v<To, bool*>)
          return app_->add_flag(names, *to, help);
        else if constexpr (std::is_pointer_v<To>)
          return app_->add_option(names, *to, help);
        else
          return app_->add_option_function<std::string>(names, to, help);
      },
      target));
}

Flag Command::operator[](const std::string& name) const { return Flag(app_->get_option(name)); }

void Command::at_end(const std::function<Expected<void>()>& check) {
  app_->final_callback([check] {
    if (const auto fine = check(); !fine) throw CLI::ValidationError(fine.error().sentence);
  });
}

int run_command_line(int argc, char** argv, const std::function<Actions(Command)>& add) {
  CLI::App app;
  const Actions actions = add(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    return refuse(app, error, {argv + 1, argv + argc});
  }
  for (const auto& [name, action] : actions)
    if (app.got_subcommand(name)) return action();
  return kJobFailed;
}

}  // namespace varimesh::client
