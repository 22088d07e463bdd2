// Starts VariMesh's own programs that other programs of VariMesh need: each does work that may end badly in a process
// of its own.
#pragma once

#include <sys/types.h>

#include <span>
#include <string>
#include <vector>

namespace varimesh {

/// Where the program is: the environment variable `variable`, beside this program, or in the folder lib/varimesh beside
/// this program's folder. Empty if it is not installed.
std::string find_helper(const char* name, const char* variable);

/// What a helper is started with.
struct HelperStart {
  std::string program;                        ///< Its path.
  std::vector<std::string> arguments;         ///< Without its name.
  std::span<const int> files;                 ///< They become its descriptors 3, 4, … It has no others.
  std::vector<std::string> environment = {};  ///< NAME=VALUE, beside those that say where libraries are.
};

/// A program that was started.
struct Helper {
  pid_t id = -1;  ///< −1: it was not started.
  int error = 0;  ///< Why not: errno.
};

/// Starts the program. Its standard input, output and error are /dev/null. It has a process group of its own, so a
/// Ctrl-C goes to this process only, which decides what becomes of its work. The caller waits for its end.
Helper start_helper(const HelperStart& start);

/// Ends the helper, if it still runs, and waits for its end. Returns its status, as waitpid() does. `kills`: at once.
int end_helper(pid_t id, bool kills);

}  // namespace varimesh
