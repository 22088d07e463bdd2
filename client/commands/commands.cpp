#include "client/commands/commands.h"

#include <algorithm>
#include <array>

#include "client/process/exit_status.h"
#include "client/process/launcher.h"
#include "core/base/version.h"

namespace varimesh::client {
namespace {

/// Commands that only tell about the program. Any number of processes may run them together.
constexpr std::array<std::string_view, 3> kHarmlessTogether{"doctor", "completion", "man"};

/// The same actions, which refuse to run in one of several processes that were started together.
Actions for_one_process(Actions actions) {
  for (auto& [name, action] : actions)
    if (std::ranges::find(kHarmlessTogether, name) == kHarmlessTogether.end())
      action = [action = std::move(action)] {
        const auto checked = check_started_alone();
        return checked ? action() : print_error(checked.error());
      };
  return actions;
}

/// All commands.
Actions list(Command program, const QualityRun& quality, const OptimiseRun& optimise_one, const SeveralRun& several,
             bool keeps_checkpoints = false) {
  program.describe(
      "varimesh",
      "Repairs curved high-order meshes: moves interior nodes until every element is valid, and then lowers the error "
      "that curved elements cost a solver.",
      std::string(version()));
  return {{"optimise", add_optimise(program, optimise_one, several, keeps_checkpoints)},
          {"curve", add_curve(program)},
          {"mesh", add_mesh(program)},
          {"quality", add_quality(program, quality)},
          {"layers", add_layers(program)},
          {"convert", add_convert(program)},
          {"submit", add_submit(program)},
          {"watch", add_watch(program)},
          {"logs", add_logs(program)},
          {"result", add_result(program)},
          {"wait", add_wait(program)},
          {"results", add_results(program)},
          {"jobs", add_jobs(program)},
          {"cancel", add_cancel(program)},
          {"delete", add_delete(program)},
          {"info", add_info(program)},
          {"doctor", add_doctor(program)},
          {"ui", add_ui(program)},
          {"certificates", add_certificates(program)},
          {"completion", add_completion(program)},
          {"man", add_man(program)}};
}

}  // namespace

Actions add_commands(Command program) {
  return for_one_process(list(program, quality_of_file, optimise, optimise_several));
}

Actions add_commands_of_ranks(Command program, const QualityRun& quality, const OptimiseRun& optimise_together) {
  const auto refuse = [](const std::string& what) {
    return print_error(
        {Error::Kind::BadOption, "varimesh-mpi shares only the work of 'quality' and of 'optimise' so far; 'varimesh " +
                                     what + "' does this in one process."});
  };
  const SeveralRun several = [refuse](const OptimiseArguments&, const std::vector<std::string>&, const std::string&) {
    return refuse("optimise --into");
  };
  Actions actions = list(program, quality, optimise_together, several, true);
  for (auto& [name, action] : actions)
    if (name != "quality" && name != "optimise" &&
        std::ranges::find(kHarmlessTogether, name) == kHarmlessTogether.end())
      action = [refuse, name] { return refuse(name); };
  return actions;
}

}  // namespace varimesh::client
