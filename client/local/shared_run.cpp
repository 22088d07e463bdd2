#include "client/local/shared_run.h"

#include <cassert>
#include <memory>
#include <utility>

#include "client/local/bytes.h"
#include "core/threads/crew.h"
#include "server/engine/engine.h"
#include "server/engine/option_messages.h"
#include "server/engine/translate.h"

namespace varimesh::client {
namespace {

server::RunHooks hooks_of(const SharedRun& run, const Ranks& ranks) {
  server::RunHooks hooks;
  hooks.on_iteration = [&](const Iteration& iteration) {
    if (iteration.number == 1 && !run.checkpoint.empty() && run.on_note)
      run.on_note(
          "The checkpoint is damaged, or of another mesh, other options or another version, so the run began anew.");
    return Control::Continue;
  };
  hooks.on_note = run.on_note;
  hooks.control.checkpoint = run.checkpoint;
  if (run.checkpoint_due) {
    hooks.control.checkpoint_due = [&](const Iteration&) { return run.checkpoint_due(); };
    hooks.control.save_checkpoint = [&](const Iteration&, const WriteCheckpoint& write) { run.save_checkpoint(write); };
  }
  hooks.given_up = [] { return false; };
  hooks.control.ranks = &ranks;
  hooks.open_output = [&](v1::MeshFormat) -> Sink {
    return ranks.is_first() ? run.open_output() : [](std::string_view) { return true; };
  };
  return hooks;
}

}  // namespace

Expected<SharedOutcome> run_shared(SharedRun run, const Ranks& ranks) {
  auto options = server::options_from(run.options);
  if (!options) return bad_option(options.error().sentence);
  if (options->threads == 0) options->threads = machine_threads();
  server::RunRequest request;
  request.input = std::make_shared<Bytes>(std::move(run.mesh));
  request.options = *options;
  request.outputs = run.outputs;
  request.keep_orders = run.keep_orders;
  SharedOutcome outcome;
  // Each rank reads and checks its copy of the mesh. One rank may fail where the others do not, so the ranks begin the
  // common work only after all have said that they can.
  bool have_met = false, go_on = false;
  server::RunHooks hooks = hooks_of(run, ranks);
  hooks.control.stop_asked = [&] { return go_on && run.stop_asked && run.stop_asked(); };
  hooks.admit = [&](std::int64_t) -> Expected<bool> {
    have_met = true;
    const auto all = ranks.agree({});
    go_on = all.has_value();
    if (go_on && run.on_begin) run.on_begin();
    return all ? Expected<bool>(true) : tl::unexpected(all.error());
  };
  auto ended = server::core_engine().run(std::move(request), hooks);
  assert(have_met || !ended);
  if (!have_met || go_on) {
    Expected<void> mine;
    if (!ended)
      mine = tl::unexpected(ended.error());
    else if (ended->unwritten && ranks.is_first())
      mine = tl::unexpected<Error>({Error::Kind::Output,
                                    "The run was interrupted, and nothing of its result came for some seconds, so it "
                                    "was not written; run it again, or choose another format."});
    const auto all = ranks.agree(mine);
    if (!all) return tl::unexpected(all.error());
  }
  if (!ended) return tl::unexpected(ended.error());
  outcome.stopped = ended->stopped;
  outcome.metrics = std::move(ended->metrics);
  outcome.history = std::move(ended->history);
  server::add_options(*options, outcome.metrics);
  return outcome;
}

}  // namespace varimesh::client
