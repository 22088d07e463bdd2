// One self-contained page about a mesh and what was done to it.
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "client/report/scene.h"
#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::client {

/// What a page tells. Text may hold anything: the page shows it as text.
struct Report {
  std::string title;                ///< What the mesh is called.
  nlohmann::ordered_json document;  ///< Of --json, as it is printed.
  /// {"before": [counts of equal bins of [0, 1]], "after": […]}
  nlohmann::ordered_json histograms = nlohmann::ordered_json::object();
  /// {"iteration": […], "phase": […], …}: a list a column; empty: there were no iterations.
  nlohmann::ordered_json history = nlohmann::ordered_json::object();
  /// [{"name", "value", "help"}]: the options as flags; an empty value is the default.
  nlohmann::ordered_json options = nlohmann::ordered_json::array();
  /// [[name, text], …]: where it comes from: files, job, versions, times.
  nlohmann::ordered_json origin = nlohmann::ordered_json::array();

  std::shared_ptr<const HighOrderMesh> before, after;  ///< Null: not there. Without `before` there is no picture.
  std::string no_picture;                              ///< Why there is none; said above it where there is one.
  Marks marks;
};

/// Writes the page (formats::OutputFile). Where the two meshes do not have the same elements, it shows the one after.
/// Errors: Output; BadInput where a mesh cannot be judged.
Expected<void> write_report(const std::string& path, const Report& report);

}  // namespace varimesh::client
