#include "server/engine/work_limits.h"

#include <string>
#include <utility>

#include "core/options/option_table.h"

namespace varimesh::server {
namespace {

tl::unexpected<Error> too_much(const std::string& option, const std::string& asked, const std::string& most,
                               const std::string& flag) {
  return bad_option(option + " is " + asked + ", but this server runs a job for at most " + most + " (its flag " +
                    flag + "); ask for less.");
}

}  // namespace

Engine within(const WorkLimits& limits, Engine engine) {
  Engine limited;
  limited.check_options = [limits, check = std::move(engine.check_options)](const Options& options) -> Expected<void> {
    if (limits.iterations > 0 && options.max_iterations > limits.iterations)
      return too_much("max_iterations", std::to_string(options.max_iterations),
                      std::to_string(limits.iterations) + " iterations", "--max-job-iterations");
    if (limits.seconds > 0 && options.time_limit > limits.seconds)
      return too_much("time_limit", number_text(options.time_limit), number_text(limits.seconds) + " seconds",
                      "--max-job-seconds");
    return check(options);
  };
  limited.run = [limits, run = std::move(engine.run)](RunRequest request, const RunHooks& hooks) {
    if (limits.seconds > 0 && request.options.time_limit <= 0) request.options.time_limit = limits.seconds;
    return run(std::move(request), hooks);
  };
  limited.check_geometry = std::move(engine.check_geometry);
  limited.uses_device = std::move(engine.uses_device);
  return limited;
}

}  // namespace varimesh::server
