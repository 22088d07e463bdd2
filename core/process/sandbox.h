// What a process may do that reads the bytes of strangers: compute, and talk over what it has open.
#pragma once

namespace varimesh {

/// The system calls that are left to this process and all its threads: memory, threads, time, and what is already open.
/// It can open no files, make no sockets, start no processes, run no code that is not the program's own, and signal
/// nobody. Other calls fail with EPERM. The process must have given up new rights (PR_SET_NO_NEW_PRIVS). Call it before
/// there is a second thread. Returns false, with errno, if the system has no such filters.
bool use_only_open_files();

}  // namespace varimesh
