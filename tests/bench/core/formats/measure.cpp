// Measures how fast files are written and read, and how much memory that takes besides the mesh. Each measurement runs
// in a process of its own, which loads the mesh first.
//
//   formats_table MESH FOLDER THREADS [FORMAT...]
//
// Prints a row for each format: the size of the file, megabytes per second and processor seconds of writing and of
// reading, and the most memory that each took at once besides the mesh. Files in FOLDER are written and removed.
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include "core/formats/formats.h"

namespace {

using namespace varimesh;

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

/// Of this process and of the programs that it has started.
double processor_seconds() {
  double sum = 0;
  for (const int who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage used{};
    getrusage(static_cast<__rusage_who>(who), &used);
    for (const timeval& time : {used.ru_utime, used.ru_stime}) sum += double(time.tv_sec) + 1e-6 * double(time.tv_usec);
  }
  return sum;
}

/// Memory of this process that is no file, in MiB.
double own_memory() {
  std::ifstream status("/proc/self/status");
  double sum = 0;
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("RssAnon")) sum += std::atof(line.c_str() + 9) / 1024;
  return sum;
}

/// Looks at the memory every few milliseconds.
class Peak {
 public:
  Peak()
      : watcher_([this] {
          while (!ended_) {
            most_ = std::max(most_, own_memory());
            std::this_thread::sleep_for(std::chrono::milliseconds(3));
          }
        }) {}
  double end() {
    ended_ = true;
    watcher_.join();
    return most_;
  }

 private:
  std::atomic<bool> ended_ = false;
  double most_ = own_memory();
  std::thread watcher_;
};

template <class T>
double bytes(const std::vector<T>& values) {
  return double(values.size() * sizeof(T));
}

/// The mesh's own memory, in MiB.
double size_of(const HighOrderMesh& mesh) {
  double sum = bytes(mesh.coordinates) + bytes(mesh.node_numbers) + bytes(mesh.blocks);
  for (const ElementBlock& block : mesh.blocks) sum += bytes(block.numbers) + bytes(block.nodes);
  return sum / (1 << 20);
}

struct Row {
  double megabytes = 0, seconds = 0, processor = 0, more = 0, mesh = 0;
  char sentence[300] = "";
};

void fail(Row& row, const Error& error) {
  std::snprintf(row.sentence, sizeof row.sentence, "%s", error.sentence.c_str());
}

/// `as_text`: a file of Nektar++ that is not compressed, which is written if the mesh was read from one.
Row write(const char* from, const std::string& to, formats::Format format, bool as_text, int threads) {
  Row row;
  auto file = formats::read_file(from, 0, threads);
  if (!file) return fail(row, file.error()), row;
  if (as_text) file->mesh.foreign.push_back({"text", "", "nektar"});
  row.mesh = size_of(file->mesh);
  const double before = own_memory(), used = processor_seconds(), start = now();
  Peak peak;
  const auto done = formats::write_file(file->mesh, format, to, {}, threads);
  row.seconds = now() - start;
  row.processor = processor_seconds() - used;
  row.more = peak.end() - before;
  if (!done) return fail(row, done.error()), row;
  row.megabytes = double(std::filesystem::file_size(to)) / 1e6;
  return row;
}

Row read(const std::string& from, int threads) {
  Row row;
  const double used = processor_seconds(), start = now();
  Peak peak;
  const auto file = formats::read_file(from, 0, threads);
  row.seconds = now() - start;
  row.processor = processor_seconds() - used;
  row.more = peak.end();
  if (!file) return fail(row, file.error()), row;
  row.mesh = size_of(file->mesh);
  row.more -= row.mesh;
  row.megabytes = double(std::filesystem::file_size(from)) / 1e6;
  return row;
}

template <class Body>
Row in_process(const Body& body) {
  int ends[2];
  Row row;
  if (pipe(ends) != 0) return row;
  const pid_t child = fork();
  if (child == 0) {
    const Row own = body();
    (void)!::write(ends[1], &own, sizeof own);
    _exit(0);
  }
  close(ends[1]);
  if (::read(ends[0], &row, sizeof row) != ssize_t(sizeof row))
    std::snprintf(row.sentence, sizeof row.sentence, "crash");
  close(ends[0]);
  waitpid(child, nullptr, 0);
  return row;
}

void print(const Row& row) {
  if (row.sentence[0] != '\0')
    std::printf(" %s |", row.sentence);
  else
    std::printf(" %.0f | %.2f | %.2f | %.0f |", row.megabytes / row.seconds, row.seconds, row.processor, row.more);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) return std::fputs("formats_table MESH FOLDER THREADS [FORMAT...]\n", stderr), 2;
  const int threads = std::atoi(argv[3]);
  std::printf("| format | MB | write MB/s | s | processor s | MiB more | read MB/s | s | processor s | MiB more |\n");
  for (const formats::FormatInfo& info : formats::all()) {
    bool wanted = argc == 4;
    for (int i = 4; i < argc; ++i) wanted = wanted || info.name == argv[i];
    if (!wanted || !info.writable) continue;
    const std::string path = std::string(argv[2]) + "/measured" + std::string(info.extension);
    for (const bool as_text : {false, true}) {
      if (as_text && info.format != formats::Format::Nektar) continue;
      const Row written = in_process([&] { return write(argv[1], path, info.format, as_text, threads); });
      std::printf("| %s%s | %.0f |", std::string(info.name).c_str(), as_text ? ", text" : "", written.megabytes);
      print(written);
      if (written.sentence[0] == '\0' && info.readable) print(in_process([&] { return read(path, threads); }));
      std::printf("\n");
      std::fflush(stdout);
      std::filesystem::remove(path);
    }
  }
  return 0;
}
