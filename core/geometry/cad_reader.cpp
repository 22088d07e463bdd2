#include "core/geometry/cad_reader.h"

#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <csignal>
#include <sstream>
#include <string_view>
#include <system_error>
#include <thread>

#include "core/base/utf8.h"
#include "core/process/helper_program.h"

namespace varimesh::geometry {
namespace {

/// Most seconds of processor time for a file. One of 100 MB takes about a minute. OpenCASCADE may read on for ever in a
/// damaged one.
constexpr double kLeastSeconds = 3, kSecondsPerMegabyte = 6, kMostSeconds = 600;

std::int64_t size_of(int file) {
  struct stat status {};
  return ::fstat(file, &status) == 0 ? static_cast<std::int64_t>(status.st_size) : 0;
}

int seconds_for(int file) {
  const double megabytes = static_cast<double>(size_of(file)) / 1e6;
  return static_cast<int>(std::min(kMostSeconds, kLeastSeconds + kSecondsPerMegabyte * megabytes));
}

/// An open file without a name, which is gone when this object is.
class Nameless {
 public:
  explicit Nameless(const char* purpose) : descriptor(memfd_create(purpose, MFD_CLOEXEC)) {}
  ~Nameless() {
    if (descriptor >= 0) ::close(descriptor);
  }
  Nameless(const Nameless&) = delete;
  Nameless& operator=(const Nameless&) = delete;

  std::string content() const {
    std::string bytes(static_cast<std::size_t>(size_of(descriptor)), '\0');
    std::size_t have = 0;
    while (have < bytes.size()) {
      const ssize_t got = ::pread(descriptor, bytes.data() + have, bytes.size() - have, static_cast<off_t>(have));
      if (got <= 0) break;
      have += static_cast<std::size_t>(got);
    }
    bytes.resize(have);
    return bytes;
  }

  const int descriptor;
};

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

/// The names of faces, from lines with a number, a space and a name.
std::map<int, std::string> names_of(const std::string& text) {
  constexpr std::size_t kMostBytes = 80;
  std::map<int, std::string> names;
  for (const std::string& line : lines_of(text)) {
    int number = 0;
    const auto [end, failed] = std::from_chars(line.data(), line.data() + line.size(), number);
    if (failed == std::errc() && end != line.data() + line.size())
      names.emplace(number, as_plain_text(std::string_view(end + 1, line.data() + line.size()), kMostBytes));
  }
  return names;
}

/// Waits for the end of the process, and returns its status. If the work is to stop, ends it and throws Interrupted.
int status_of(pid_t id, const StopToken* stop) {
  for (auto pause = std::chrono::milliseconds(1); stop != nullptr;
       pause = std::min(2 * pause, std::chrono::milliseconds(20))) {
    siginfo_t ended{};
    const bool is_known = ::waitid(P_PID, static_cast<id_t>(id), &ended, WEXITED | WNOHANG | WNOWAIT) == 0;
    if (ended.si_pid == id || (!is_known && errno != EINTR)) break;
    if (stop->stopped()) {
      end_helper(id, true);
      throw Interrupted();
    }
    std::this_thread::sleep_for(pause);
  }
  return end_helper(id, false);
}

}  // namespace

Expected<ReadModel> read_in_child(const std::string& reader, int file, const std::string& what,
                                  std::int64_t most_memory, const StopToken* stop) {
  const Nameless shape("varimesh shape"), sentence("varimesh sentence"), names("varimesh names");
  const int files[] = {shape.descriptor, sentence.descriptor, file, names.descriptor};
  const int seconds = seconds_for(file);
  Helper child;
  child.error = errno;
  if (shape.descriptor >= 0 && sentence.descriptor >= 0 && names.descriptor >= 0)
    child = start_helper({reader, {std::to_string(seconds), std::to_string(most_memory)}, files});
  if (child.id < 0)
    return bad_option("'" + reader + "', which reads CAD files, cannot be started (" +
                      std::system_category().message(child.error) + "); install VariMesh again.");
  const int status = status_of(child.id, stop);
  const std::string about = what + " cannot be used: ";
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0)
    return ReadModel{shape.content(), lines_of(sentence.content()), names_of(names.content())};
  if (WIFSIGNALED(status) && (WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL))
    return bad_input(about + "reading it took more than " + std::to_string(seconds) +
                     " s or all memory, so it is damaged or too large; export it again, or simplify the model.");
  if (WIFSIGNALED(status))
    return bad_input(about + "OpenCASCADE crashed while it read it (signal " + std::to_string(WTERMSIG(status)) +
                     "), so the file is probably damaged; export it again.");
  const std::string said = sentence.content();
  return bad_input(about + (said.empty() ? "its reader ended with status " + std::to_string(WEXITSTATUS(status)) +
                                               "; export it again, as STEP."
                                         : said));
}

}  // namespace varimesh::geometry
