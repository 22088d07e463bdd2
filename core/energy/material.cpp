#include "core/energy/material.h"

namespace varimesh {

Material material(const Options& options) {
  Material m;
  m.energy = options.energy;
  m.strain = options.strain;
  m.volumetric = options.volumetric;
  m.winslow = options.winslow;
  m.mu = options.mu > 0 ? options.mu : kReferenceMu;
  const bool standard = options.constants == Constants::Standard && options.energy == Energy::Hyperelastic;
  m.lambda = options.lambda > 0 ? options.lambda : standard ? kStandardLambda : kReferenceBulk;
  m.kappa = options.kappa > 0 ? options.kappa : kReferenceBulk;
  return m;
}

std::string_view name(Energy energy) {
  switch (energy) {
    case Energy::Hyperelastic:
      return "hyperelastic";
    case Energy::LinearElastic:
      return "linear-elastic";
    case Energy::Winslow:
      return "winslow";
    case Energy::Distortion:
      return "distortion";
  }
  return "";
}

}  // namespace varimesh
