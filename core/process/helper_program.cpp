#include "core/process/helper_program.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <string_view>
#include <system_error>

namespace varimesh {
namespace {

namespace fs = std::filesystem;

/// What a helper has of this process's environment: secrets of the caller are none of its business.
std::vector<std::string> environment_for(const HelperStart& start) {
  std::vector<std::string> kept = start.environment;
  for (const char* name : {"LD_LIBRARY_PATH", "TMPDIR", "ASAN_OPTIONS", "UBSAN_OPTIONS", "TSAN_OPTIONS"})
    if (const char* value = std::getenv(name)) kept.push_back(std::string(name) + "=" + value);
  return kept;
}

std::vector<char*> pointers_to(std::vector<std::string>& words) {
  std::vector<char*> all;
  for (std::string& word : words) all.push_back(word.data());
  all.push_back(nullptr);
  return all;
}

}  // namespace

std::string find_helper(const char* name, const char* variable) {
  std::error_code none;
  if (const char* named = std::getenv(variable); named != nullptr && *named != '\0')
    return fs::is_regular_file(named, none) ? named : "";
  const fs::path own = fs::read_symlink("/proc/self/exe", none);
  if (own.empty()) return "";
  for (const fs::path& folder : {own.parent_path(), own.parent_path().parent_path() / "lib" / "varimesh"})
    if (fs::is_regular_file(folder / name, none)) return (folder / name).string();
  return "";
}

Helper start_helper(const HelperStart& start) {
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  // Higher numbers first, so that none takes another's place.
  Helper helper;
  std::vector<int> copies;
  for (const int file : start.files) {
    copies.push_back(::fcntl(file, F_DUPFD_CLOEXEC, 16));
    if (copies.back() < 0) helper.error = errno;
  }
  for (std::size_t i = 0; i < copies.size(); ++i)
    posix_spawn_file_actions_adddup2(&files, copies[i], 3 + static_cast<int>(i));
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none, defaults;
  sigemptyset(&none);
  sigfillset(&defaults);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &defaults);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
  std::vector<std::string> words = start.arguments, environment = environment_for(start);
  words.insert(words.begin(), start.program);
  if (helper.error == 0)
    helper.error = posix_spawn(&helper.id, start.program.c_str(), &files, &attributes, pointers_to(words).data(),
                               pointers_to(environment).data());
  if (helper.error != 0) helper.id = -1;
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&files);
  for (const int copy : copies)
    if (copy >= 0) ::close(copy);
  return helper;
}

int end_helper(pid_t id, bool kills) {
  if (kills) ::kill(id, SIGKILL);
  int status = 0;
  while (::waitpid(id, &status, 0) < 0 && errno == EINTR) {
  }
  return status;
}

}  // namespace varimesh
