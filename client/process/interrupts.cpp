#include "client/process/interrupts.h"

#include <pthread.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <thread>
#include <utility>

#include "client/process/exit_status.h"
#include "client/process/temporary_folder.h"

namespace varimesh::client {
namespace {

std::atomic<int> first_signal = 0;  // 0: there has been none
std::atomic<bool> first_ends = false;
std::atomic<bool> calls_go_on = false;
std::atomic<bool> says_nothing = false;

[[noreturn]] void end_at_once() {
  remove_temporary_files();
  constexpr char message[] = "varimesh: interrupted\n";
  if (!says_nothing) (void)!::write(STDERR_FILENO, message, sizeof message - 1);
  _exit(kInterrupted);
}

}  // namespace

bool interrupted() { return first_signal != 0; }
bool interrupted_by_user() { return first_signal == SIGINT; }
bool interrupt_ends_calls() { return interrupted() && !calls_go_on; }
void keep_calls_going() { calls_go_on = true; }
void say_nothing_of_interrupts() { says_nothing = true; }

void catch_interrupts() {
  static bool does = false;
  if (std::exchange(does, true)) return;
  // A thread waits for the signals, because a signal handler must not do what is needed here. All threads that are
  // started later inherit the mask and so leave the signals to this one.
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  // nohup and others have hang-ups ignored.
  struct sigaction before {};
  if (sigaction(SIGHUP, nullptr, &before) == 0 && before.sa_handler != SIG_IGN) sigaddset(&signals, SIGHUP);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  std::thread([signals] {
    for (int signal = 0; sigwait(&signals, &signal) == 0;)
      if (first_signal.exchange(signal) != 0 || first_ends) end_at_once();
  }).detach();
}

void end_at_first_interrupt() {
  first_ends = true;
  if (interrupted()) end_at_once();
}

EndAtInterrupt::EndAtInterrupt() : before_(first_ends) { end_at_first_interrupt(); }
EndAtInterrupt::~EndAtInterrupt() { first_ends = before_; }

}  // namespace varimesh::client
