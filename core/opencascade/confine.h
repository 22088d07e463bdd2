// Takes from the process that reads CAD files what a file that takes it over could do harm with. Internal to
// core/opencascade.
#pragma once

namespace varimesh::cad {

/// From now on this process can open files only to read them, and neither make, change nor remove files, use networks,
/// start programs, nor reach other processes. What is open already stays. Returns false, with errno, if the system has
/// no filters for system calls: then the process may still do all this.
bool confine_this_process();

}  // namespace varimesh::cad
