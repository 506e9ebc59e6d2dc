// Drag laws: the force of a gas on one grain among others. Equations and papers: README.md.
//
// F is the force over Stokes' at the superficial slip,  force = 3 pi mu d eps |u - v| F(eps, Re),  Re = eps rho |u - v| d/mu,
// the pressure gradient apart (model A).
#pragma once

#include <cstdint>

#include "kernels/drag/kinds.hpp"

namespace moraine {

/// What the laws know of the gas.
struct GasProperties {
  double density = 0.0;    // [kg/m3]
  double viscosity = 0.0;  // [Pa s]
};

/// F [-] at a void fraction in (0, 1] and a Reynolds number >= 0.
double drag_factor(DragLaw law, double void_fraction, double reynolds);

/// Drag coefficients c [kg/s] of n grains, force = c (u - v): of model A, or over the void fraction (model B). Arrays: void fraction [-],
/// speed of the slip [m/s], radius [m].
void drag_coefficients(DragLaw law, GasModel model, const GasProperties& gas, std::int64_t n,
                       const double* void_fraction, const double* slip, const double* radius, double* coefficient);

}  // namespace moraine
