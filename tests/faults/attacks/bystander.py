"""The other owner, who works while the server is attacked: a process of its own, so that the attacker's work in Python does not
delay what it measures.

Its first line of input is JSON with the address, the token, the files of TLS, and the address of --http or null. Then a line 'begin' starts a measurement, and
'end' prints it as JSON: the seconds that each ping, each small job and, with --http, each request took, and the sentences of those that failed. A job is an
upload of a mesh that the server does not have, its run, its result, and the deletion of all three.
"""
import hashlib
import http.client
import json
import sys
import threading
import time
import uuid
from pathlib import Path

import grpc
from varimesh.v1 import job_pb2, optimise_pb2, service_pb2, service_pb2_grpc

PATIENCE = 60  # seconds for a call


class Owner:
    """The calls of one owner, over a connection of its own."""

    def __init__(self, address, token="", authority=None, certificate=None, key=None):
        # Whoever cannot connect at once tries again soon, instead of after the minutes that gRPC takes at the end.
        options = [("grpc.use_local_subchannel_pool", 1), ("grpc.max_reconnect_backoff_ms", 500)]
        self.metadata = [("authorization", "Bearer " + token)] if token else []
        if authority:
            read = [Path(file).read_bytes() if file else None for file in (authority, key, certificate)]
            self.channel = grpc.secure_channel(address, grpc.ssl_channel_credentials(*read), options)
        else:
            self.channel = grpc.insecure_channel(address, options)
        self.jobs, self.meshes, self.optimises = (
            stub(self.channel) for stub in (service_pb2_grpc.JobServiceStub, service_pb2_grpc.MeshServiceStub,
                                            service_pb2_grpc.OptimiseServiceStub))

    def call(self, method, request, **keywords):
        return method(request, metadata=self.metadata, timeout=PATIENCE, wait_for_ready=True, **keywords)

    def upload(self, data, chunks=None, size=None):
        """Uploads a mesh and returns its digest. `chunks`: how it is sent, if not in one piece."""
        digest = hashlib.sha256(data).hexdigest()
        header = service_pb2.UploadHeader(upload_id=uuid.uuid4().hex, digest=digest, size=len(data) if size is None else size)
        chunks = chunks or [service_pb2.Chunk(offset=at, data=data[at:at + (1 << 20)]) for at in range(0, len(data), 1 << 20)]
        messages = [service_pb2.UploadMeshRequest(header=header), *(service_pb2.UploadMeshRequest(chunk=each) for each in chunks)]
        self.call(self.meshes.UploadMesh, iter(messages))
        return digest

    def submit(self, digest, *, format=0, priority=0, labels=None, request_id="", **options):
        spec = job_pb2.JobSpec(options=optimise_pb2.Options(**options), priority=priority, labels=labels or {})
        spec.mesh.digest, spec.mesh.format = digest, format
        return self.call(self.jobs.SubmitJob, service_pb2.SubmitJobRequest(spec=spec, request_id=request_id)).job

    def wait(self, name):
        for _ in self.call(self.jobs.WatchJob, service_pb2.WatchJobRequest(name=name)):
            pass
        return self.call(self.jobs.GetJob, service_pb2.GetJobRequest(name=name)).job

    def cancel(self, name):
        return self.call(self.jobs.CancelJob, service_pb2.CancelJobRequest(name=name)).job

    def download(self, digest):
        messages = self.call(self.meshes.DownloadMesh, service_pb2.DownloadMeshRequest(digest=digest))
        return b"".join(message.chunk.data for message in messages)

    def list(self):
        """The number of this owner's jobs, over all pages."""
        request, count = service_pb2.ListJobsRequest(), 0
        while True:
            page = self.call(self.jobs.ListJobs, request)
            count += len(page.jobs)
            request.page_token = page.next_page_token
            if not request.page_token:
                return count

    def close(self):
        self.channel.close()


class Measurement:
    """What one thread repeats, and how long it takes."""

    def __init__(self, work, pause):
        self.took, self.failed, self.measures = [], [], False
        threading.Thread(target=self._repeat, args=(work, pause), daemon=True).start()

    def _repeat(self, work, pause):
        while True:
            begun = time.monotonic()
            try:
                work()
            except (grpc.RpcError, AssertionError) as error:
                if self.measures:
                    self.failed.append(error.details() if isinstance(error, grpc.RpcError) else str(error))
            if self.measures:
                self.took.append(time.monotonic() - begun)
            time.sleep(pause)


def over_http(place, token):
    """What the server is, asked over a connection of its own."""
    asking = http.client.HTTPConnection(place, timeout=PATIENCE)
    try:
        asking.request("GET", "/v1/info", headers={"Authorization": "Bearer " + token})
        answer = asking.getresponse()
        assert answer.status == 200, answer.read()
        answer.read()
    except (OSError, http.client.HTTPException) as error:
        raise AssertionError(repr(error)) from error
    finally:
        asking.close()


def small_job(owner, mesh):
    """A mesh of a name that no mesh had before, optimised."""
    data = mesh + f"$Comments\n{uuid.uuid4().hex}\n$EndComments\n".encode()
    job = owner.wait(owner.submit(owner.upload(data), threads=1).name)
    assert job.state == job_pb2.JOB_STATE_SUCCEEDED, f"{job.name} ended in state {job.state}: {job.error.message}"
    assert owner.download(job.results[0].digest).startswith(b"$MeshFormat"), "the result is no mesh"
    owner.call(owner.jobs.DeleteJob, service_pb2.DeleteJobRequest(name=job.name))
    owner.call(owner.meshes.DeleteMesh, service_pb2.DeleteMeshRequest(digest=job.spec.mesh.digest))


def main():
    settings = json.loads(sys.stdin.readline())
    mesh, place = Path(settings.pop("mesh")).read_bytes(), settings.pop("http")
    pinging, working = Owner(**settings), Owner(**settings)
    ping = service_pb2.GetServerInfoRequest()
    measured = {"ping": Measurement(lambda: pinging.call(pinging.jobs.GetServerInfo, ping), 0.01),
                "job": Measurement(lambda: small_job(working, mesh), 0.01)}
    if place:
        measured["request over HTTP"] = Measurement(lambda: over_http(place, settings["token"]), 0.01)
    for line in sys.stdin:
        begins = line.strip() == "begin"
        for one in measured.values():
            one.measures = begins
        if begins:
            for one in measured.values():
                one.took, one.failed = [], []
        else:
            print(json.dumps({name: {"took": one.took, "failed": one.failed} for name, one in measured.items()}), flush=True)


if __name__ == "__main__":
    main()
