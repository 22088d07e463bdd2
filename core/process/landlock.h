// Which files a thread may still open (man 7 landlock). A filter of system calls sees no paths, so it cannot say this.
#pragma once

#include <string>
#include <vector>

namespace varimesh {

/// Files and folders by their paths. A path that is not there is left out, and a folder stands for all that is in it.
struct OpenableFiles {
  std::vector<std::string> to_read;
  std::vector<std::string> to_use;  ///< Read, written, and asked by ioctl: devices.
};

/// From now on this thread, and the threads that it starts, open no other files. They make and remove none, run none,
/// and trace no process that may do more; where the system can forbid it, they use no TCP and signal no other process.
/// What is open stays open. The process must have given up new rights (PR_SET_NO_NEW_PRIVS). Returns false, with errno,
/// if the system cannot do it: it needs Linux 5.13 with Landlock.
bool open_only(const OpenableFiles& files);

}  // namespace varimesh
