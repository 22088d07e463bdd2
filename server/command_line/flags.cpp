// Parses the command line of varimeshd.
#include "server/command_line/flags.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <utility>
#include <vector>

#include "core/base/machine_memory.h"
#include "core/base/version.h"
#include "core/options/nearest_word.h"
#include "server/command_line/configuration.h"
#include "server/command_line/help.h"
#include "server/command_line/settings.h"
#include "server/command_line/token_command.h"
#include "server/maintenance/commands.h"

namespace varimesh::server {
namespace {

/// Returns the message about the first word that is not a flag of the program or its subcommand.
std::string message_about_unknown_word(const CLI::App& app) {
  const std::string first = app.remaining(true).front();
  const std::string word = first.substr(0, first.find('='));
  const bool is_option = word.starts_with("-");
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options())
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  if (!is_option)
    for (const CLI::App* command : app.get_subcommands({})) names.push_back(command->get_name());
  const std::string meant = varimesh::nearest_word(word, names);
  return std::string("there is no ") + (is_option ? "option '" : "subcommand '") + word + "'" +
         (meant.empty() ? "; varimeshd --help lists all options." : "; did you mean '" + meant + "'?");
}

/// The options of the program, and where their values go.
struct Program {
  explicit Program(int* exit_status) {
    Limits& limits = flags.options.limits;
    limits.reserve_bytes = std::int64_t{64} << 20;
    limits.max_memory_bytes = machine_memory();
    limits.max_job_iterations = 100'000;
    limits.max_job_seconds = 7 * 24 * 3600;
    limits.max_priority = 100;

    describe_commands(app);
    app.set_help_flag("-h,--help", "Print this help and exit");
    app.set_version_flag("--version", std::string(version()), "Print the version and exit");
    app.add_option(
        "--config", config,
        "File with settings, one 'key = value' each, with the names of these options without dashes. Options "
        "and the environment variables VARIMESHD_KEY (such as VARIMESHD_MAX_PRIORITY) override the file "
        "(default: the environment variable VARIMESHD_CONFIG)");
    app.add_flag("--print-config", print_config, "Print all settings, with where they come from, and end");
    put_under(app, "Help and settings");
    add_connection_flags(app, flags);
    put_under(app, "Addresses, callers and the log");
    app.add_option(
           "--watchdog-seconds", units.watchdog_seconds,
           "If the server's own calls get no answer for this many seconds, the server ends with status 1, so that it "
           "can be started again; 0: never")
        ->capture_default_str()
        ->check(CLI::Range(0.0, 86400.0));
    add_resource_flags(app, flags);
    put_under(app, "Running jobs");
    add_webhook_flags(app, flags.options.webhooks, units);
    put_under(app, "Calls at the end of jobs");
    add_queue_flags(app, limits);
    put_under(app, "Limits of jobs and callers");
    add_state_flags(app, flags.options, units);
    put_under(app, "What is kept, and for how long");
    add_database_flags(app, flags, units);
    put_under(app, "Several servers with one database");
    app.add_option("--drain-seconds,--drain-timeout", flags.drain_seconds,
                   "Seconds that the running jobs may take to end when the server stops")
        ->capture_default_str()
        ->check(CLI::NonNegativeNumber);
    put_under(app, "Running jobs");
    token_command = &add_token_command(app, exit_status);
    add_help(app);
    let_later_values_win(app);
  }

  void parse(std::vector<std::string> words) {
    std::ranges::reverse(words);  // as CLI11 wants them
    app.parse(std::move(words));
  }
  /// Converts the values with other units.
  void finish() {
    Limits& limits = flags.options.limits;
    limits.checkpoint_pause = std::chrono::milliseconds(static_cast<int>(1000 * units.checkpoint_seconds));
    limits.watchdog = std::chrono::milliseconds(static_cast<int>(1000 * units.watchdog_seconds));
    flags.options.webhooks.first_pause = std::chrono::milliseconds(static_cast<int>(1000 * units.webhook_seconds));
    limits.lease = std::chrono::milliseconds(static_cast<int>(1000 * units.lease_seconds));
    limits.mesh_lifetime = std::chrono::hours(units.mesh_lifetime_hours);
    limits.min_ended_age = std::chrono::minutes(units.ended_minutes);
    limits.max_ended_age = std::chrono::hours(units.most_ended_hours);
    limits.compress_after = std::chrono::minutes(units.compress_minutes);
  }

  Flags flags;
  Units units;
  CLI::App app{"Serves mesh optimisation over gRPC (package varimesh.v1)."};
  std::string config;
  bool print_config = false;
  CLI::App* token_command = nullptr;
};

/// Why these settings cannot be used without any others; empty: they can.
std::string fault_of(const std::vector<std::string>& words) {
  int ignored = 0;
  Program program(&ignored);
  try {
    program.parse(words);
  } catch (const CLI::ParseError& error) {
    return error.what();
  }
  return {};
}

/// Gathers the settings of the file and the environment, and checks each of both. Prints what is wrong with them.
std::optional<GivenSettings> gather(const CLI::App& app, int argc, char** argv) {
  auto given = gather_settings(app, argc, argv);
  if (!given) {
    std::cerr << "varimeshd: " << given.error().sentence << '\n';
    return std::nullopt;
  }
  for (const auto& [where, words] : {std::pair{"In the configuration file '" + given->file + "': ", &given->from_file},
                                     {std::string("In the environment: "), &given->from_environment}})
    if (const std::string fault = fault_of(*words); !fault.empty()) {
      std::cerr << "varimeshd: " << where << fault << '\n';
      return std::nullopt;
    }
  return std::move(*given);
}

}  // namespace

std::optional<Flags> parse_flags(int argc, char** argv, int* exit_status) {
  Program program(exit_status);
  program.app.name(argv[0]);
  const auto given = gather(program.app, argc, argv);
  if (!given) {
    *exit_status = 2;
    return std::nullopt;
  }
  try {
    program.parse(given->all());
    if (program.token_command->parsed()) return std::nullopt;
    for (const char* const command : {"check", "backup"})
      if (program.app.got_subcommand(command)) {
        std::cerr << "varimeshd: write the options of " << command << " behind it: varimeshd " << command
                  << " --state DIR\n";
        *exit_status = 2;
        return std::nullopt;
      }
  } catch (const CLI::ExtrasError&) {
    const CLI::App& used = program.token_command->parsed() ? *program.token_command : program.app;
    std::cerr << "varimeshd: " << message_about_unknown_word(used) << '\n';
    *exit_status = 2;
    return std::nullopt;
  } catch (const CLI::ParseError& error) {
    *exit_status = program.app.exit(error) == 0 ? 0 : 2;
    return std::nullopt;
  }
  if (const std::string text = asked_text(program.app); !text.empty()) {
    std::cout << text;
    return std::nullopt;
  }
  if (program.print_config) {
    std::cout << print_settings(program.app, *given);
    return std::nullopt;
  }
  program.finish();
  return std::move(program.flags);
}

}  // namespace varimesh::server
