// Jobs as lines of a table for people.
#pragma once

#include <cstddef>
#include <limits>
#include <string>

#include "varimesh/v1/service.pb.h"

namespace varimesh::client {

/// As many columns as a line may have.
inline constexpr std::size_t kAnyWidth = std::numeric_limits<std::size_t>::max();

/// The heading of the table that job_row() fills, with a newline.
std::string job_heading(std::size_t width = kAnyWidth);

/// One line: the job's name, its state, when it was submitted, how long it has run, its iterations, its file and its
/// other labels. Words of others are made harmless for the terminal. Ends with a newline. In lines of less than 110
/// columns, the name has only its first eight digits, the year, the seconds and the iterations are left out, and what
/// does not fit ends with "…".
std::string job_row(const v1::Job& job, std::size_t width = kAnyWidth);

/// The name of the file, then the other labels; made harmless for the terminal.
std::string words_about(const v1::Job& job);

/// Whether the job is in a state that it does not leave.
bool has_ended(const v1::Job& job);

/// Whether the job has a mesh to fetch: it has succeeded, or was cancelled while it ran.
bool has_result(const v1::Job& job);

/// How many elements of the job's result are not certified valid.
std::int64_t uncertified(const v1::Job& job);

/// How the job ended, for example "min Js 0.412, every element certified valid", or the sentence of its error.
std::string ending_of(const v1::Job& job);

}  // namespace varimesh::client
