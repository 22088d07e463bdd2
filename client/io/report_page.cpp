#include "client/io/report_page.h"

#include <fmt/format.h>
#include <google/protobuf/util/time_util.h>

#include <algorithm>
#include <filesystem>
#include <sstream>

#include "client/cli/names.h"
#include "client/cli/option_flags.h"
#include "client/io/documents.h"
#include "client/io/summary.h"
#include "client/library/failures.h"
#include "client/process/interrupts.h"
#include "client/process/temporary_folder.h"
#include "client/report/report.h"
#include "core/base/sha256.h"
#include "core/base/team.h"
#include "core/base/version.h"
#include "core/command_line/facts.h"
#include "core/formats/formats.h"
#include "core/mesh/changes/change_order.h"
#include "core/mesh/plane.h"
#include "core/options/option_table.h"

namespace varimesh::client {
namespace {

using google::protobuf::util::TimeUtil;

/// Whether a mesh is in messages, from a program that has it in arrays. Only the service reads these.
bool is_parts(v1::MeshFormat format) { return format == v1::MESH_FORMAT_PARTS; }

/// Has the service write a mesh as an MSH file, in a job that judges it, and fetches the file.
Outcome<void> fetch_as_msh(Client* client, const v1::StoredMesh& stored, const std::filesystem::path& file) {
  v1::JobSpec spec;
  spec.mutable_quality();
  spec.mutable_mesh()->set_digest(stored.digest());
  spec.mutable_mesh()->set_format(stored.format());
  spec.add_outputs(v1::MESH_FORMAT_MSH41_BINARY);
  const auto job = client->submit(spec);
  if (!job) return tl::unexpected(job.error());
  const auto goes_on = [] { return !interrupt_ends_calls(); };
  const auto ended = client->watch(
      job->name(), 0, [](const v1::JobEvent&) { return true; }, goes_on);
  if (!ended) {
    // A job that still waits can be removed then. One that runs ends soon.
    if (ended.error().kind != Failure::Kind::Transport && client->cancel(job->name())) client->remove(job->name());
    return tl::unexpected(ended.error());
  }
  const auto written =
      ended->results_size() > 0
          ? client->download(ended->results(0), file)
          : Outcome<void>(file_failure(
                "The service could not write the mesh for the report: " + ended->error().message(), "BAD_INPUT"));
  if (const auto removed = client->remove(job->name()); written && !removed) return removed;
  return written;
}

/// Fetches a mesh from the server by way of the temporary file `file`.
Outcome<std::shared_ptr<const HighOrderMesh>> fetch_mesh(Client* client, const v1::StoredMesh& stored,
                                                         const std::filesystem::path& file) {
  const auto done = readable(stored.format()) ? client->download(stored, file) : fetch_as_msh(client, stored, file);
  if (!done) return tl::unexpected(done.error());
  auto read = formats::read_file(file);
  std::filesystem::remove(file);
  if (!read) return file_failure(read.error().sentence, "BAD_INPUT");
  return std::make_shared<const HighOrderMesh>(std::move(read->mesh));
}

/// The mesh of the job, in the order of its result.
Outcome<std::shared_ptr<const HighOrderMesh>> fetch_before(Client* client, const v1::Job& job,
                                                           const std::filesystem::path& file) {
  v1::StoredMesh stored;
  stored.set_digest(job.spec().mesh().digest());
  stored.set_format(job.spec().mesh().format());
  auto before = fetch_mesh(client, stored, file);
  const int order = std::max(job.spec().options().order(), job.spec().geometry().order());
  if (!before || order == 0) return before;
  auto changed = change_order(**before, order);
  if (!changed) return file_failure(changed.error().sentence, "BAD_INPUT");
  return std::make_shared<const HighOrderMesh>(std::move(*changed));
}

/// Puts the meshes of a job in any plane in space into z = 0, where the pictures show them.
void show_in_its_plane(Report* report) {
  const Team team(1);
  team.run([&] {
    auto plane = Plane::of(*report->before, team);
    if (!plane) return;
    for (auto* shown : {&report->before, &report->after}) {
      auto flat = std::make_shared<HighOrderMesh>(**shown);
      plane->flatten(*flat);
      *shown = std::move(flat);
    }
  });
}

/// Sets the report's meshes, or the sentence that says why there are none.
Outcome<void> fetch_meshes(Client* client, const v1::Job& job, Report* report) {
  const auto& results = job.results();
  const auto has = [](auto may) { return [may](const v1::StoredMesh& one) { return may(one.format()); }; };
  auto result = std::find_if(results.begin(), results.end(), has(readable));
  if (result == results.end()) result = std::find_if(results.begin(), results.end(), has(is_parts));
  const v1::MeshFormat input = job.spec().mesh().format();
  if (!(readable(input) || is_parts(input)) || result == results.end()) {
    report->picture_note =
        "There is no picture, because the input or every result of this job has a format that cannot be read here. "
        "Submit an MSH file, and request one among the outputs.";
    return {};
  }
  const TemporaryFolder folder;
  if (folder.path().empty())
    return file_failure(
        "No temporary folder can be made for the report's meshes; set TMPDIR to a folder where files can be made.",
        "OUTPUT");
  auto before = fetch_before(client, job, folder.path() / "before");
  if (!before) return tl::unexpected(before.error());
  report->before = *before;
  auto after = fetch_mesh(client, *result, folder.path() / "after");
  if (!after) return tl::unexpected(after.error());
  report->after = *after;
  show_in_its_plane(report);
  return {};
}

/// The value of a field in the spelling of its flag.
std::string spelled_value(const v1::Options& options, const google::protobuf::FieldDescriptor& field) {
  const auto* reflection = v1::Options::GetReflection();
  switch (field.cpp_type()) {
    case google::protobuf::FieldDescriptor::CPPTYPE_ENUM:
      return spelled(*reflection->GetEnum(options, &field));
    case google::protobuf::FieldDescriptor::CPPTYPE_DOUBLE:
      return fmt::format("{:.6g}", reflection->GetDouble(options, &field));
    case google::protobuf::FieldDescriptor::CPPTYPE_BOOL:
      return reflection->GetBool(options, &field) ? "on" : "off";
    case google::protobuf::FieldDescriptor::CPPTYPE_INT32:
      return std::to_string(reflection->GetInt32(options, &field));
    default:
      return fmt::format("{} values", options.target_field().values_size());
  }
}

/// All values of a repeated field, with commas between them.
std::string spelled_list(const v1::Options& options, const google::protobuf::FieldDescriptor& field) {
  const auto* reflection = v1::Options::GetReflection();
  const bool is_text = field.cpp_type() == google::protobuf::FieldDescriptor::CPPTYPE_STRING;
  std::vector<std::string> values;
  for (int i = 0; i < reflection->FieldSize(options, &field); ++i)
    values.push_back(is_text ? reflection->GetRepeatedString(options, &field, i)
                             : std::to_string(reflection->GetRepeatedInt64(options, &field, i)));
  return joined(values, ", ");
}

/// All options as flags: [{"name", "value", "help"}]. The value of an option that was not given is "".
Json options_document(const v1::Options& options) {
  const auto* reflection = v1::Options::GetReflection();
  Json rows = Json::array();
  for (const OptionInfo& option : option_table()) {
    const auto* field = v1::Options::descriptor()->FindFieldByName(std::string(option.name));
    std::string text;
    if (field->is_repeated())
      text = spelled_list(options, *field);
    else if (reflection->HasField(options, field))
      text = spelled_value(options, *field);
    rows.push_back({{"name", "--" + dashed(std::string(option.name))}, {"value", text}, {"help", help_text(option)}});
  }
  return rows;
}

/// The history as one list per column.
Json history_document(const std::vector<v1::Iteration>& history) {
  Json columns = {{"iteration", Json::array()},        {"phase", Json::array()},
                  {"energy", Json::array()},           {"residual", Json::array()},
                  {"seconds", Json::array()},          {"min_scaled_jacobian", Json::array()},
                  {"invalid_elements", Json::array()}, {"active_nodes", Json::array()}};
  for (const v1::Iteration& one : history) {
    columns["iteration"].push_back(one.number());
    columns["phase"].push_back(spelled(one.phase()));
    columns["energy"].push_back(one.energy());
    columns["residual"].push_back(one.residual());
    columns["seconds"].push_back(one.seconds());
    columns["min_scaled_jacobian"].push_back(one.min_scaled_jacobian());
    columns["invalid_elements"].push_back(one.invalid_elements());
    columns["active_nodes"].push_back(one.active_nodes());
  }
  return columns;
}

std::string time_text(const google::protobuf::Timestamp& time) {
  return time.seconds() == 0 ? "–" : TimeUtil::ToString(TimeUtil::SecondsToTimestamp(time.seconds()));
}

/// Adds what came of layers, one line each.
void add_layers_text(const v1::LayersReport& layers, Report& report) {
  std::istringstream lines(layers_text(layers));
  for (std::string line; std::getline(lines, line);) report.document["layers_text"].push_back(line);
}

Marks marks_of(const v1::Metrics& metrics) {
  Marks marks;
  for (const auto& [snapshot, quality] : {std::pair{0U, &metrics.before()}, std::pair{1U, &metrics.after()}})
    for (const v1::UncertifiedElement& element : quality->certified().uncertified())
      marks.uncertified[snapshot].insert(element.number());
  for (const v1::UnrepairableGroup& group : metrics.unrepairable())
    marks.unrepairable.insert(group.elements().begin(), group.elements().end());
  return marks;
}

BoundaryDistanceArrays distances_of(const v1::GeometryReport& geometry) {
  const v1::ElementDistances& elements = geometry.elements();
  BoundaryDistanceArrays arrays;
  arrays.numbers.assign(elements.numbers().begin(), elements.numbers().end());
  arrays.surfaces.assign(elements.surfaces().begin(), elements.surfaces().end());
  for (std::int32_t& surface : arrays.surfaces)
    if (surface >= geometry.surfaces_size()) surface = -1;
  // Without distances before, the mesh was curved, and both pictures have the colours of the result.
  const auto& before = elements.before_size() > 0 ? elements.before() : elements.after();
  arrays.distances[0].assign(before.begin(), before.end());
  arrays.distances[1].assign(elements.after().begin(), elements.after().end());
  return arrays;
}

/// What the page says of a run, without its meshes and where these come from.
Report report_of(const v1::Metrics& metrics, const v1::Options& options, const std::vector<v1::Iteration>& history) {
  Report report;
  report.document = document(metrics);
  for (const std::string& text : {done_text(metrics), objective_text(metrics, options), worse_text(metrics)})
    if (!text.empty()) report.document["aims"].push_back(text);
  if (metrics.layers().has_thick()) add_layers_text(metrics.layers(), report);
  for (const auto& [snapshot, quality] : {std::pair{"before", &metrics.before()}, std::pair{"after", &metrics.after()}})
    report.histograms[snapshot] = std::vector<std::int64_t>(quality->histogram().begin(), quality->histogram().end());
  report.history = history_document(history);
  report.options = options_document(options);
  report.marks = marks_of(metrics);
  return report;
}

/// Where the result comes from: [[name, text], …].
Json origin_document(const v1::Job& job, const std::string& input, const std::string& server_version) {
  Json origin = Json::array();
  if (!input.empty()) origin.push_back({"mesh", input});
  origin.push_back({"mesh, SHA-256", job.spec().mesh().digest()});
  origin.push_back({"job", job.name()});
  for (const auto& [key, value] : job.spec().labels()) origin.push_back({"label " + key, value});
  origin.push_back({"varimesh, the command", std::string(version())});
  origin.push_back({"varimesh, the service", server_version});
  origin.push_back({"submitted", time_text(job.create_time())});
  origin.push_back({"started", time_text(job.start_time())});
  origin.push_back({"ended", time_text(job.end_time())});
  return origin;
}

/// The last part of the path, by which a reader knows the mesh.
std::string title_of(const std::string& input) { return std::filesystem::path(input).filename().string(); }

}  // namespace

bool readable(v1::MeshFormat format) {
  if (format == v1::MESH_FORMAT_UNSPECIFIED) return true;
  const auto infos = formats::all();
  const auto info = std::find_if(infos.begin(), infos.end(),
                                 [name = spelled(format)](const auto& each) { return each.name == name; });
  return info != infos.end() && info->readable && (!formats::needs_hdf5(info->format) || formats::has_hdf5());
}

std::vector<v1::MeshFormat> formats_with_report(std::vector<v1::MeshFormat> formats, const std::string& report) {
  if (!report.empty() && std::none_of(formats.begin(), formats.end(), readable))
    formats.push_back(v1::MESH_FORMAT_UNSPECIFIED);
  return formats;
}

Outcome<void> write_job_report(Client* client, const v1::Job& job, const std::string& input, const std::string& path) {
  const auto result = client->result(job.name());
  if (!result) return tl::unexpected(result.error());
  Report report = report_of(job.metrics(), job.spec().options(), result->history);
  report.title = input.empty() ? job.name() : title_of(input);
  const auto server = client->info();
  if (!server) return tl::unexpected(server.error());
  report.origin = origin_document(job, input, server->version());
  report.distances = distances_of(job.metrics().geometry());
  if (job.metrics().geometry().nodes() > 0)
    report.picture_note =
        "The pictures 'before' show the input. Except for the distances, the numbers 'before' describe the mesh after "
        "its boundary nodes slid.";
  if (auto fetched = fetch_meshes(client, job, &report); !fetched) return fetched;
  if (const auto written = write_report(path, report); !written)
    return file_failure(written.error().sentence, "OUTPUT");
  return {};
}

Expected<void> write_run_report(const std::string& path, const std::string& input, const ReportedRun& run) {
  Report report = report_of(run.metrics, run.options, run.history);
  report.title = title_of(input);
  report.origin.push_back({"mesh", input});
  report.origin.push_back({"mesh, SHA-256", sha256(run.before)});
  report.origin.push_back({"varimesh, the command", std::string(version())});
  report.origin.push_back({"written", time_text(TimeUtil::GetCurrentTime())});
  for (const auto& [bytes, mesh] : {std::pair{run.before, &report.before}, std::pair{run.after, &report.after}}) {
    auto read = formats::read(bytes);
    if (!read) return tl::unexpected(read.error());
    *mesh = std::make_shared<const HighOrderMesh>(std::move(read->mesh));
  }
  show_in_its_plane(&report);
  return write_report(path, report);
}

Expected<void> write_quality_report(const std::string& path, const std::string& input, HighOrderMesh mesh,
                                    const MeshSummary& summary, const QualityReport& quality,
                                    const std::vector<UnrepairableGroup>& groups, const WhatIsLeft& left,
                                    const v1::LayersReport* layers) {
  Report report;
  report.title = title_of(input);
  report.document = document(summary, quality, groups, left);
  if (layers != nullptr) add_layers_text(*layers, report);
  report.histograms["before"] = quality.histogram;
  report.origin.push_back({"mesh", input});
  report.origin.push_back({"varimesh, the command", std::string(version())});
  report.origin.push_back({"written", time_text(TimeUtil::GetCurrentTime())});
  for (const UncertifiedElement& element : quality.uncertified) report.marks.uncertified[0].insert(element.number);
  for (const UnrepairableGroup& group : groups)
    report.marks.unrepairable.insert(group.elements.begin(), group.elements.end());
  report.before = std::make_shared<const HighOrderMesh>(std::move(mesh));
  return write_report(path, report);
}

}  // namespace varimesh::client
