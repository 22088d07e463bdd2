#include "server/isolation/devices/devices.h"

#include <algorithm>
#include <sstream>
#include <string_view>

#include "core/base/utf8.h"
#include "server/isolation/worker.pb.h"
#include "server/isolation/worker_process.h"

namespace varimesh::server {
namespace {

/// How long a driver may take to begin. With eight cards and no daemon that keeps them awake it takes ten seconds.
constexpr int kMilliseconds = 60'000;

/// Returns what a process says that opens the device. Throws ProcessLost.
worker::Started opened(const std::string& program, const std::string& device) {
  WorkerProcess process(program);
  worker::ToWorker message;
  message.mutable_request()->set_device(device);
  message.mutable_request()->set_only_opens_device(true);
  worker::FromWorker answer;
  if (!process.channel().send(message)) process.fail_ended();
  switch (process.channel().receive(answer, kMilliseconds)) {
    case Channel::Got::Message:
      return answer.started();
    case Channel::Got::Nothing:
      throw ProcessLost{"did not open it within " + std::to_string(kMilliseconds / 1000) + " s"};
    default:
      process.fail_ended();
  }
}

}  // namespace

Expected<std::vector<std::string>> names_of_devices(int count, const char* visible) {
  std::vector<std::string> names;
  if (visible == nullptr) {
    for (int number = 0; number < count; ++number) names.push_back(std::to_string(number));
    return names;
  }
  std::istringstream all(visible);
  for (std::string name; static_cast<int>(names.size()) < count && std::getline(all, name, ',');)
    if (!name.empty()) names.push_back(name);
  if (static_cast<int>(names.size()) < count)
    return bad_option("--devices is " + std::to_string(count) + ", and CUDA_VISIBLE_DEVICES names " +
                      std::to_string(names.size()) + "; make both the same.");
  return names;
}

Expected<std::string> try_devices(const std::string& program, const std::vector<std::string>& devices) {
  std::vector<std::string> cards;
  for (const std::string& device : devices) {
    const std::string which = "Jobs cannot have the device " + device + " (--devices). ";
    try {
      const worker::Started started = opened(program, device);
      const std::string told = as_plain_text(started.device());
      if (!started.has_device()) return bad_option(which + told);
      if (!started.is_filtered())
        return bad_option(which +
                          "This system has no seccomp filters, without which its driver's calls cannot be limited.");
      if (std::ranges::find(cards, told) == cards.end()) cards.push_back(told);
    } catch (const ProcessLost& lost) {
      return bad_option(which + "The process that was to open it " + lost.why + ".");
    }
  }
  std::string all;
  for (const std::string& card : cards) all += (all.empty() ? "" : ", ") + card;
  return all;
}

}  // namespace varimesh::server
