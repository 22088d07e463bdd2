// Turns the file and the environment into arguments of the command line.
#include "server/command_line/configuration.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <functional>
#include <optional>
#include <sstream>
#include <string_view>
#include <utility>

#include "core/options/nearest_word.h"

namespace varimesh::server {
namespace {

constexpr std::string_view kPrefix = "VARIMESHD_";
/// Options of the command line that are no settings.
constexpr std::string_view kNoKeys[] = {"help", "version", "config", "print-config"};

bool is_key(const std::string& name) { return std::ranges::find(kNoKeys, name) == std::end(kNoKeys); }

std::vector<std::string> keys_of(const CLI::App& app) {
  std::vector<std::string> keys;
  for (const CLI::Option* option : app.get_options())
    for (const std::string& name : option->get_lnames())
      if (is_key(name)) keys.push_back(name);
  return keys;
}

std::string variable_of(const std::string& key) {
  std::string variable(kPrefix);
  for (const char c : key) variable += c == '-' ? '_' : static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return variable;
}

std::string key_of(std::string_view variable) {
  std::string key;
  for (const char c : variable.substr(kPrefix.size()))
    key += c == '_' ? '-' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return key;
}

tl::unexpected<Error> unknown_key(const std::string& where, const std::string& written, const std::string& key,
                                  const CLI::App& app, const std::function<std::string(const std::string&)>& spelled) {
  const std::string meant = nearest_word(key, keys_of(app));
  return bad_option(
      where + " '" + written + "', which is no setting of varimeshd" +
      (meant.empty() ? "; varimeshd --print-config lists all." : "; did you mean '" + spelled(meant) + "'?"));
}

/// Returns the value of --config; nothing if it is not given.
std::optional<std::string> config_argument(const CLI::App& app, const std::vector<std::string>& arguments) {
  std::optional<std::string> file;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& word = arguments[i];
    const auto commands = app.get_subcommands([&](const CLI::App* command) { return command->get_name() == word; });
    if (!commands.empty()) break;
    if (word == "--config" && i + 1 < arguments.size()) file = arguments[i + 1];
    if (word.starts_with("--config=")) file = word.substr(std::strlen("--config="));
  }
  return file;
}

std::string trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r"), last = text.find_last_not_of(" \t\r");
  return first == std::string_view::npos ? std::string() : std::string(text.substr(first, last - first + 1));
}

/// Takes the value that begins with a quotation mark off the text. Two marks stand for one in the value. Nothing if the
/// value has no end.
std::optional<std::string> take_quoted(std::string& text) {
  const char mark = text.front();
  std::string value;
  for (std::size_t i = 1; i < text.size(); ++i) {
    if (text[i] == mark && (i + 1 == text.size() || text[i + 1] != mark)) {
      text.erase(0, i + 1);
      return value;
    }
    if (text[i] == mark) ++i;
    value += text[i];
  }
  return std::nullopt;
}

/// Reads the key and the value of a line; both are empty in a line without a setting. Nothing if it is none.
std::optional<std::pair<std::string, std::string>> parse_line(const std::string& line) {
  const std::string text = trimmed(line);
  if (text.empty() || text.front() == '#') return std::pair<std::string, std::string>();
  const auto equals = text.find('=');
  if (equals == std::string::npos) return std::nullopt;
  const std::string key = trimmed(text.substr(0, equals));
  std::string rest = trimmed(text.substr(equals + 1));
  if (key.empty() || key.find_first_of(" \t\"'[]#") != std::string::npos) return std::nullopt;
  if (rest.empty() || (rest.front() != '"' && rest.front() != '\'')) {
    const std::string value = trimmed(rest.substr(0, rest.find(" #")));
    if (value.empty() || value.front() == '#' || value.find_first_of("\"'") != std::string::npos) return std::nullopt;
    return std::pair(key, value);
  }
  std::optional<std::string> value = take_quoted(rest);
  const std::string more = trimmed(rest);
  if (!value || (!more.empty() && more.front() != '#')) return std::nullopt;
  return std::pair(key, *std::move(value));
}

Expected<std::vector<std::string>> read_file(const CLI::App& app, const std::string& path) {
  std::ifstream file(path);
  std::stringstream text;
  errno = 0;
  if (!file || !(text << file.rdbuf())) {
    // A file without a byte in it sets nothing.
    if (file.is_open() && errno == 0) return std::vector<std::string>();
    return bad_option("The configuration file '" + path + "' cannot be read (" +
                      std::strerror(errno != 0 ? errno : EIO) + "); name another one with --config.");
  }
  const std::vector<std::string> keys = keys_of(app);
  std::vector<std::string> words;
  std::string line;
  for (int number = 1; std::getline(text, line); ++number) {
    const std::string where = "Line " + std::to_string(number) + " of '" + path + "'";
    const auto setting = parse_line(line);
    if (!setting) return bad_option(where + " cannot be understood; write key = value, or key = \"value\".");
    const auto& [key, value] = *setting;
    if (key.empty()) continue;
    if (std::ranges::find(keys, key) == keys.end())
      return unknown_key(where + " sets", key, key, app, [](const std::string& meant) { return meant; });
    words.push_back("--" + key + "=" + value);
  }
  return words;
}

/// Kubernetes gives every container variables with the addresses of all services, which begin like ours if a service is
/// called varimeshd: VARIMESHD_SERVICE_HOST, VARIMESHD_PORT_50051_TCP.
bool is_of_kubernetes(const std::string& key) {
  return std::getenv("KUBERNETES_SERVICE_HOST") != nullptr &&
         (key == "port" || key.starts_with("port-") || key.starts_with("service-"));
}

Expected<std::vector<std::string>> read_environment(const CLI::App& app) {
  std::vector<std::string> words;
  for (const CLI::Option* option : app.get_options()) {
    // An older name of the same variable.
    const char* const old = option->get_envname().empty() ? nullptr : std::getenv(option->get_envname().c_str());
    if (old != nullptr && *old != '\0') words.push_back("--" + option->get_lnames().front() + "=" + old);
  }
  const std::vector<std::string> keys = keys_of(app);
  for (char** one = environ; one != nullptr && *one != nullptr; ++one) {
    const std::string_view line = *one;
    const auto end = line.find('=');
    if (!line.starts_with(kPrefix) || end == std::string_view::npos || end + 1 == line.size()) continue;
    const std::string key = key_of(line.substr(0, end));
    if (key == "config") continue;
    const bool is_known = std::ranges::find(keys, key) != keys.end();
    if (!is_known && is_of_kubernetes(key)) continue;
    if (!is_known) return unknown_key("The environment has", std::string(line.substr(0, end)), key, app, variable_of);
    words.push_back("--" + key + "=" + std::string(line.substr(end + 1)));
  }
  return words;
}

/// Whether one of the words sets the option.
bool has(const std::vector<std::string>& words, const CLI::Option& option) {
  return std::ranges::any_of(words, [&](const std::string& word) {
    return std::ranges::any_of(option.get_lnames(), [&](const std::string& name) {
      return word == "--" + name || word.starts_with("--" + name + "=");
    });
  });
}

std::string in_quotes(const std::string& value) {
  if (!value.empty() && value.find_first_of(" \t\r#'\"[],=;") == std::string::npos) return value;
  const char mark = value.find('"') == std::string::npos ? '"' : '\'';
  std::string quoted(1, mark);
  for (const char c : value) quoted.append(c == mark ? 2 : 1, c);
  return quoted + mark;
}

}  // namespace

std::vector<std::string> GivenSettings::all() const {
  std::vector<std::string> words = from_file;
  words.insert(words.end(), from_environment.begin(), from_environment.end());
  words.insert(words.end(), from_command_line.begin(), from_command_line.end());
  return words;
}

void let_later_values_win(CLI::App& app) {
  for (CLI::Option* option : app.get_options())
    if (is_key(option->get_single_name())) option->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
}

Expected<GivenSettings> gather_settings(const CLI::App& app, int argc, const char* const* argv) {
  GivenSettings given;
  for (int i = 1; i < argc; ++i) given.from_command_line.emplace_back(argv[i]);
  const char* const variable = std::getenv("VARIMESHD_CONFIG");
  given.file = config_argument(app, given.from_command_line).value_or(variable == nullptr ? "" : variable);
  if (!given.file.empty()) {
    auto words = read_file(app, given.file);
    if (!words) return tl::unexpected(words.error());
    given.from_file = std::move(*words);
  }
  auto words = read_environment(app);
  if (!words) return tl::unexpected(words.error());
  given.from_environment = std::move(*words);
  for (const auto* const from : {&given.from_environment, &given.from_command_line})
    for (const std::string& word : *from)
      if (word.find('\n') != std::string::npos)
        return bad_option("The value in '" + word.substr(0, word.find_first_of("=\n")) +
                          "' has a line break, which no setting may have; take it out.");
  return given;
}

std::string print_settings(const CLI::App& app, const GivenSettings& given) {
  std::string text = "# The settings of varimeshd. Lines that begin with # are defaults.\n";
  for (const CLI::Option* option : app.get_options()) {
    const std::string key = option->get_single_name();
    if (!is_key(key)) continue;
    if (option->count() == 0) {
      std::string value = option->get_default_str();
      if (!value.empty()) value = in_quotes(value);
      text += "# " + key + " = " + (option->get_expected_max() == 0 ? "false" : value) + "\n";
      continue;
    }
    const std::string from = has(given.from_command_line, *option)  ? "the command line"
                             : has(given.from_environment, *option) ? "the environment"
                                                                    : "'" + given.file + "'";
    const bool is_flag = option->get_expected_max() == 0;
    const std::string value = !is_flag ? in_quotes(option->results().back()) : option->as<bool>() ? "true" : "false";
    text += key + " = " + value + "  # from " + from + "\n";
  }
  return text;
}

}  // namespace varimesh::server
