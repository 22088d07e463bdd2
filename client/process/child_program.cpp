#include "client/process/child_program.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <sstream>
#include <thread>

#include "client/process/interrupts.h"
#include "core/base/stopwatch.h"

namespace varimesh::client {
namespace {

constexpr auto kBetweenLooks = std::chrono::milliseconds(20);

/// Starts the program. Returns 0 or an error number.
int start(const std::string& path, std::vector<std::string> arguments, const std::string& log, pid_t* child) {
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  posix_spawn_file_actions_adddup2(&files, STDOUT_FILENO, STDERR_FILENO);
  // This process blocks the signals of an interrupt; the program shall not.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none, defaults;
  sigemptyset(&none);
  sigemptyset(&defaults);
  sigaddset(&defaults, SIGPIPE);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &defaults);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  arguments.insert(arguments.begin(), path);
  std::vector<char*> words;
  for (std::string& argument : arguments) words.push_back(argument.data());
  words.push_back(nullptr);
  const int error = posix_spawn(child, path.c_str(), &files, &attributes, words.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&files);
  return error;
}

}  // namespace

std::string find_program(const std::string& name) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "/usr/bin:/bin" : path);
  for (std::string folder; std::getline(folders, folder, ':');) {
    const std::filesystem::path file = std::filesystem::path(folder.empty() ? "." : folder) / name;
    std::error_code ignored;
    if (std::filesystem::is_regular_file(file, ignored) && ::access(file.c_str(), X_OK) == 0) return file.string();
  }
  return "";
}

ProgramEnd run_program(const std::string& path, const std::vector<std::string>& arguments,
                       const std::filesystem::path& log, const Meanwhile& meanwhile) {
  const Stopwatch watch;
  double called = 0;
  pid_t child = 0;
  if (const int error = start(path, arguments, log.string(), &child); error != 0)
    return {ProgramEnd::Way::NotStarted, error};
  int status = 0;
  while (true) {
    const bool is_interrupted = interrupted();
    const bool ends = is_interrupted || (meanwhile.most_seconds > 0 && watch.seconds() >= meanwhile.most_seconds);
    if (ends) ::kill(child, meanwhile.end_signal);
    const pid_t ended = ::waitpid(child, &status, ends ? 0 : WNOHANG);
    if (ended == child && ends) return {is_interrupted ? ProgramEnd::Way::Interrupted : ProgramEnd::Way::TimeIsOver, 0};
    if (ended == child) break;
    if (meanwhile.on_second && watch.seconds() >= called + meanwhile.seconds_between) {
      called = watch.seconds();
      meanwhile.on_second();
    }
    std::this_thread::sleep_for(kBetweenLooks);
  }
  if (WIFSIGNALED(status)) return {ProgramEnd::Way::Signalled, WTERMSIG(status)};
  return {ProgramEnd::Way::Exited, WEXITSTATUS(status)};
}

}  // namespace varimesh::client
