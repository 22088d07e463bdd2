#include "tests/bench/table/command.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <vector>

namespace varimesh::bench {
namespace {

/// Replaces this process by the program.
void start(const std::string& program, const std::string& mesh, const std::string& output, const std::string& log,
           int threads) {
  const int to = open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  if (to >= 0) {
    dup2(to, STDOUT_FILENO);
    dup2(to, STDERR_FILENO);
  }
  const std::string count = std::to_string(threads);
  execl(program.c_str(), program.c_str(), "optimise", mesh.c_str(), "-o", output.c_str(), "--threads", count.c_str(),
        "--constants", "reference", static_cast<char*>(nullptr));
  _exit(127);
}

}  // namespace

Expected<CommandMeasured> run_command(const std::string& program, const std::string& mesh, const std::string& output,
                                      const std::string& log, int threads) {
  CommandMeasured measured;
  const auto numbers = in_child(
      [&] {
        const auto began = std::chrono::steady_clock::now();
        const pid_t child = fork();
        if (child == 0) start(program, mesh, output, log, threads);
        int status = 1;
        rusage usage{};
        if (child > 0) wait4(child, &status, 0, &usage);
        const double wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
        const auto seconds = [](const timeval& time) {
          return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
        };
        return std::vector<double>{static_cast<double>(status), wall, seconds(usage.ru_utime) + seconds(usage.ru_stime),
                                   1024.0 * static_cast<double>(usage.ru_maxrss)};
      },
      Yardsticks::Take, measured.conditions);
  std::error_code ignored;
  std::filesystem::remove(output, ignored);
  if (!numbers) return tl::unexpected(numbers.error());
  if (numbers->front() != 0)
    return tl::unexpected<Error>({Error::Kind::Internal, program + " failed on " + mesh + "; see " + log});
  measured.wall = (*numbers)[1];
  measured.processor = (*numbers)[2];
  measured.peak_bytes = (*numbers)[3];
  return measured;
}

}  // namespace varimesh::bench
