// What Ctrl-C (SIGINT), SIGTERM and the end of the terminal (SIGHUP) do: the first asks the command to end in an
// orderly way, which keeps the work that is done so far; the second ends the process at once.
#pragma once

namespace varimesh::client {

/// Starts to count interrupts, once. Call it first, before any thread is started.
void catch_interrupts();

/// Whether there has been an interrupt. A command that has something to put in order, such as a job to cancel, does so
/// when this is true. A second interrupt ends the process at once, after remove_temporary_files().
bool interrupted();
/// Whether the interrupt was Ctrl-C, so that somebody may sit at the terminal. False if there was none.
bool interrupted_by_user();

/// Whether calls under way and reading from pipes are to end because of an interrupt.
bool interrupt_ends_calls();
/// From now on an interrupt does not end calls, because the command needs them to deliver the work done so far.
void keep_calls_going();

/// From now on the first interrupt ends the process too. For commands that have nothing to put in order.
void end_at_first_interrupt();

/// From now on a process that an interrupt ends at once says nothing of it.
void say_nothing_of_interrupts();

/// While this object lives, the first interrupt ends the process, or at once if there has been one. For a part of a
/// command that looks at no interrupts and leaves nothing that is worth keeping.
class EndAtInterrupt {
 public:
  EndAtInterrupt();
  ~EndAtInterrupt();
  EndAtInterrupt(const EndAtInterrupt&) = delete;
  EndAtInterrupt& operator=(const EndAtInterrupt&) = delete;

 private:
  bool before_;
};

}  // namespace varimesh::client
