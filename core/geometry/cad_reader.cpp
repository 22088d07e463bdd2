#include "core/geometry/cad_reader.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <system_error>

#include "core/base/machine_memory.h"

namespace varimesh::geometry {
namespace {

/// Most seconds of processor time for a file. One of 100 MB takes about a minute. OpenCASCADE may read on for ever in a
/// damaged one.
constexpr double kLeastSeconds = 4, kSecondsPerMegabyte = 6, kMostSeconds = 600;
constexpr int kShapeDescriptor = 3, kSentenceDescriptor = 4;

int seconds_for(const std::string& path) {
  std::error_code failed;
  const std::uintmax_t bytes = std::filesystem::file_size(path, failed);
  const double megabytes = failed ? 0 : static_cast<double>(bytes) / 1e6;
  return static_cast<int>(std::min(kMostSeconds, kLeastSeconds + kSecondsPerMegabyte * megabytes));
}

/// Starts the program with the two files as its descriptors 3 and 4, and without a terminal's input and output. Returns
/// 0 or an error number.
int start(const std::string& program, const std::string& path, const Nameless& shape, const Nameless& sentence,
          pid_t* child) {
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  // Higher numbers first, so that neither file takes the other's place.
  const int shape_copy = ::fcntl(shape.descriptor(), F_DUPFD_CLOEXEC, 16);
  const int sentence_copy = ::fcntl(sentence.descriptor(), F_DUPFD_CLOEXEC, 16);
  posix_spawn_file_actions_adddup2(&files, shape_copy, kShapeDescriptor);
  posix_spawn_file_actions_adddup2(&files, sentence_copy, kSentenceDescriptor);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none;
  sigemptyset(&none);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
  std::string words[] = {program, path, std::to_string(seconds_for(path)), std::to_string(machine_memory())};
  char* arguments[] = {words[0].data(), words[1].data(), words[2].data(), words[3].data(), nullptr};
  const int error = posix_spawn(child, program.c_str(), &files, &attributes, arguments, environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&files);
  ::close(shape_copy);
  ::close(sentence_copy);
  return error;
}

std::string content(const Nameless& file) {
  std::ostringstream text;
  text << std::ifstream(file.path()).rdbuf();
  return text.str();
}

}  // namespace

Nameless::Nameless(const char* purpose) : descriptor_(memfd_create(purpose, MFD_CLOEXEC)) {}

Nameless::~Nameless() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

std::string Nameless::path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

Expected<Nameless> read_in_child(const std::string& reader, const std::string& path) {
  Nameless shape("varimesh shape"), sentence("varimesh sentence");
  pid_t child = 0;
  const int error =
      shape.descriptor() < 0 || sentence.descriptor() < 0 ? errno : start(reader, path, shape, sentence, &child);
  if (error != 0)
    return bad_option("'" + reader + "', which reads CAD files, cannot be started (" +
                      std::system_category().message(error) + "); install VariMesh again.");
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  const std::string about = "The geometry '" + path + "' cannot be used: ";
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return shape;
  if (WIFSIGNALED(status) && (WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL))
    return bad_input(about + "reading it took more than " + std::to_string(seconds_for(path)) +
                     " s or all memory, so it is damaged or too large; export it again, or simplify the model.");
  if (WIFSIGNALED(status))
    return bad_input(about + "OpenCASCADE crashed while it read it (signal " + std::to_string(WTERMSIG(status)) +
                     "), so the file is probably damaged; export it again.");
  const std::string said = content(sentence);
  return bad_input(about + (said.empty() ? "its reader ended with status " + std::to_string(WEXITSTATUS(status)) +
                                               "; export it again, as STEP."
                                         : said));
}

}  // namespace varimesh::geometry
