// Help for people: terms and their meanings in two columns, and as items of a manual page.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace varimesh {

/// How wide help is printed: the width of the terminal that standard output is, from 60 to 120; 100 elsewhere.
std::size_t help_width();

/// Wraps text into lines from `column` to `width`. The first line has `at` characters already. Ends with a newline.
std::string wrapped(const std::string& text, std::size_t at, std::size_t column, std::size_t width);

/// A term and its meaning, in two columns.
std::string help_entry(const std::string& term, const std::string& meaning, std::size_t width);

/// Text for troff: dashes that can be copied, and no line that looks like a request.
std::string troff_text(std::string_view text);

/// An item of a list in troff. `term` is troff already.
std::string troff_item(const std::string& term, std::string_view meaning);

/// A command line to copy in troff, and what it does.
std::string troff_example(std::string_view what, std::string_view line);

}  // namespace varimesh
