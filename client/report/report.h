// The report: one self-contained HTML page about a mesh and its optimisation.
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "client/report/scene.h"
#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::client {

/// The content of the page. Text may contain any characters, because the page never treats it as markup.
struct Report {
  std::string title;                ///< The name of the mesh.
  nlohmann::ordered_json document;  ///< The document that --json prints.
  /// {"before": [counts], "after": [counts]}: elements per bin of the scaled Jacobian, in equal bins of [0, 1].
  nlohmann::ordered_json histograms = nlohmann::ordered_json::object();
  /// {"iteration": […], "phase": […], …}: one list per column; empty: there were no iterations.
  nlohmann::ordered_json history = nlohmann::ordered_json::object();
  /// [{"name", "value", "help"}]: the options as flags; an empty value stands for the default.
  nlohmann::ordered_json options = nlohmann::ordered_json::array();
  /// [[name, text], …]: files, job, versions and times.
  nlohmann::ordered_json origin = nlohmann::ordered_json::array();

  std::shared_ptr<const HighOrderMesh> before, after;  ///< Both or one may be null. Without `before`, no picture.
  std::string picture_note;                            ///< Shown above the picture, or instead of it if there is none.
  Marks marks;
  BoundaryDistanceArrays distances;  ///< Empty: not known.
};

/// Writes the page (OutputFile). If the two meshes do not have the same elements, it shows only the one after.
/// Errors: Output; BadInput if the quality of a mesh cannot be computed.
Expected<void> write_report(const std::string& path, const Report& report);

}  // namespace varimesh::client
