// Takes from the process that reads CAD files what a file that takes it over could do harm with. Internal to
// core/opencascade.
#pragma once

namespace varimesh::cad {

/// From now on this process can open files only to read them, and neither make, change nor remove files, use networks,
/// start programs, nor reach other processes. What is open already stays. Does nothing if the system has no filters for
/// system calls.
void confine_this_process();

}  // namespace varimesh::cad
