// The settings of varimeshd from a file and the environment: they are refused with a sentence, or printed as a file
// that sets the same. An input is lines of the environment, a line "--", and the file.
#include "server/command_line/configuration.h"

#include <sys/mman.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <map>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "tests/fuzz/program/memory.h"

namespace {

using namespace varimesh;
using namespace varimesh::server;

/// Options of all kinds that varimeshd has.
struct Program {
  Program() {
    app.add_option("--config", config, "");
    app.add_option("--listen", listen, "")->envname("VARIMESH_LISTEN");
    app.add_option("--max-priority", priority, "")->capture_default_str()->check(CLI::Range(-100, 100));
    app.add_option("--checkpoint-seconds", seconds, "")->capture_default_str()->check(CLI::Range(0.0, 30.0));
    app.add_option("--drain-seconds,--drain-timeout", drain, "")->check(CLI::NonNegativeNumber);
    app.add_option("--isolation", isolation, "")
        ->transform(CLI::CheckedTransformer(std::map<std::string, bool>{{"process", true}, {"none", false}}));
    app.add_flag("--insecure", insecure, "");
    let_later_values_win(app);
  }

  CLI::App app{"varimeshd"};
  std::string config, listen = "default";
  int priority = 100;
  double seconds = 5;
  int drain = 30;
  bool isolation = true, insecure = false;

  auto values() const { return std::tuple(listen, priority, seconds, drain, isolation, insecure); }

  /// Gathers and parses; what is printed, or nothing if a setting was refused.
  std::optional<std::string> read(const std::string& file) {
    const char* const arguments[] = {"varimeshd", "--config", file.c_str()};
    const auto given = gather_settings(app, 3, arguments);
    if (!given) {
      fuzz::expect(!given.error().sentence.empty(), "a refusal has no sentence");
      return std::nullopt;
    }
    std::vector<std::string> words = given->all();
    std::reverse(words.begin(), words.end());
    try {
      app.parse(words);
    } catch (const CLI::ParseError&) {
      return std::nullopt;
    }
    return print_settings(app, *given);
  }
};

/// A file without a name, which is closed at the end.
class File {
 public:
  explicit File(std::string_view text) : file_(::memfd_create("settings", MFD_CLOEXEC)) {
    fuzz::expect(file_ >= 0 && ::write(file_, text.data(), text.size()) == static_cast<ssize_t>(text.size()),
                 "no file");
  }
  ~File() { ::close(file_); }
  std::string path() const { return "/proc/self/fd/" + std::to_string(file_); }

 private:
  const int file_;
};

/// Sets the environment to these lines until it is destroyed.
class Environment {
 public:
  explicit Environment(const std::string& text) : before_(environ) {
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);)
      if (line.find('=') != std::string::npos && line.find('\0') == std::string::npos) lines_.push_back(line);
    for (std::string& line : lines_) pointers_.push_back(line.data());
    pointers_.push_back(nullptr);
    environ = pointers_.data();
  }
  ~Environment() { environ = before_; }

 private:
  char** const before_;
  std::vector<std::string> lines_;
  std::vector<char*> pointers_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string input(reinterpret_cast<const char*>(data), size);
  const std::size_t cut = input.find("--\n");
  const std::string variables = cut == input.npos ? "" : input.substr(0, cut);
  const std::string text = cut == input.npos ? input : input.substr(cut + 3);
  Program first, second;
  std::optional<std::string> printed;
  {
    const Environment environment(variables);
    const File file(text);
    printed = first.read(file.path());
  }
  if (!printed) return 0;
  const Environment empty("");
  const File file(*printed);
  fuzz::expect(second.read(file.path()).has_value(), "what was printed cannot be read");
  fuzz::expect(first.values() == second.values(), "what was printed sets something else");
  return 0;
}
