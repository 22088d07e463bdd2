// varimesh ui: starts a server of the user's own with a page, and opens the page in a browser.
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iostream>
#include <regex>
#include <sstream>
#include <thread>

#include "client/client.h"
#include "client/commands/commands.h"
#include "client/library/authorisation.h"
#include "client/process/child_program.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"
#include "client/process/temporary_folder.h"
#include "core/base/io/write_all.h"
#include "core/process/helper_program.h"

namespace varimesh::client {
namespace {

struct UiFlags {
  std::string page;   ///< The address of a page that is there. Empty: that of a server of the user's own.
  std::string state;  ///< A directory for its jobs. Empty: they end with it.
  bool only_prints = false;
  Credentials credentials = credentials_from_environment();
};

std::string text_of(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

std::string first_word(const std::string& text) {
  std::istringstream words(text);
  std::string word;
  words >> word;
  return word;
}

bool is_set(const char* variable) {
  const char* value = std::getenv(variable);
  return value != nullptr && *value != '\0';
}

/// Opens an address in the browser, if there is a desktop. The token in it must not be an argument, which all users of
/// the machine can read, so the browser gets a file of this user's that leads there. Returns whether it was told.
bool open_browser(const std::string& address, const std::filesystem::path& folder) {
  const std::string opener = find_program("xdg-open");
  if (opener.empty() || !(is_set("DISPLAY") || is_set("WAYLAND_DISPLAY"))) return false;
  const std::filesystem::path file = folder / "open.html";
  const int descriptor = ::open(file.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0600);
  if (descriptor < 0) return false;
  const bool written =
      write_all(descriptor, "<!doctype html><meta http-equiv=\"refresh\" content=\"0;url=" + address + "\">\n");
  ::close(descriptor);
  constexpr double kMostSeconds = 10;
  if (!written) return false;
  const ProgramEnd end = run_program(opener, {file.string()}, folder / "opener.log", {.most_seconds = kMostSeconds});
  return end.way == ProgramEnd::Way::TimeIsOver || (end.way == ProgramEnd::Way::Exited && end.status == 0);
}

/// Whether the text is the address of a page and nothing else, so that it can stand in a file of HTML.
bool is_address(const std::string& text) {
  static const std::regex pattern(R"(https?://[A-Za-z0-9.:\[\]-]+(/[A-Za-z0-9._~/-]*)?)");
  return std::regex_match(text, pattern);
}

/// Whether nobody on the way to this address can read what is sent.
bool is_private(const std::string& address) {
  static const std::regex pattern(R"((https://|http://(localhost|127(\.[0-9]{1,3}){3}|\[::1\])(:[0-9]+)?(/|$)).*)");
  return std::regex_match(address, pattern);
}

bool is_token(const std::string& text) {
  return !text.empty() && std::ranges::all_of(text, [](unsigned char c) {
    return std::isalnum(c) != 0 || std::strchr("-._~+/=", c) != nullptr;
  });
}

/// Opens the page of a server that is there, with the token of this user.
int open_page(const UiFlags& flags) {
  if (!is_address(flags.page))
    return print_error({Error::Kind::BadOption,
                        "'" + flags.page + "' is not the address of a page; write --page http://127.0.0.1:8080/."});
  if (!is_private(flags.page))
    return print_error(
        {Error::Kind::BadOption,
         "Tokens and meshes would not be encrypted on the way to '" + flags.page +
             "'; write https://, or forward the port to this machine and write http://127.0.0.1:8080/."});
  const auto token = token_of(flags.credentials);
  if (!token) return print_error(token.error());
  if (!token->empty() && !is_token(*token))
    return print_error({Error::Kind::BadOption,
                        "The token has signs that cannot stand in an address; unset VARIMESH_TOKEN and "
                        "VARIMESH_TOKEN_FILE, and give the page the token there."});
  const TemporaryFolder folder;
  // The token stays out of the terminal: it is good for longer than this command.
  std::cout << flags.page << std::endl;
  const bool opens = !flags.only_prints && !folder.path().empty() &&
                     open_browser(token->empty() ? flags.page : flags.page + "#token=" + *token, folder.path());
  if (!opens) {
    std::cerr << "Open this address in a browser, and give the page your token if it asks for one." << std::endl;
    return kDone;
  }
  std::cerr << "If no browser opens, open this address in one, and give the page your token if it asks for one."
            << std::endl;
  // A browser that has to start first reads the file late.
  constexpr std::chrono::seconds kForBrowser{30};
  constexpr std::chrono::milliseconds kBetweenLooks{50};
  std::cerr << "The file that leads the browser there is deleted after " << kForBrowser.count()
            << " s; Ctrl-C deletes it at once." << std::endl;
  const auto end = std::chrono::steady_clock::now() + kForBrowser;
  while (!interrupted() && std::chrono::steady_clock::now() < end) std::this_thread::sleep_for(kBetweenLooks);
  return kDone;
}

/// Makes a token for the server. Returns "" if that is not possible.
std::string make_token(const std::string& program, const std::filesystem::path& folder) {
  const auto printed = folder / "token";
  const ProgramEnd end = run_program(program, {"token", "me", "--tokens", (folder / "tokens").string()}, printed);
  const std::string token = first_word(text_of(printed));
  std::filesystem::remove(printed);
  return end.way == ProgramEnd::Way::Exited && end.status == 0 && is_token(token) ? token : "";
}

/// A script that runs a server, and ends it when it is told to or when this command is gone, even if it was killed. It
/// removes the folder of a command that is gone. $1 is the process of this command, $2 is the folder, and the other
/// arguments are the server's command line.
constexpr const char* kKeeper = R"(command=$1; folder=$2; shift 2; told=
trap 'told=yes' TERM INT HUP
"$@" & server=$!
while [ -z "$told" ] && kill -0 "$command" 2>/dev/null && kill -0 "$server" 2>/dev/null; do sleep 0.5; done
kill "$server" 2>/dev/null
while kill -0 "$server" 2>/dev/null; do wait "$server"; done
kill -0 "$command" 2>/dev/null || rm -rf "$folder")";

/// Runs a server until it is interrupted.
int serve(const UiFlags& flags) {
  std::string program = find_helper("varimeshd", "VARIMESHD");
  if (program.empty()) program = find_program("varimeshd");
  if (program.empty())
    return print_error(
        {Error::Kind::BadOption,
         "There is no varimeshd that can be run; install it, set VARIMESHD to its path, or name the page "
         "of a server with --page."});
  const TemporaryFolder folder;
  if (folder.path().empty())
    return print_error(
        {Error::Kind::Output, "No temporary folder can be made; set TMPDIR to a folder where files can be made."});
  const std::string token = make_token(program, folder.path());
  if (token.empty())
    return print_error({Error::Kind::Internal, program + " made no token for the page; run 'varimesh doctor'."});
  std::vector<std::string> arguments{"-c",
                                     kKeeper,
                                     "varimeshd",
                                     std::to_string(::getpid()),
                                     folder.path().string(),
                                     program,
                                     "--listen",
                                     "unix:" + (folder.path() / "socket").string(),
                                     "--http",
                                     "127.0.0.1:0",
                                     "--tokens",
                                     (folder.path() / "tokens").string()};
  if (!flags.state.empty()) arguments.insert(arguments.end(), {"--state", flags.state});
  const bool keeps_jobs = !flags.state.empty() || is_set("VARIMESH_STATE");
  const auto log = folder.path() / "log";
  bool is_open = false;
  Meanwhile meanwhile{.seconds_between = 0.1, .end_signal = SIGTERM};
  meanwhile.on_second = [&] {
    static const std::regex place(R"((http://\S+/)v1/)");
    std::smatch found;
    const std::string text = is_open ? "" : text_of(log);
    if (!std::regex_search(text, found, place)) return;
    is_open = true;
    const std::string address = found[1].str() + "#token=" + token;
    std::cout << address << std::endl;
    std::cerr << "Open this address in a browser. Without the part after '#', nobody else on this machine can use it. "
                 "Ctrl-C ends the server"
              << (keeps_jobs ? "; its jobs stay." : ", and its jobs with it.") << std::endl;
    if (!flags.only_prints) open_browser(address, folder.path());
  };
  run_program("/bin/sh", arguments, log, meanwhile);
  if (interrupted()) return kDone;
  return print_error({Error::Kind::Internal, "The server of the page has ended: " + text_of(log)});
}

}  // namespace

Action add_ui(Command program) {
  auto flags = std::make_shared<UiFlags>();
  Command command = program.add_command(
      "ui", "Open a page in a browser: look at a mesh, optimise it and download the result; with a server of your own");
  command
      .add("--page", &flags->page,
           "Open the page of a running server (varimeshd --http), such as http://127.0.0.1:8080/; the page gets "
           "the token in VARIMESH_TOKEN or VARIMESH_TOKEN_FILE")
      .value("ADDRESS");
  command
      .add("--state", &flags->state,
           "Directory in which your own server keeps jobs, meshes and results; default: the environment variable "
           "VARIMESH_STATE; without it they are deleted when the command ends")
      .value("DIR")
      .excludes("--page");
  command.add("--only-print", &flags->only_prints, "Print the address and open no browser");
  return [flags] { return flags->page.empty() ? serve(*flags) : open_page(*flags); };
}

}  // namespace varimesh::client
