#include "tests/bench/table/table.h"

#include <array>
#include <cstdarg>
#include <cstdio>

#include "tests/bench/measure_yardstick.h"

namespace varimesh::bench {

std::string text(const char* format, ...) {
  std::array<char, 500> out{};
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(out.data(), out.size(), format, arguments);
  va_end(arguments);
  return out.data();
}

void Table::head() {
  std::printf("| %-44s | %-12s | %-10s | %-30s | %-28s | %-40s | %s |\n", "what", "measured", "normalised", "goal",
              "verdict", "quality: min Js, elements", "peers, seconds normalised");
  std::printf("|---|---|---|---|---|---|---|\n");
  std::fflush(stdout);
}

void Table::add(const Line& line) {
  ++lines_;
  std::string verdict = line.target.empty() ? "" : line.missed.empty() ? "met" : "NOT MET: ";
  for (std::size_t i = 0; i < line.missed.size(); ++i) verdict += (i > 0 ? ", " : "") + line.missed[i];
  if (!line.judged) verdict = "not judged: disturbed";
  if (!line.target.empty() && line.judged) ++(line.missed.empty() ? met_ : missed_);
  disturbed_ += line.disturbed ? 1 : 0;
  std::printf("| %-44s | %-12s | %-10s | %-30s | %-28s | %-40s | %s |\n", line.what.c_str(),
              (line.measured + (line.disturbed ? " *" : "")).c_str(), line.normalised.c_str(), line.target.c_str(),
              verdict.c_str(), line.quality.c_str(), line.peers.c_str());
  std::fflush(stdout);
}

void Table::skip(const std::string& what, const std::string& reason) {
  ++skipped_;
  std::printf("| %-44s | SKIPPED: %s |\n", what.c_str(), reason.c_str());
  std::fflush(stdout);
}

void Table::fail(const std::string& what, const Error& error) {
  if (error.kind == Error::Kind::BadInput) return skip(what, error.sentence);
  ++failed_;
  std::printf("| %-44s | FAILED: %s |\n", what.c_str(), error.sentence.c_str());
  std::fflush(stdout);
}

void Table::foot() const {
  std::printf("\n%d figures: %d met, %d not met, %d without a target or not judged; %d skipped, %d failed.\n", lines_,
              met_, missed_, lines_ - met_ - missed_, skipped_, failed_);
  std::printf("Normalised: multiplied by the yardstick's GFLOP/s, measured before and after, and divided by %g.\n",
              kReferenceGflops);
  if (disturbed_ > 0)
    std::printf("* %d figures were taken while other programs were running; those for one thread are processor time.\n",
                disturbed_);
}

const Measured* Bench::measure(const std::string& what, const Run& run, Measured& into) {
  Expected<Measured> measured = runner.run(run);
  if (!measured) {
    table.fail(what, measured.error());
    return nullptr;
  }
  into = std::move(*measured);
  return &into;
}

std::string quality_of(const Measured& m) {
  return text("%.4f, %lld invalid, %lld uncertified", m.min_scaled_jacobian, static_cast<long long>(m.invalid),
              static_cast<long long>(m.uncertified));
}

}  // namespace varimesh::bench
