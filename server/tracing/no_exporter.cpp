// A build without libcurl sends no traces.
#include "server/tracing/exporter.h"

namespace varimesh::server {

Expected<SpanSink> export_spans(const ExportSettings&) {
  return tl::unexpected(Error{Error::Kind::BadOption,
                              "This varimeshd was built without libcurl and cannot send traces; leave out --traces, or "
                              "build it with libcurl (Debian package libcurl4-openssl-dev)."});
}

}  // namespace varimesh::server
