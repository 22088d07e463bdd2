#include "core/kernels/operations.h"

namespace varimesh {
namespace {

/// One energy in 2 and 3 dimensions.
struct Both {
  PointOperations plane, solid;
};

constexpr Both kHyperelastic{{82, 65, 8, 65, 44, 119, 191, 65}, {164, 69, 18, 85, 44, 248, 1827, 262}};
constexpr Both kGreenLagrangeLog{{143, 97, 16, 81, 44, 166, 475, 136}, {307, 167, 36, 131, 44, 396, 3888, 491}};
constexpr Both kGreenLagrangeTrace{{156, 61, 16, 45, 0, 117, 551, 155}, {332, 131, 36, 95, 0, 347, 4239, 530}};
constexpr Both kSmallLog{{135, 91, 16, 75, 44, 134, 251, 80}, {265, 143, 36, 107, 44, 288, 2106, 293}};
constexpr Both kSmallTrace{{138, 55, 16, 39, 0, 88, 267, 84}, {269, 107, 36, 71, 0, 249, 2151, 298}};
constexpr Both kWinslowTrue{{94, 16, 8, 16, 0, 70, 271, 85}, {307, 117, 36, 81, 0, 478, 5904, 715}};
constexpr Both kWinslowPaper{{94, 16, 8, 16, 0, 70, 271, 85}, {191, 20, 18, 36, 0, 199, 2187, 302}};
constexpr Both kDistortion{{96, 17, 8, 17, 0, 72, 271, 85}, {194, 50, 18, 66, 28, 230, 2187, 302}};

const Both& operations_of(const Material& material) {
  const bool small = material.strain == Strain::Small, trace = material.volumetric == Volumetric::Trace;
  switch (material.energy) {
    case Energy::LinearElastic:
      if (small) return trace ? kSmallTrace : kSmallLog;
      return trace ? kGreenLagrangeTrace : kGreenLagrangeLog;
    case Energy::Winslow:
      return material.winslow == Winslow::True ? kWinslowTrue : kWinslowPaper;
    case Energy::Distortion:
      return kDistortion;
    case Energy::Hyperelastic:
      break;
  }
  return kHyperelastic;
}

}  // namespace

const PointOperations& point_operations(const Material& material, int dimension) {
  const Both& both = operations_of(material);
  return dimension == 2 ? both.plane : both.solid;
}

}  // namespace varimesh
