// varimesh_hdf5: reads or writes an HDF5 file in a process of its own, so that a damaged file which makes HDF5 crash,
// hang or fill the memory ends only this process. core/formats/hdf5/process.cpp starts it.
//
//   varimesh_hdf5 read|write SECONDS BYTES
//
// Requests come over the socket that is descriptor 3 and are answered there, one by one (core/formats/hdf5/protocol.h).
// Descriptor 4 is the file that is written; the bytes of a file that is read come over the socket too. SECONDS of
// processor time and BYTES of memory are the limits; 0: none. Once the file is open, the process can open no other.
#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <exception>
#include <new>
#include <string>

#include "core/hdf/read.h"
#include "core/hdf/remote_file.h"
#include "core/hdf/socket.h"
#include "core/hdf/types.h"
#include "core/hdf/write.h"

namespace {

using namespace varimesh;
using formats::hdf5::Answer;
using formats::hdf5::AnswerHead;
using formats::hdf5::Kind;
using formats::hdf5::Request;
using formats::hdf5::RequestHead;

void limit(int what, rlim_t most) {
  const rlimit limits{most, most};
  setrlimit(static_cast<__rlimit_resource>(what), &limits);
}

bool answer(bool failed, const std::string& bytes) {
  const AnswerHead head{failed ? Answer::Failure : Answer::Values, std::int64_t(bytes.size()), 0};
  return hdf::send(&head, sizeof head) && hdf::send(bytes.data(), bytes.size());
}

std::string act(hid_t file, const RequestHead& head, const std::string& text, const std::string& values) {
  switch (head.request) {
    case Request::List:
      return hdf::list(file, text);
    case Request::ReadIntegers:
      return hdf::read(file, text, Kind::Integers, head.first, head.count);
    case Request::ReadNumbers:
      return hdf::read(file, text, Kind::Numbers, head.first, head.count);
    case Request::ReadTexts:
      return hdf::read(file, text, Kind::Texts, head.first, head.count);
    case Request::Place:
      return hdf::place(file, text);
    case Request::MakeGroup:
      hdf::make_group(file, text);
      return {};
    case Request::MakeArray:
    case Request::MakeAttribute:
      return hdf::make_array(file, text, head.request == Request::MakeAttribute, values);
    case Request::WriteRows:
      hdf::write_rows(file, text, head.first, head.count, values);
      return {};
    case Request::Finish:
      break;
  }
  throw hdf::Refusal("a request is unknown");
}

/// Answers requests until there are no more. Returns the status of the process.
int serve(hid_t file) {
  for (RequestHead head; hdf::receive(&head, sizeof head);) {
    if (head.text > formats::hdf5::kMostText || head.bytes < 0 || head.bytes > formats::hdf5::kMostBytes) return 2;
    std::string text(head.text, '\0'), values(std::size_t(head.bytes), '\0');
    if (!hdf::receive(text.data(), text.size()) || !hdf::receive(values.data(), values.size())) return 2;
    if (head.request == Request::Finish) {
      const bool closed = H5Fclose(file) >= 0;
      return answer(!closed, closed ? "" : "the file cannot be ended; the disk may be full") ? 0 : 2;
    }
    std::string result;
    bool failed = false;
    try {
      result = act(file, head, text, values);
    } catch (const std::bad_alloc&) {
      failed = true;
      result = "it needs more memory than is available";
    } catch (const std::exception& refusal) {
      failed = true;
      result = refusal.what();
    }
    if (!answer(failed, result)) return 2;
  }
  return 0;  // whoever asked is gone
}

hid_t make_file() {
  const std::string path = "/proc/self/fd/" + std::to_string(formats::hdf5::kFile);
  // The driver that HDF5 uses otherwise looks for the file by its name, and this file has none.
  const hdf::Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, "HDF5 cannot be used");
  hdf::check(H5Pset_fapl_stdio(access), "HDF5 cannot be used");
  return hdf::make_file(path.c_str(), access);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
  if (const rlim_t seconds = std::strtoull(argv[2], nullptr, 10)) limit(RLIMIT_CPU, seconds);
  if (const rlim_t bytes = std::strtoull(argv[3], nullptr, 10)) limit(RLIMIT_AS, bytes);
  limit(RLIMIT_CORE, 0);
  setenv("HDF5_USE_FILE_LOCKING", "FALSE", 1);  // the file has no name, so no other process has it open
  unsetenv("HDF5_PLUGIN_PATH");
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);  // prints nothing
  H5PLset_loading_state(0);                     // loads no code that a file asks for
  try {
    std::int64_t size = 0;
    if (!hdf::receive(&size, sizeof size)) return 2;
    const hid_t file = std::strcmp(argv[1], "write") == 0 ? make_file() : hdf::open_remote(size);
    // The next file that is opened would get the lowest free descriptor, which must be below the limit.
    const int next = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
    ::close(next);
    limit(RLIMIT_NOFILE, rlim_t(next));
    if (!answer(file < 0, file < 0 ? "it is not a whole HDF5 file" : "")) return 2;
    return file < 0 ? 3 : serve(file);
  } catch (const std::exception& failure) {
    answer(true, failure.what());
    return 3;
  }
}
