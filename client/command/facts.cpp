// The table of examples, and the parser's own tables put into words.
#include "client/command/facts.h"

#include <algorithm>
#include <array>

#include "client/command/names.h"
#include "varimesh/v1/job.pb.h"

namespace varimesh::client {
namespace {

constexpr std::array kExamples{
    Example{"", "a mesh in, a better one out, here", "varimesh optimise wing.msh -o better.msh -o better.vtu"},
    Example{"", "the same on a server", "varimesh optimise wing.msh -o better.msh --server HOST:PORT"},
    Example{"", "how good is it, and is every element proved valid?", "varimesh quality better.msh --certify"},
    Example{"", "what this machine has", "varimesh doctor"},
    Example{"optimise", "here, as the format it was read in and for ParaView",
            "varimesh optimise wing.msh -o better.msh -o better.vtu"},
    Example{"optimise", "on a server, by another energy",
            "varimesh optimise wing.msh -o better.msh --energy winslow --server HOST:PORT"},
    Example{"optimise", "stop as soon as every element is certified valid, or named unrepairable",
            "varimesh optimise wing.msh -o better.msh --until valid"},
    Example{"optimise", "for scripts: a document, and every iteration",
            "varimesh optimise wing.msh -o better.msh --json --history history.csv"},
    Example{"optimise", "and a page to look at", "varimesh optimise wing.msh -o better.msh --report wing.html"},
    Example{"optimise", "only near what is bad",
            "varimesh optimise wing.msh -o better.msh --region-below 0.5 --rings 2"},
    Example{"submit", "print the job's name, and leave", "varimesh submit wing.msh --server HOST:PORT"},
    Example{"submit", "safe to repeat: the same id is the same job",
            "varimesh submit wing.msh --server HOST:PORT --request-id wing-1 --label case=wing"},
    Example{"submit", "a result in two formats",
            "varimesh submit wing.msh --server HOST:PORT --output-format msh41-binary --output-format vtu"},
    Example{"watch", "follow it to its end; Ctrl-C leaves it running", "varimesh watch JOB --server HOST:PORT"},
    Example{"result", "fetch the mesh", "varimesh result JOB --server HOST:PORT -o better.msh"},
    Example{"cancel", "it ends at its next iteration, and its best mesh is kept",
            "varimesh cancel JOB --server HOST:PORT"},
    Example{"delete", "forget it and its results", "varimesh delete JOB --server HOST:PORT"},
    Example{"jobs", "what runs", "varimesh jobs --server HOST:PORT --state running"},
    Example{"jobs", "one's own, for a script", "varimesh jobs --server HOST:PORT --label case=wing --json"},
    Example{"info", "formats, energies and limits of a server", "varimesh info --server HOST:PORT"},
    Example{"quality", "a table", "varimesh quality wing.msh"},
    Example{"quality", "status 4 where an element is not certified valid", "varimesh quality wing.msh --certify"},
    Example{"quality", "what moving nodes cannot repair, in sentences and marked for a viewer",
            "varimesh quality wing.msh --diagnose -o marked.vtu"},
    Example{"convert", "for ParaView", "varimesh convert wing.msh wing.vtu"},
    Example{"convert", "to Gmsh's binary format", "varimesh convert wing.msh binary.msh --format msh41-binary"},
    Example{"doctor", "this machine", "varimesh doctor"},
    Example{"doctor", "and whether a server answers", "varimesh doctor --server HOST:PORT"},
    Example{"completion", "for this shell", "varimesh completion bash"},
    Example{"man", "the manual of a command, as troff", "varimesh man optimise"},
};

constexpr std::array<std::string_view, 7> kStatuses{
    "0 done, and every element is certified valid",
    "1 the job failed, or was cancelled by someone else",
    "2 usage",
    "3 the input was refused, or the output cannot be written",
    "4 done, but some elements are not certified valid",
    "5 the server or the way to it failed",
    "130 interrupted",
};

std::vector<std::string> split(const std::string& text, char at) {
  std::vector<std::string> parts{""};
  for (const char c : text)
    if (c == at)
      parts.emplace_back();
    else
      parts.back() += c;
  return parts;
}

/// Where the value is one of a few, which: the flag's own list, the formats, or the states.
std::vector<std::string> choices_of(const CLI::Option& option, const std::string& value) {
  if (value.find('|') != std::string::npos) return split(value, '|');
  if (option.check_lname("format") || option.check_lname("output-format"))
    return spellings(*v1::MeshFormat_descriptor());
  if (option.check_lname("state")) return spellings(*v1::JobState_descriptor());
  return {};
}

FlagFacts facts_of(const CLI::Option& option) {
  FlagFacts facts;
  facts.argument = option.get_positional();
  if (option.get_type_size() != 0) facts.value = split(option.get_type_name(), ':').front();  // what is checked follows
  if (facts.argument) {
    facts.names = {facts.value == "TEXT" || facts.value == "text" ? option.get_name(true) : facts.value};
    std::transform(facts.names[0].begin(), facts.names[0].end(), facts.names[0].begin(), ::toupper);
  }
  if (!facts.argument) {
    for (const std::string& name : option.get_snames()) facts.names.push_back("-" + name);
    for (const std::string& name : option.get_lnames()) facts.names.push_back("--" + name);
  }
  facts.choices = choices_of(option, facts.value);
  facts.help = option.get_description();
  facts.group = option.get_group();
  constexpr std::array files{"IN", "OUT", "MESH", "DIR"};
  facts.file = facts.value.rfind("FILE", 0) == 0 || std::find(files.begin(), files.end(), facts.value) != files.end();
  facts.required = option.get_required();
  facts.repeated = option.get_expected_max() > 1 && !facts.argument;
  return facts;
}

}  // namespace

std::span<const Example> all_examples() { return kExamples; }
std::span<const std::string_view> exit_statuses() { return kStatuses; }

CommandFacts facts_of(const CLI::App& command) {
  CommandFacts facts;
  if (command.get_parent() != nullptr) facts.name = command.get_name();
  facts.purpose = command.get_description();
  for (const Example& example : kExamples)
    if (example.command == facts.name) facts.examples.push_back(example);
  for (const CLI::Option* option : command.get_options()) facts.flags.push_back(facts_of(*option));
  return facts;
}

std::vector<CommandFacts> subcommand_facts(const CLI::App& program) {
  std::vector<CommandFacts> all;
  for (const CLI::App* command : program.get_subcommands([](const CLI::App*) { return true; }))
    all.push_back(facts_of(*command));
  return all;
}

}  // namespace varimesh::client
