// The energies of the kernels of all cells: ENERGY(dimension, number, name, type) for each, with the types that
// with_energy() chooses (core/energy/table-inl.h). Numbers begin at 1. Whoever includes this file defines ENERGY.
ENERGY(2, 1, hyperelastic, HyperelasticEnergy<2>)
ENERGY(2, 2, green_lagrange_log, LinearElasticEnergy<2, Strain::GreenLagrange, Volumetric::Log>)
ENERGY(2, 3, green_lagrange_trace, LinearElasticEnergy<2, Strain::GreenLagrange, Volumetric::Trace>)
ENERGY(2, 4, small_log, LinearElasticEnergy<2, Strain::Small, Volumetric::Log>)
ENERGY(2, 5, small_trace, LinearElasticEnergy<2, Strain::Small, Volumetric::Trace>)
ENERGY(2, 6, winslow_paper, WinslowEnergy<2, Winslow::Paper>)
ENERGY(2, 7, distortion, DistortionEnergy<2>)
ENERGY(3, 1, hyperelastic, HyperelasticEnergy<3>)
ENERGY(3, 2, green_lagrange_log, LinearElasticEnergy<3, Strain::GreenLagrange, Volumetric::Log>)
ENERGY(3, 3, green_lagrange_trace, LinearElasticEnergy<3, Strain::GreenLagrange, Volumetric::Trace>)
ENERGY(3, 4, small_log, LinearElasticEnergy<3, Strain::Small, Volumetric::Log>)
ENERGY(3, 5, small_trace, LinearElasticEnergy<3, Strain::Small, Volumetric::Trace>)
ENERGY(3, 6, winslow_paper, WinslowEnergy<3, Winslow::Paper>)
ENERGY(3, 7, winslow_true, WinslowEnergy<3, Winslow::True>)
ENERGY(3, 8, distortion, DistortionEnergy<3>)
#undef ENERGY
