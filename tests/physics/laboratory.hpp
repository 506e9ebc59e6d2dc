// What every physics test needs: small scenes built in a few lines, and the state of a run by gid.
#pragma once

#include <string>
#include <vector>

#include "engine/run/simulation.hpp"
#include "tests/support/measured.hpp"

namespace moraine::physics {

inline constexpr double pi = 3.14159265358979323846;

/// An empty scene in a box without walls, with a given time step [s].
Scene empty_scene(Vec3 low, Vec3 high, double step);

/// A pair law of two materials, with what all laws have in common.
PairLaw pair_law(const std::string& a, const std::string& b, double restitution, double friction);

/// Adds a grain of that material; grains of one material follow each other by gid in the order in which they were added.
void add_grain(Scene& scene, const std::string& material, double radius, Vec3 position, Vec3 velocity = {},
               Vec3 spin = {});

void add_plane(Scene& scene, const std::string& name, const std::string& material, Vec3 point, Vec3 normal);

/// All grains in order of gid. Velocities lie half a step before the positions (but at step 0), forces belong to the positions
/// of the step before.
struct State {
  std::vector<Vec3> position, velocity, spin, force;
};
State state_of(const Simulation& run);

double mass_of(double density, double radius);

using testing::report;

/// Table of numbers, one row a line; lines that do not begin with a number are left out. Separators: blanks and commas.
std::vector<std::vector<double>> read_numbers(const std::string& file);
/// Path of a file in tests/physics/data.
std::string data_file(const std::string& name);

/// Piecewise linear interpolation in a table sorted by column 0.
double interpolate(const std::vector<std::vector<double>>& table, double x, std::size_t column = 1);

/// Slope of the least-squares line through (x, y) and the standard error of the slope.
struct Slope {
  double value = 0.0;
  double error = 0.0;
};
Slope fit_slope(const std::vector<double>& x, const std::vector<double>& y);

/// Cores of this machine.
int n_cores();

}  // namespace moraine::physics
