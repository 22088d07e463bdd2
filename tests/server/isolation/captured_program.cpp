// Stands in for varimesh_worker, varimesh_hdf5 or varimesh_cad_reader: starts the real program of its own name, with
// captured.cpp preloaded. The folder of this file has 'real', a folder with the real programs, and 'captured.so'. If it
// has a file 'threads', the captured program starts as many as that says, and stays.
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

int main(int, char** words) {
  const std::filesystem::path own = std::filesystem::read_symlink("/proc/self/exe"), folder = own.parent_path();
  const std::string real = folder / "real" / own.filename(),
                    report = folder / (own.filename().string() + ".report." + std::to_string(::getpid()));
  ::setenv("LD_PRELOAD", (folder / "captured.so").c_str(), 1);
  ::setenv("CAPTURED_REPORT", report.c_str(), 1);
  if (std::string threads; std::ifstream(folder / "threads") >> threads) {
    ::setenv("CAPTURED_THREADS", threads.c_str(), 1);
    ::setenv("CAPTURED_STAYS", "1", 1);
  }
  ::execv(real.c_str(), words);
  return 127;
}
