#include "client/jobs/result_files.h"

#include <array>
#include <fstream>
#include <map>

#include "client/cli/names.h"
#include "core/base/sha256.h"
#include "core/base/utf8.h"
#include "core/formats/formats.h"

namespace varimesh::client {
namespace {

std::string identifier_of(const v1::Job& job) { return job.name().substr(job.name().rfind('/') + 1); }

/// Labels come from anybody who may submit jobs, so a path or a control character in them must do no harm.
bool is_plain_name(const std::string& name) {
  return !name.empty() && name.front() != '.' && name.find('/') == std::string::npos && as_plain_text(name) == name;
}

/// The name of the job's input without its ending.
std::string stem_of(const v1::Job& job) {
  const auto label = job.spec().labels().find("file");
  if (label == job.spec().labels().end() || !is_plain_name(label->second)) return identifier_of(job);
  return std::filesystem::path(label->second).stem().string();
}

std::string ending_of(v1::MeshFormat format) {
  for (const formats::FormatInfo& info : formats::all())
    if (info.name == spelled(format)) return std::string(info.extension);
  return ".msh";
}

}  // namespace

std::vector<ResultFile> result_files(const std::vector<v1::Job>& jobs, const std::filesystem::path& folder) {
  std::map<std::string, int> of_job, of_all;  // How many results would have a name.
  std::map<std::string, std::string> first_job;
  for (const v1::Job& job : jobs)
    for (const v1::StoredMesh& mesh : job.results()) {
      const std::string name = stem_of(job) + ending_of(mesh.format());
      ++of_job[job.name() + "/" + name];
      if (first_job.insert({name, job.name()}).first->second != job.name()) of_all[name] = 2;
    }
  std::vector<ResultFile> files;
  for (const v1::Job& job : jobs)
    for (const v1::StoredMesh& mesh : job.results()) {
      const std::string ending = ending_of(mesh.format()), name = stem_of(job) + ending;
      std::string own = stem_of(job);
      if (of_all[name] > 1) own += "-" + identifier_of(job);
      if (of_job[job.name() + "/" + name] > 1) own += "-" + spelled(mesh.format());
      files.push_back({&job, mesh, folder / (own + ending)});
    }
  return files;
}

Expected<void> make_folder(const std::string& path) {
  std::error_code error, ignored;
  std::filesystem::create_directories(path, error);
  if (std::filesystem::is_directory(path, ignored)) return {};
  return tl::unexpected(Error{Error::Kind::Output, "The folder " + path + " cannot be made" +
                                                       (error ? ": " + error.message() : std::string()) + "."});
}

Expected<AtPath> what_is_at(const ResultFile& file) {
  std::error_code error;
  if (!std::filesystem::exists(std::filesystem::symlink_status(file.path, error))) return AtPath::Nothing;
  std::ifstream stream(file.path, std::ios::binary);
  Sha256 digest;
  std::array<char, 1 << 16> bytes{};
  while (stream) {
    stream.read(bytes.data(), std::ssize(bytes));
    digest.update({bytes.data(), static_cast<std::size_t>(stream.gcount())});
  }
  if (!stream.eof()) return bad_input("The file " + file.path.string() + " is in the way and cannot be read.");
  return digest.finish() == file.mesh.digest() ? AtPath::TheResult : AtPath::Another;
}

}  // namespace varimesh::client
