// What the commands optimise, curve and mesh share: they run one job on a mesh and deliver its result.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/common_flags.h"
#include "client/io/inputs.h"
#include "client/jobs/connection.h"
#include "client/runs/layer_flags.h"

namespace varimesh::client {

struct OptimiseArguments {
  CommonFlags common;
  Input input;
  std::string name;  ///< What messages and the report call the mesh; empty: its path.
  std::vector<std::string> outputs;
  std::string format, history, report, request_id;
  std::string checkpoint;           ///< Only of several processes that share the run, as is
  double checkpoint_interval = 60;  ///< in seconds.
  v1::Options options;
  LayerFlags layers;
  std::optional<v1::Layers> wanted_layers;  ///< From the flags; set by optimise() and curve().
};

/// Adds all flags except those of the input.
void add_run_flags(Command command, OptimiseArguments* arguments);

/// Adds the flags of a run that several processes share.
void add_checkpoint_flags(Command command, OptimiseArguments* arguments);

/// Runs the job and returns the exit status.
int optimise(OptimiseArguments arguments);

/// Does what the arguments ask for, and returns the exit status.
using OptimiseRun = std::function<int(const OptimiseArguments&)>;

/// Makes a curved mesh from a straight mesh and its geometry, as optimise() does; the order in `options` is the order
/// of the curved mesh. If elements are not certified valid at the end, it says on which surfaces they lie.
int curve(OptimiseArguments arguments);

/// Takes the layers from their flags, and says which height follows from a Reynolds number. Errors: BadOption.
Expected<void> take_layers(OptimiseArguments* arguments);

/// The connection of a run: to the service in this process if the server does not take the run's CAD model or layers.
/// The error is the exit status; its message has been printed.
tl::expected<Connection, int> connect_for(OptimiseArguments& arguments);

/// Says in which order of nodes the elements of a mesh fit together, if that is why it was refused.
void say_fitting_orders(const Input& input, const v1::Job& ended);

/// Checks, before any work is done, that the outputs of curve() can be written and its options go together. Returns the
/// exit status; if it is not kDone, an error has been printed.
int check_curve(OptimiseArguments arguments);

}  // namespace varimesh::client
