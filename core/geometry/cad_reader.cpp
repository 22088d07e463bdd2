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
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>

#include "core/base/utf8.h"
#include "core/process/helper_program.h"

namespace varimesh::geometry {
namespace {

/// Most seconds of processor time for a file. One of 100 MB takes about a minute. OpenCASCADE may read on for ever in a
/// damaged one.
constexpr double kLeastSeconds = 3, kSecondsPerMegabyte = 6, kMostSeconds = 600;
/// As many seconds more if the faces are to be covered with triangles.
constexpr double kSecondsForTriangles = 20;

// A process that a damaged file has taken over may write anything. Of its sentences and names no more is kept than
// this.
constexpr std::size_t kMostNotes = 20, kMostBytesOfNote = kMostTextBytes;
constexpr std::size_t kMostNames = 100'000, kMostBytesOfName = 80;
/// Read from it: the program itself cuts names at 200 bytes.
constexpr std::size_t kMostBytesOfNotes = 64 << 10, kMostBytesOfNames = kMostNames * 220;

std::int64_t size_of(int file) {
  struct stat status {};
  return ::fstat(file, &status) == 0 ? static_cast<std::int64_t>(status.st_size) : 0;
}

int seconds_for(int file, ReaderTask task) {
  const double megabytes = static_cast<double>(size_of(file)) / 1e6;
  const double least = kLeastSeconds + (task == ReaderTask::Triangles ? kSecondsForTriangles : 0);
  return static_cast<int>(std::min(kMostSeconds, least + kSecondsPerMegabyte * megabytes));
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

  /// Its first bytes, at most `most`.
  std::string content(std::size_t most = std::string::npos) const {
    std::string bytes(std::min(static_cast<std::size_t>(size_of(descriptor)), most), '\0');
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

/// Calls take(line) for each line until it returns false. The lines are parts of `text`.
template <class Take>
void for_each_line(std::string_view text, const Take& take) {
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    if (!take(line)) return;
    text.remove_prefix(std::min(line.size() + 1, text.size()));
  }
}

/// The first sentences, one from each line.
std::vector<std::string> notes_of(std::string_view text) {
  std::vector<std::string> notes;
  for_each_line(text, [&](std::string_view line) {
    notes.push_back(as_plain_text(line, kMostBytesOfNote));
    return notes.size() < kMostNotes;
  });
  return notes;
}

/// The names of the first faces that have one, from lines with a number, a space and a name.
std::map<int, std::string> names_of(std::string_view text) {
  std::map<int, std::string> names;
  for_each_line(text, [&](std::string_view line) {
    int number = 0;
    const char* const last = line.data() + line.size();
    const auto [end, failed] = std::from_chars(line.data(), last, number);
    if (failed == std::errc() && end != last && number > 0)
      names.emplace(number, as_plain_text(std::string_view(end + 1, last), kMostBytesOfName));
    return names.size() < kMostNames;
  });
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

Expected<ReadModel> read_in_child(const std::string& reader, ReaderTask task, int file, const std::string& what,
                                  std::int64_t most_memory, const StopToken* stop) {
  const Nameless shape("varimesh shape"), sentence("varimesh sentence"), names("varimesh names");
  const int files[] = {shape.descriptor, sentence.descriptor, file, names.descriptor};
  const int seconds = seconds_for(file, task);
  std::vector<std::string> words{std::to_string(seconds), std::to_string(most_memory)};
  if (task == ReaderTask::Triangles) words.emplace_back("triangles");
  Helper child;
  child.error = errno;
  if (shape.descriptor >= 0 && sentence.descriptor >= 0 && names.descriptor >= 0)
    child = start_helper({reader, std::move(words), files});
  if (child.id < 0)
    return bad_option("'" + reader + "', which reads CAD files, cannot be started (" +
                      std::system_category().message(child.error) + "); install VariMesh again.");
  const int status = status_of(child.id, stop);
  const std::string about = what + " cannot be used: ";
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0)
    return ReadModel{shape.content(), notes_of(sentence.content(kMostBytesOfNotes)),
                     names_of(names.content(kMostBytesOfNames))};
  if (WIFSIGNALED(status) && (WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL))
    return bad_input(about + "reading it took more than " + std::to_string(seconds) +
                     " s or all memory, so it is damaged or too large; export it again, or simplify the model.");
  if (WIFSIGNALED(status))
    return bad_input(about + "OpenCASCADE crashed while it read it (signal " + std::to_string(WTERMSIG(status)) +
                     "), so the file is probably damaged; export it again.");
  const std::string said = as_plain_text(sentence.content(kMostBytesOfNotes));
  return bad_input(about + (said.empty() ? "its reader ended with status " + std::to_string(WEXITSTATUS(status)) +
                                               "; export it again, as STEP."
                                         : said));
}

}  // namespace varimesh::geometry
