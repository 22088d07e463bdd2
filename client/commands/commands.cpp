#include "client/commands/commands.h"

#include "client/cli/help.h"
#include "core/base/version.h"

namespace varimesh::client {

std::vector<std::pair<std::string, Action>> add_commands(CLI::App& app) {
  app.name("varimesh");
  app.description("Moves the interior nodes of a curved high-order mesh until the mesh is valid and smooth.");
  app.formatter(std::make_shared<Help>());
  app.set_help_flag("-h,--help", "Print this help and exit");
  app.set_version_flag("--version", std::string(version()), "Print the version and exit");
  app.require_subcommand(1);
  return {{"optimise", add_optimise(app)},
          {"curve", add_curve(app)},
          {"mesh", add_mesh(app)},
          {"quality", add_quality(app)},
          {"convert", add_convert(app)},
          {"submit", add_submit(app)},
          {"watch", add_watch(app)},
          {"result", add_result(app)},
          {"wait", add_wait(app)},
          {"results", add_results(app)},
          {"jobs", add_jobs(app)},
          {"cancel", add_cancel(app)},
          {"delete", add_delete(app)},
          {"info", add_info(app)},
          {"doctor", add_doctor(app)},
          {"certificates", add_certificates(app)},
          {"completion", add_completion(app)},
          {"man", add_man(app)}};
}

}  // namespace varimesh::client
