#include "tests/bench/table/runs.h"

#include <hwy/targets.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <fstream>

#include "core/formats/formats.h"
#include "core/optimise/memory.h"
#include "core/optimise/optimiser.h"
#include "tests/bench/core/optimise/loads.h"
#include "tests/bench/measure_yardstick.h"

namespace varimesh::bench {
namespace {

constexpr std::int64_t kFew = 12;  // cells not certified valid

double wall_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Seconds in which the processors worked or were taken away by a hypervisor, summed; 0 if the system does not say.
double machine_busy_seconds() {
  std::ifstream file("/proc/stat");
  std::string cpu;
  std::array<double, 8> ticks{};  // user nice system idle iowait irq softirq steal
  file >> cpu;
  for (double& one : ticks) file >> one;
  if (!file) return 0;
  return (ticks[0] + ticks[1] + ticks[2] + ticks[5] + ticks[6] + ticks[7]) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

double cpu_seconds(const rusage& usage) {
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

void write_all(int to, const void* from, std::size_t bytes) {
  const char* at = static_cast<const char*>(from);
  while (bytes > 0) {
    const ssize_t written = write(to, at, bytes);
    if (written <= 0) _exit(1);
    at += written;
    bytes -= static_cast<std::size_t>(written);
  }
}

std::vector<double> read_all(int from) {
  std::string bytes;
  std::array<char, 1 << 16> piece;
  for (ssize_t got = 0; (got = read(from, piece.data(), piece.size())) > 0;)
    bytes.append(piece.data(), static_cast<std::size_t>(got));
  std::vector<double> numbers(bytes.size() / sizeof(double));
  std::copy_n(bytes.data(), numbers.size() * sizeof(double), reinterpret_cast<char*>(numbers.data()));
  return numbers;
}

/// Visits the numbers of Measured one after another, to send them through a pipe.
template <class Visit>
void each_number(Measured& m, const Visit& visit) {
  for (Times* times : {&m.wall, &m.processor})
    for (double* number : {&times->whole, &times->sweep, &times->later, &times->each, &times->few}) visit(*number);
  for (double* number : {&m.energy, &m.products, &m.first_products, &m.most_products, &m.later_products,
                         &m.min_scaled_jacobian, &m.sweep_points, &m.peak_bytes, &m.estimated_bytes})
    visit(*number);
  for (std::int64_t* number : {&m.elements, &m.free_nodes, &m.invalid, &m.uncertified, &m.below_half}) visit(*number);
  for (int* number : {&m.dimension, &m.iterations}) visit(*number);
  visit(m.converged);
}

/// `at`: seconds at the end of each iteration.
Times times_of(const std::vector<Iteration>& history, const std::vector<double>& at, double whole) {
  Times times;
  times.whole = whole;
  if (history.empty()) return times;
  std::vector<double> each;
  for (std::size_t i = 1; i < at.size() && i <= 5; ++i) each.push_back(at[i] - at[i - 1]);
  if (each.size() == 5) {
    times.sweep = median(std::move(each));
  }
  times.later = at.back() - at.front();
  times.each = at.back() / static_cast<double>(at.size());
  const auto few =
      std::find_if(history.begin(), history.end(), [](const Iteration& one) { return one.invalid_elements <= kFew; });
  if (few != history.end()) times.few = at[static_cast<std::size_t>(few - history.begin())];
  return times;
}

void count_products(const std::vector<Iteration>& history, Measured& m) {
  double products = 0, steps = 0;
  for (const Iteration& one : history) {
    if (one.phase != Phase::Newton) continue;
    if (steps == 0) m.first_products = one.products;
    m.most_products = std::max(m.most_products, static_cast<double>(one.products));
    products += one.products;
    ++steps;
  }
  m.products = steps > 0 ? products / steps : 0;
  m.later_products = history.empty() ? 0 : products - history.front().products;
}

void refuse(const Error& error) {
  std::fprintf(stderr, "%s\n", error.sentence.c_str());
  _exit(1);
}

/// Runs in the child process.
Measured optimise_file(const std::string& path, const Run& run) {
  // In Highway a better target has a lower bit, so all targets better than AVX2 are below it.
  if (run.avx2) hwy::DisableTargets(HWY_AVX2 - 1);
  auto file = formats::read_file(path);
  if (!file) refuse(file.error());
  std::vector<double> wall_at, processor_at;
  const double processor_start = processor_seconds();
  Measured m;
  m.estimated_bytes = static_cast<double>(memory_needed(file->mesh, run.options));
  auto result = optimise(std::move(file->mesh), run.options, [&](const Iteration& one) {
    wall_at.push_back(one.seconds);
    processor_at.push_back(processor_seconds() - processor_start);
    return Control::Continue;
  });
  if (!result) refuse(result.error());
  m.wall = times_of(result->history, wall_at, result->seconds);
  m.processor = times_of(result->history, processor_at, processor_seconds() - processor_start);
  count_products(result->history, m);
  m.energy = result->history.empty() ? 0 : result->history.back().energy;
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  m.peak_bytes = 1024.0 * static_cast<double>(usage.ru_maxrss);
  m.iterations = result->iterations;
  m.converged = result->converged;
  m.dimension = result->sizes.dimension;
  m.elements = result->sizes.elements;
  m.free_nodes = result->sizes.free_nodes;
  const QualityReport& after = result->after;
  m.min_scaled_jacobian = after.min_scaled_jacobian;
  m.invalid = after.invalid_elements;
  m.uncertified = after.certified.invalid + after.certified.undecided;
  m.below_half = after.invalid_elements;
  for (int bin = 0; bin < QualityReport::kBins / 2; ++bin) m.below_half += after.histogram[bin];
  if (m.wall.sweep > 0) m.sweep_points = points_visited(build_problem(result->mesh, fixed_nodes(result->mesh), 0));
  if (run.want_coordinates) m.coordinates = std::move(result->mesh.coordinates);
  return m;
}

}  // namespace

double median(std::vector<double> of) {
  if (of.empty()) return 0;
  const auto middle = of.begin() + static_cast<std::ptrdiff_t>(of.size() / 2);
  std::nth_element(of.begin(), middle, of.end());
  return *middle;
}

double processor_seconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

double Conditions::normalised(double seconds) const { return seconds * yardstick / kReferenceGflops; }

Times Measured::normalised() const {
  Times times = this->times();
  for (double* seconds : {&times.whole, &times.sweep, &times.later, &times.each, &times.few})
    *seconds = conditions.normalised(*seconds);
  return times;
}

std::string Run::key() const {
  const Options& o = options;
  std::string key = mesh + (avx2 ? " avx2" : "") + (want_coordinates ? " coordinates" : "");
  for (const double number : {double(o.energy), double(o.constants), double(o.objective), double(o.target),
                              double(o.order), double(o.method), o.lambda, o.tolerance, double(o.max_iterations),
                              double(o.until), double(o.active_set), double(o.threads), double(repeats)}) {
    std::array<char, 40> text;
    std::snprintf(text.data(), text.size(), " %.17g", number);
    key += text.data();
  }
  return key;
}

Expected<std::vector<double>> in_child(const std::function<std::vector<double>()>& work, Yardsticks yardsticks,
                                       Conditions& conditions) {
  if (yardsticks == Yardsticks::Take) conditions.yardstick = yardstick().processor;
  std::array<int, 2> pipe_ends{};
  if (pipe(pipe_ends.data()) != 0) return tl::unexpected<Error>({Error::Kind::Internal, "no pipe could be made"});
  const double wall_before = wall_seconds(), busy_before = machine_busy_seconds();
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    close(pipe_ends[0]);
    const std::vector<double> numbers = work();
    write_all(pipe_ends[1], numbers.data(), numbers.size() * sizeof(double));
    _exit(0);
  }
  close(pipe_ends[1]);
  std::vector<double> numbers = child > 0 ? read_all(pipe_ends[0]) : std::vector<double>();
  close(pipe_ends[0]);
  int status = 1;
  rusage usage{};
  if (child > 0) wait4(child, &status, 0, &usage);
  const double others = machine_busy_seconds() - busy_before - cpu_seconds(usage);
  conditions.busy_cores = std::max(0.0, others / (wall_seconds() - wall_before));
  if (yardsticks == Yardsticks::Take) conditions.yardstick = std::max(conditions.yardstick, yardstick().processor);
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0)
    return tl::unexpected<Error>({Error::Kind::Internal, "the run ended without a result"});
  return numbers;
}

namespace {

Expected<Measured> measure(const Meshes& meshes, const Run& run, Yardsticks yardsticks) {
  const Expected<std::string> path = meshes.find(run.mesh);
  if (!path) return tl::unexpected(path.error());
  Measured measured;
  auto numbers = in_child(
      [&] {
        Measured m = optimise_file(*path, run);
        std::vector<double> out;
        each_number(m, [&](auto number) { out.push_back(static_cast<double>(number)); });
        out.insert(out.end(), m.coordinates.begin(), m.coordinates.end());
        return out;
      },
      yardsticks, measured.conditions);
  measured.one_thread = run.options.threads == 1;
  if (!numbers) return tl::unexpected<Error>({numbers.error().kind, run.mesh + ": " + numbers.error().sentence});
  std::size_t at = 0;
  each_number(measured, [&](auto& number) { number = static_cast<std::decay_t<decltype(number)>>((*numbers)[at++]); });
  measured.coordinates.assign(numbers->begin() + static_cast<std::ptrdiff_t>(at), numbers->end());
  return measured;
}

}  // namespace

Expected<Measured> Runner::run(const Run& run) {
  const std::string key = run.key();
  if (const auto found = remembered_.find(key); found != remembered_.end()) return found->second;
  Expected<Measured> measured = measure(meshes_, run, Yardsticks::Take);
  if (!measured) return measured;
  std::vector<double> sweeps{measured->times().sweep};
  for (int i = 1; i < run.repeats; ++i) {
    const Expected<Measured> again = run_again(run);
    if (!again) return again;
    sweeps.push_back(again->times().sweep);
  }
  measured->wall.sweep = measured->processor.sweep = median(std::move(sweeps));
  return remembered_[key] = *measured;
}

Expected<Measured> Runner::run_again(const Run& run) const { return measure(meshes_, run, Yardsticks::Spare); }

}  // namespace varimesh::bench
