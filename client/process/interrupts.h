// What Ctrl-C (SIGINT) and SIGTERM do: the first asks the command to stop in an orderly way, the second ends the
// process at once.
#pragma once

namespace varimesh::client {

/// Starts to count interrupts. Call it first, before any thread is started.
void catch_interrupts();

/// How many interrupts there have been. A command that has something to put in order, such as a job to cancel, stops
/// when this is no longer 0. A second interrupt ends the process at once, after remove_temporary_files().
int interrupt_count();

/// From now on the first interrupt ends the process too. For commands that have nothing to put in order.
void end_at_first_interrupt();

}  // namespace varimesh::client
