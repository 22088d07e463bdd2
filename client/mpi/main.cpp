// varimesh-mpi: the command as one of several processes that mpirun or srun started. They share the work on one mesh,
// and the first one prints what `varimesh` alone would print.
#include <exception>
#include <iostream>
#include <new>
#include <optional>
#include <streambuf>

#include "client/commands/commands.h"
#include "client/mpi/optimise_of_ranks.h"
#include "client/mpi/quality_of_ranks.h"
#include "client/mpi/read_everywhere.h"
#include "client/mpi/streams_in_turn.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"
#include "core/mpi/mpi_ranks.h"

namespace {

using namespace varimesh;

/// Takes everything and writes nothing.
class Nowhere : public std::streambuf {
  int overflow(int character) override { return traits_type::not_eof(character); }
};

/// The others wait for this rank, which can go on no more. So all end, and this rank says why.
[[noreturn]] void give_up(std::streambuf* standard_error, const std::string& why) {
  std::cerr.rdbuf(standard_error);
  std::cerr << "varimesh: " << why << std::endl;
  MpiSession::abort(client::kJobFailed);
}

}  // namespace

int main(int argc, char** argv) {
  client::catch_interrupts();  // MPI starts threads, which must leave the signals alone
  const MpiSession session;
  Nowhere nowhere;
  std::optional<client::StreamsInTurn> in_turn;
  std::streambuf *const standard_output = std::cout.rdbuf(), *const standard_error = std::cerr.rdbuf();
  if (session.ranks().is_first()) {
    in_turn.emplace();
  } else {
    std::cout.rdbuf(&nowhere);
    std::cerr.rdbuf(&nowhere);
  }
  // If one rank ends with a sentence, mpirun interrupts the others, and they have nothing to add. The first rank says
  // how a run ended that was interrupted.
  client::say_nothing_of_interrupts();
  const auto together = [&](const char* no_room, const auto& work) {
    try {
      return work();
    } catch (const std::bad_alloc&) {
      in_turn.reset();  // writes what waits
      give_up(standard_error, no_room);
    } catch (const std::exception& error) {
      in_turn.reset();
      give_up(standard_error, std::string("a rank ended unexpectedly (") + error.what() + "); please report it.");
    }
  };
  const client::QualityRun quality = [&](const client::QualityArguments& arguments) {
    return together(client::kNoRoomForPart, [&] { return client::quality_of_ranks(arguments, session.ranks()); });
  };
  const client::OptimiseRun optimise = [&](const client::OptimiseArguments& arguments) {
    return together(client::kNoRoomForMesh, [&] { return client::optimise_of_ranks(arguments, session.ranks()); });
  };
  const int status = client::run_program(
      argc, argv, [&](client::Command program) { return client::add_commands_of_ranks(program, quality, optimise); });
  in_turn.reset();
  std::cout.rdbuf(standard_output);
  std::cerr.rdbuf(standard_error);
  // mpirun ends all ranks as soon as one returns a failure, perhaps before the first rank has said why. So the first
  // rank returns the highest status, and the others return 0.
  double highest = status;
  session.ranks().largest({&highest, 1});
  return session.ranks().is_first() ? static_cast<int>(highest) : 0;
}
