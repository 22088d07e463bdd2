// Lets a server optimise a mesh, using the installed library: remote HOST:PORT IN OUT
#include <varimesh/client.h>

#include <cstdio>

namespace v1 = varimesh::v1;

namespace {

/// Prints a failure and returns the exit status.
int report(const varimesh::client::Failure& failure) {
  std::fprintf(stderr, "%s [%s]\n", failure.sentence.c_str(), failure.reason.c_str());
  return 1;
}

}  // namespace

int main(int, char** arguments) {
  auto client = varimesh::client::Client::connect(arguments[1]);
  if (!client) return report(client.error());
  const auto mesh = client->upload_file(arguments[2]);
  if (!mesh) return report(mesh.error());

  v1::JobSpec spec;
  spec.mutable_mesh()->set_digest(mesh->digest());
  spec.mutable_options()->set_energy(v1::ENERGY_HYPERELASTIC);
  const auto job = client->submit(spec);
  if (!job) return report(job.error());

  // Continues by itself if the connection breaks or the server is restarted.
  const auto ended = client->watch(job->name(), 0, [](const v1::JobEvent& event) {
    if (event.has_iteration()) std::printf("%3d  %.1e\n", event.iteration().number(), event.iteration().residual());
    return true;
  });
  if (!ended) return report(ended.error());
  if (ended->state() != v1::JOB_STATE_SUCCEEDED) return std::puts(ended->error().message().c_str()), 1;

  const auto& metrics = ended->metrics();
  std::printf("invalid elements: %d before, %d after; smallest scaled Jacobian %.3f\n",
              int(metrics.before().invalid_elements()), int(metrics.after().invalid_elements()),
              metrics.after().min_scaled_jacobian());
  const auto written = client->download(ended->results(0), arguments[3]);
  if (!written) return report(written.error());
  return metrics.after().certified().valid() == metrics.mesh().elements() ? 0 : 4;
}
