// The devices that an operator gives to jobs.
#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"

namespace varimesh::server {

/// What CUDA_VISIBLE_DEVICES is for a process with each of `count` devices: the first of those that the variable names
/// in this process.
/// @param visible  the variable; null: it is not set, and the devices are 0, 1, …
/// Errors: BadOption if it names fewer.
Expected<std::vector<std::string>> names_of_devices(int count, const char* visible);

/// Opens each device in a process of its own, as a job will.
/// @param program  the path of varimesh_worker
/// Returns the names of the cards, each once, with commas between them. Errors: BadOption with why one cannot be used.
Expected<std::string> try_devices(const std::string& program, const std::vector<std::string>& devices);

}  // namespace varimesh::server
