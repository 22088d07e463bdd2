#include "client/commands/commands.h"

#include "core/base/version.h"

namespace varimesh::client {

Actions add_commands(Command program) {
  program.describe("varimesh",
                   "Moves the interior nodes of a curved high-order mesh until the mesh is valid and smooth.",
                   std::string(version()));
  return {{"optimise", add_optimise(program)},
          {"curve", add_curve(program)},
          {"mesh", add_mesh(program)},
          {"quality", add_quality(program)},
          {"layers", add_layers(program)},
          {"convert", add_convert(program)},
          {"submit", add_submit(program)},
          {"watch", add_watch(program)},
          {"result", add_result(program)},
          {"wait", add_wait(program)},
          {"results", add_results(program)},
          {"jobs", add_jobs(program)},
          {"cancel", add_cancel(program)},
          {"delete", add_delete(program)},
          {"info", add_info(program)},
          {"doctor", add_doctor(program)},
          {"certificates", add_certificates(program)},
          {"completion", add_completion(program)},
          {"man", add_man(program)}};
}

}  // namespace varimesh::client
