// The numbers are those of linux/landlock.h. That of an older system lacks some of them, and a program that was built
// there runs on a newer one.
#include "core/process/landlock.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>

namespace varimesh {
namespace {

constexpr long kCreateRuleset = 444, kAddRule = 445, kRestrictSelf = 446;
constexpr unsigned kAskVersion = 1;
constexpr int kPathBeneath = 1;

constexpr std::uint64_t kWriteFile = 1 << 1, kReadFile = 1 << 2, kReadFolder = 1 << 3;
constexpr std::uint64_t kOfVersion1 = (1 << 13) - 1;  // these three, running a file, making and removing one
constexpr std::uint64_t kRefer = 1 << 13, kTruncate = 1 << 14, kAskDevice = 1 << 15;
constexpr std::uint64_t kTcp = 3, kSocketsAndSignals = 3;

struct Ruleset {
  std::uint64_t files, network, scoped;
};

/// What the system can forbid.
Ruleset all_of(long version) {
  Ruleset all{kOfVersion1, 0, 0};
  if (version >= 2) all.files |= kRefer;
  if (version >= 3) all.files |= kTruncate;
  if (version >= 4) all.network = kTcp;
  if (version >= 5) all.files |= kAskDevice;
  if (version >= 6) all.scoped = kSocketsAndSignals;
  return all;
}

std::size_t size_of(long version) {
  return version < 4 ? offsetof(Ruleset, network) : version < 6 ? offsetof(Ruleset, scoped) : sizeof(Ruleset);
}

bool allow(int rules, const std::string& path, std::uint64_t rights) {
  const int file = ::open(path.c_str(), O_PATH | O_CLOEXEC);
  if (file < 0) return true;
  struct stat status {};
  const bool is_folder = ::fstat(file, &status) == 0 && S_ISDIR(status.st_mode);
  struct __attribute__((packed)) {
    std::uint64_t allowed;
    std::int32_t parent;
  } const rule{is_folder ? rights : rights & ~kReadFolder, file};
  const bool added = ::syscall(kAddRule, rules, kPathBeneath, &rule, 0) == 0;
  ::close(file);
  return added;
}

}  // namespace

bool open_only(const OpenableFiles& files) {
  const long version = ::syscall(kCreateRuleset, nullptr, 0, kAskVersion);
  if (version < 1) return false;
  const Ruleset all = all_of(version);
  const int rules = static_cast<int>(::syscall(kCreateRuleset, &all, size_of(version), 0));
  if (rules < 0) return false;
  constexpr std::uint64_t kToRead = kReadFile | kReadFolder;
  bool done = true;
  for (const std::string& path : files.to_read) done = done && allow(rules, path, kToRead);
  for (const std::string& path : files.to_use)
    done = done && allow(rules, path, (kToRead | kWriteFile | kAskDevice) & all.files);
  done = done && ::syscall(kRestrictSelf, rules, 0) == 0;
  ::close(rules);
  return done;
}

}  // namespace varimesh
