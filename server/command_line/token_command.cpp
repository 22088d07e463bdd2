// Makes a token and writes it where it belongs.
#include "server/command_line/token_command.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstring>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "core/base/io/write_all.h"
#include "server/access/tokens.h"

namespace varimesh::server {
namespace {

struct Arguments {
  std::string name, file, until;
  std::vector<std::string> roles{"submit", "read", "cancel"};
};

/// Appends a line to a file, which only its owner can read if it is new. Returns false if that fails (errno).
bool append_line(const std::string& path, const std::string& line) {
  const int file = ::open(path.c_str(), O_CREAT | O_RDWR | O_APPEND | O_CLOEXEC, 0600);
  if (file < 0) return false;
  // A file that was edited by hand may end within a line.
  struct stat status {};
  char last = '\n';
  bool written = ::fstat(file, &status) == 0;
  if (written && status.st_size > 0) written = ::pread(file, &last, 1, status.st_size - 1) == 1;
  written = written && write_all(file, (last == '\n' ? "" : "\n") + line + "\n") && ::fsync(file) == 0;
  const int reason = errno;
  ::close(file);
  errno = reason;
  return written;
}

int make(const Arguments& arguments) {
  if (const auto until = time_of(arguments.until); until && *until <= std::chrono::system_clock::now()) {
    std::cerr << "varimeshd: a token until " << arguments.until
              << " would have expired already; --until is a day or a time to come, such as 2027-01-31.\n";
    return 2;
  }
  const auto made = make_token(arguments.name, arguments.roles, arguments.until);
  if (!made) {
    std::cerr
        << "varimeshd: no token can be made: a name has letters, digits and . _ - @ (at most 64), a role is submit, "
           "read, cancel or admin, and --until is a day such as 2027-01-31.\n";
    return 2;
  }
  if (!append_line(arguments.file, made->line)) {
    std::cerr << "varimeshd: cannot write '" << arguments.file << "' (" << std::strerror(errno)
              << "); name a file in a folder that exists.\n";
    return 1;
  }
  std::cout << made->token << std::endl;
  return 0;
}

}  // namespace

CLI::App& add_token_command(CLI::App& app, int* exit_status) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App& command = *app.add_subcommand(
      "token",
      "Make a token: print it, and append its line, with the SHA-256 instead of the token, to the file of tokens");
  command.add_option("NAME", arguments->name, "Whose token it is")->required();
  command
      .add_option("--tokens", arguments->file,
                  "The file of tokens; it is made if it does not exist (default: the environment variable "
                  "VARIMESH_TOKENS)")
      ->envname("VARIMESH_TOKENS")
      ->required();
  command
      .add_option("--role", arguments->roles,
                  "What the token allows: submit, read, cancel or admin; may be repeated (default: the first three)")
      ->allow_extra_args(false);
  command.add_option("--until", arguments->until,
                     "The day, or the time (2027-01-31T12:00:00Z), when the token expires");
  command.callback([arguments, exit_status] { *exit_status = make(*arguments); });
  return command;
}

}  // namespace varimesh::server
