// Answers the requests that write a file.
#pragma once

#include <hdf5.h>

#include <cstdint>
#include <string>
#include <string_view>

namespace varimesh::hdf {

/// A new file at `path`, with this list of access properties. Its groups keep the order in which their members were
/// made, as CGNS needs it.
hid_t make_file(const char* path, hid_t access);

/// The requests MakeGroup, MakeArray, MakeAttribute and WriteRows of protocol.h. Throw Refusal. make_array() returns
/// the answer.
void make_group(hid_t file, const std::string& path);
std::string make_array(hid_t file, const std::string& text, bool attribute, std::string_view values);
void write_rows(hid_t file, const std::string& path, std::int64_t first, std::int64_t count, std::string_view values);

}  // namespace varimesh::hdf
