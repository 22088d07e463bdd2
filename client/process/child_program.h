// Runs another program as a child process and waits for it.
#pragma once

#include <csignal>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace varimesh::client {

/// How a program ended.
struct ProgramEnd {
  enum class Way {
    Exited,       ///< By itself; `status` is its exit status.
    Signalled,    ///< By a signal; `status` is the signal's number.
    Interrupted,  ///< This command was interrupted, so the program was ended.
    TimeIsOver,   ///< It took longer than it may, so it was killed.
    NotStarted,   ///< It could not be started; `status` is errno.
  };
  Way way = Way::NotStarted;
  int status = 0;
};

/// Looks for a program in the folders of PATH. Empty if there is none that can be executed.
std::string find_program(const std::string& name);

/// What to do while a program runs.
struct Meanwhile {
  double most_seconds = 0;               ///< How long it may take; 0: as long as it wants.
  std::function<void()> on_second = {};  ///< Called about once a second; may be empty.
  double seconds_between = 1;            ///< How long until it is called again.
  int end_signal = SIGKILL;              ///< What ends the program if this command is interrupted or the time is over.
};

/// Runs a program to its end. Its standard output and error go to the file `log`, and its standard input is empty. If
/// this command is interrupted meanwhile, the program is ended.
/// @param arguments without the program's name
ProgramEnd run_program(const std::string& path, const std::vector<std::string>& arguments,
                       const std::filesystem::path& log, const Meanwhile& meanwhile = {});

}  // namespace varimesh::client
