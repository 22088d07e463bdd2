#include "client/cli/command_facts.h"

#include <CLI/CLI.hpp>
#include <array>

#include "client/cli/names.h"
#include "client/process/exit_status.h"
#include "core/command_line/parsed_facts.h"
#include "varimesh/v1/job.pb.h"

namespace varimesh::client {
namespace {

constexpr std::array kExamples{
    Example{"", "optimise a mesh on this machine", "varimesh optimise wing.msh -o better.msh -o better.vtu"},
    Example{"", "the same on a server", "varimesh optimise wing.msh -o better.msh --server HOST:PORT"},
    Example{"", "check that every element is proved valid", "varimesh quality better.msh --certify"},
    Example{"", "show versions, threads and disk space of this machine", "varimesh doctor"},
    Example{"optimise", "write the result in the format of the input, and for ParaView",
            "varimesh optimise wing.msh -o better.msh -o better.vtu"},
    Example{"optimise", "write a page that shows the result",
            "varimesh optimise wing.msh -o better.msh --report wing.html"},
    Example{"optimise", "stop when every element is certified valid or cannot be repaired",
            "varimesh optimise wing.msh -o better.msh --until valid"},
    Example{"optimise", "several meshes side by side, each with its result in a folder",
            "varimesh optimise wing.msh better.msh --into optimised"},
    Example{"optimise", "use another energy, on a server",
            "varimesh optimise wing.msh -o better.msh --energy winslow --server HOST:PORT"},
    Example{"optimise", "for scripts: print a JSON document and write all iterations",
            "varimesh optimise wing.msh -o better.msh --json --history history.csv"},
    Example{"optimise", "move nodes only near poor elements",
            "varimesh optimise wing.msh -o better.msh --region-below 0.5 --rings 2"},
    Example{"curve", "curve a straight mesh with the model from which it was made",
            "varimesh curve linear.msh --geometry part.step --order 4 -o curved.msh"},
    Example{"mesh", "from a model to a certified mesh of order 3; edges are at most 5 mm long",
            "varimesh mesh part.step --size 5 --order 3 --repair split -o part.msh"},
    Example{"submit", "submit a job and print its name", "varimesh submit wing.msh --server HOST:PORT"},
    Example{"submit", "safe to repeat, because the same request id gives the same job",
            "varimesh submit wing.msh --server HOST:PORT --request-id wing-1 --label case=wing"},
    Example{"submit", "a job for each of several meshes",
            "varimesh submit wing.msh better.msh --server HOST:PORT --label run=17"},
    Example{"submit", "ask for the result in two formats",
            "varimesh submit wing.msh --server HOST:PORT --output-format msh41-binary --output-format vtu"},
    Example{"watch", "follow a job; Ctrl-C stops watching, and the job goes on",
            "varimesh watch JOB --server HOST:PORT"},
    Example{"logs", "print what has happened to a job", "varimesh logs JOB --server HOST:PORT"},
    Example{"result", "fetch the mesh", "varimesh result JOB --server HOST:PORT -o better.msh"},
    Example{"wait", "wait for all jobs with a label", "varimesh wait --all --label run=17 --server HOST:PORT"},
    Example{"results", "fetch the meshes of all jobs with a label",
            "varimesh results --label run=17 --into DIR --server HOST:PORT"},
    Example{"cancel", "end a job and keep its best mesh", "varimesh cancel JOB --server HOST:PORT"},
    Example{"delete", "delete a job and its results", "varimesh delete JOB --server HOST:PORT"},
    Example{"jobs", "list the jobs that are running", "varimesh jobs --server HOST:PORT --state running"},
    Example{"jobs", "for scripts: list the jobs with a label",
            "varimesh jobs --server HOST:PORT --label case=wing --json"},
    Example{"jobs", "watch jobs until all have ended", "varimesh jobs --server HOST:PORT --label run=17 --watch"},
    Example{"info", "show the formats, energies and limits of a server", "varimesh info --server HOST:PORT"},
    Example{"quality", "print a table", "varimesh quality wing.msh"},
    Example{"quality", "exit with status 4 if an element is not certified valid",
            "varimesh quality wing.msh --certify"},
    Example{"quality", "say which elements cannot be repaired and why, and mark them for a viewer",
            "varimesh quality wing.msh --diagnose -o marked.vtu"},
    Example{"layers", "split one thick layer at the wing into 20 thin ones",
            "varimesh layers thick.msh --wall wing --layers 20 --first 1e-5 -o thin.msh"},
    Example{"layers", "grow a thick layer on a mesh of triangles or tetrahedra first",
            "varimesh layers tetrahedra.msh --wall wing --grow 0.05 --layers 20 --first 1e-5 -o thin.msh"},
    Example{"layers", "choose the first height such that y+ is 1",
            "varimesh layers thick.msh --wall wing --reynolds 1e6 --length 1 --growth 1.3 -o thin.msh"},
    Example{"convert", "write a mesh for ParaView", "varimesh convert wing.msh wing.vtu"},
    Example{"convert", "write a mesh for MFEM", "varimesh convert wing.msh wing.mesh"},
    Example{"convert", "write a mesh for Nektar++", "varimesh convert wing.msh wing.xml"},
    Example{"convert", "write Gmsh's binary format", "varimesh convert wing.msh binary.msh --format msh41-binary"},
    Example{"doctor", "check this machine", "varimesh doctor"},
    Example{"doctor", "check this machine and a server", "varimesh doctor --server HOST:PORT"},
    Example{"ui", "look at meshes and optimise them in a browser", "varimesh ui"},
    Example{"ui", "the same with the page of a running server", "varimesh ui --page http://127.0.0.1:8080/"},
    Example{"certificates", "make certificates for a server on this machine, and for two clients",
            "varimesh certificates DIR --client ann --client bob"},
    Example{"completion", "print the completion script for bash", "varimesh completion bash"},
    Example{"man", "print the manual page of a command, as troff", "varimesh man optimise"},
};

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts{""};
  for (const char c : text)
    if (c == separator)
      parts.emplace_back();
    else
      parts.back() += c;
  return parts;
}

/// The possible values of a flag: those in its placeholder, the formats, or the states of a job.
std::vector<std::string> choices_of(const CLI::Option& option, const std::string& value) {
  if (value.find('|') != std::string::npos) return split(value, '|');
  if (option.check_lname("format") || option.check_lname("output-format"))
    return spellings(*v1::MeshFormat_descriptor());
  if (option.check_lname("state")) return spellings(*v1::JobState_descriptor());
  return {};
}

FlagFacts with_choices(const CLI::Option& option) {
  FlagFacts facts = parsed_facts(option);
  facts.choices = choices_of(option, facts.value);
  return facts;
}

}  // namespace

std::span<const Example> all_examples() { return kExamples; }

CommandFacts facts_of(const CLI::App& command) { return parsed_facts(command, kExamples, with_choices); }

std::vector<CommandFacts> subcommand_facts(const CLI::App& program) {
  return parsed_subcommands(program, kExamples, with_choices);
}

ProgramFacts program_facts(const CLI::App& program) {
  ProgramFacts facts{.name = "varimesh", .itself = facts_of(program), .commands = subcommand_facts(program)};
  facts.needs_command = true;
  facts.exit_statuses = exit_statuses();
  return facts;
}

}  // namespace varimesh::client
