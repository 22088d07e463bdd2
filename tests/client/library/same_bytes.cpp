// Runs one job by the numerical library, or by libvarimesh-client on a server, and writes the result.
// same_bytes_test.py compares the bytes with those of the command and of Python.
//
//   same_bytes library MESH GEOMETRY OUT
//   same_bytes ADDRESS MESH GEOMETRY OUT
//
// GEOMETRY is "none", "boundary" or a CAD file.
#include <iostream>
#include <string>

#include "client/client.h"
#include "core/formats/formats.h"
#include "core/optimise/marks/marks.h"
#include "core/optimise/on_geometry/optimise_on_geometry.h"

namespace varimesh {
namespace {

int failed(const std::string& sentence) {
  std::cerr << sentence << std::endl;
  return 1;
}

int by_library(const std::string& mesh, const std::string& geometry, const std::string& out) {
  auto file = formats::read_file(mesh);
  if (!file) return failed(file.error().sentence);
  Expected<Result> result;
  if (geometry == "none") {
    result = optimise(std::move(file->mesh));
  } else {
    GeometryOptions options;
    if (geometry == "boundary")
      options.slide_on = GeometrySource::Boundary;
    else
      options.file = geometry;
    result = optimise_on_geometry(std::move(file->mesh), {}, options).map([](ResultOnGeometry&& done) {
      return std::move(done.result);
    });
  }
  if (!result) return failed(result.error().sentence);
  mark_unrepairable(result->mesh, result->unrepairable);
  const auto written = formats::write_file(result->mesh, file->format, out);
  return written ? 0 : failed(written.error().sentence);
}

int by_client(const std::string& address, const std::string& mesh, const std::string& geometry,
              const std::string& out) {
  auto client = client::Client::connect(address);
  if (!client) return failed(client.error().sentence);
  v1::JobSpec spec;
  const auto uploaded = client->upload_file(mesh);
  if (!uploaded) return failed(uploaded.error().sentence);
  spec.mutable_mesh()->set_digest(uploaded->digest());
  if (geometry == "boundary") spec.mutable_geometry()->set_slide_on(v1::Geometry::SLIDE_ON_BOUNDARY);
  if (geometry != "boundary" && geometry != "none") {
    const auto model = client->upload_model(geometry);
    if (!model) return failed(model.error().sentence);
    spec.mutable_geometry()->set_digest(model->digest());
  }
  const auto job = client->submit(spec);
  if (!job) return failed(job.error().sentence);
  const auto ended = client->watch(job->name(), 0, [](const v1::JobEvent&) { return true; });
  if (!ended) return failed(ended.error().sentence);
  if (ended->results_size() == 0) return failed(ended->error().message());
  const auto done = client->download(ended->results(0), out);
  return done ? 0 : failed(done.error().sentence);
}

}  // namespace
}  // namespace varimesh

int main(int count, char** words) {
  if (count != 5) return 2;
  const std::string by = words[1];
  return by == "library" ? varimesh::by_library(words[2], words[3], words[4])
                         : varimesh::by_client(by, words[2], words[3], words[4]);
}
