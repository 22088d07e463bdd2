// Every energy in all its forms.
#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "core/energy/material.h"

namespace varimesh {

struct NamedMaterial {
  std::string name;
  Material material;
};

inline void PrintTo(const NamedMaterial& one, std::ostream* out) { *out << one.name; }

inline std::vector<NamedMaterial> every_material() {
  const auto make = [](Energy energy, Strain strain, Volumetric volumetric, Winslow winslow) {
    Options options;
    options.constants = Constants::Reference;
    options.energy = energy;
    options.strain = strain;
    options.volumetric = volumetric;
    options.winslow = winslow;
    return material(options);
  };
  using enum Energy;
  return {{"Hyperelastic", make(Hyperelastic, Strain::GreenLagrange, Volumetric::Log, Winslow::True)},
          {"GreenLagrangeLog", make(LinearElastic, Strain::GreenLagrange, Volumetric::Log, Winslow::True)},
          {"GreenLagrangeTrace", make(LinearElastic, Strain::GreenLagrange, Volumetric::Trace, Winslow::True)},
          {"SmallLog", make(LinearElastic, Strain::Small, Volumetric::Log, Winslow::True)},
          {"SmallTrace", make(LinearElastic, Strain::Small, Volumetric::Trace, Winslow::True)},
          {"WinslowTrue", make(Energy::Winslow, Strain::GreenLagrange, Volumetric::Log, Winslow::True)},
          {"WinslowPaper", make(Energy::Winslow, Strain::GreenLagrange, Volumetric::Log, Winslow::Paper)},
          {"Distortion", make(Distortion, Strain::GreenLagrange, Volumetric::Log, Winslow::True)}};
}

}  // namespace varimesh
