#include "client/runs/quality_run.h"

#include <iostream>

#include "client/io/documents.h"
#include "client/io/outputs.h"
#include "client/io/summary.h"
#include "client/process/exit_status.h"

namespace varimesh::client {
namespace {

void print_summary(const QualityArguments& arguments, const JudgedMesh& judged) {
  std::ostream& out = any_is_standard_output({{arguments.output}, {arguments.report}}) ? std::cerr : std::cout;
  out << summary(judged.mesh, judged.quality);
  if (!arguments.diagnose) return;
  if (judged.groups.empty() && !judged.quality.is_surface) out << "found no elements that moving nodes cannot repair\n";
  for (const UnrepairableGroup& group : judged.groups) out << group.sentence << "\n";
  out << way_out(judged.left);
}

}  // namespace

int print_quality(const QualityArguments& arguments, const JudgedMesh& judged) {
  if (arguments.common.json)
    print(document(judged.mesh, judged.quality, judged.groups, judged.left));
  else
    print_summary(arguments, judged);
  const CertificateSummary& certified = judged.quality.certified;
  return arguments.certify ? print_uncertified(certified.invalid, certified.undecided) : kDone;
}

}  // namespace varimesh::client
