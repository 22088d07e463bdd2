// After a run whose boundary nodes slid: runs in which they slide in another way, and the best of all.
#pragma once

#include <functional>
#include <string>
#include <tl/expected.hpp>

#include "client/client.h"
#include "client/io/inputs.h"

namespace varimesh::client {

/// What the other runs need.
struct OtherSlides {
  Client& client;
  const Input& input;  ///< With the options of the job (with_options()).
  v1::JobSpec spec;    ///< Of the run that has ended.
  std::string request_id;
  /// Submits a job and follows it to its end. The error is the exit status; its message has been printed.
  std::function<tl::expected<v1::Job, int>(const v1::JobSpec& spec, const std::string& request_id)> run;
  std::function<void(const std::string&)> print_sentence;
};

/// Returns `slid` or a better job.
///
/// On a model:
/// - If elements are left that are not certified valid, or have a scaled Jacobian below .02, and the user has not said
///   what slides, all nodes move together (--slide coupled).
/// - If elements are still left that are not certified valid, nothing slides.
/// The better job is the one with fewer elements left. If none was left before all nodes moved together, it is the one
/// with the larger smallest scaled Jacobian.
///
/// On the boundary as it came (--slide-on), the mesh is optimised with this boundary too. Of two jobs with as many
/// elements left, the one with the larger smallest scaled Jacobian is better.
///
/// If another run fails, this prints a sentence, and the best result so far counts. After an interrupt no other run
/// begins. A mesh that slid in this process and cannot be read twice, such as a pipe, has no other runs.
v1::Job best_of_other_slides(OtherSlides others, v1::Job slid);

}  // namespace varimesh::client
