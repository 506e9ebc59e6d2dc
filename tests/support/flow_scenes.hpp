// Small scenes in which everything happens that a layout could get wrong: friction that sticks and slides, grains that cross
// periodic faces all the time, walls and meshes, gates that open, outlets that drain.
#pragma once

#include <functional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "engine/scene/scene.hpp"
#include "tests/support/surface_shapes.hpp"

namespace moraine::scenes {

inline constexpr double d = 0.01;  // [m] diameter of a common grain

/// Glass and steel in linear contact; 2 to 3 ms a contact of common grains.
inline Scene basic() {
  Scene s;
  s.time.end = 10.0;
  s.time.step = 4e-5;
  s.materials = {{"glass", 2500.0, 5e6, 0.3}, {"steel", 7800.0, 2e7, 0.25}};
  PairLaw p;
  p.between = {"glass", "glass"};
  p.normal_stiffness = 4000.0;
  p.restitution = 0.7;
  p.friction = 0.4;
  s.contact.pairs.push_back(p);
  p.between = {"glass", "steel"};
  p.normal_stiffness = 5000.0;
  p.restitution = 0.6;
  p.friction = 0.3;
  s.contact.pairs.push_back(p);
  p.between = {"steel", "steel"};
  p.normal_stiffness = 6000.0;
  p.restitution = 0.8;
  p.friction = 0.2;
  s.contact.pairs.push_back(p);
  return s;
}

inline ParticleGroup lattice(Box box, double spacing, const std::string& material = "glass", double diameter = d) {
  ParticleGroup group;
  group.material = material;
  group.diameter.value = diameter;
  LatticeFill fill;
  fill.region = BoxRegion{box};
  fill.spacing = spacing;
  fill.jitter = 0.9;
  group.fill = fill;
  return group;
}

inline WallDefinition& add_wall(Scene& scene, const std::string& name, decltype(WallDefinition::shape) shape,
                                const std::string& material = "glass") {
  WallDefinition wall;
  wall.name = name;
  wall.material = material;
  wall.shape = std::move(shape);
  scene.walls.push_back(wall);
  return scene.walls.back();
}

inline void add_probe(Scene& scene, Probe::Kind kind, const std::string& name, const std::string& wall = "") {
  Probe probe;
  probe.kind = kind;
  probe.name = name;
  probe.wall = wall;
  probe.region = scene.domain.box();
  probe.bins = 5;
  probe.interval = 1e-3;
  scene.output.probes.push_back(probe);
}

/// Dense flow through a box that is periodic in all directions; two streams rub against each other and gravity, balanced by bulk
/// viscosity, drives all across all faces.
inline Scene periodic_flow() {
  Scene s = basic();
  const double size = 9 * 1.03 * d;
  s.domain.low = {-0.013, 0.0, 0.027};
  s.domain.high = s.domain.low + Vec3{size, size, size};
  s.domain.periodic = {true, true, true};
  s.time.gravity = {6.0, -5.0, 4.0};
  s.time.damping = 5.0;
  Box lower = s.domain.box(), upper = lower;
  lower.high.z = upper.low.z = s.domain.low.z + size / 3.0;
  s.particles = {lattice(lower, 1.03 * d), lattice(upper, 1.03 * d, "steel")};
  s.particles[0].velocity = {0.4, 0.3, 0.0};
  s.particles[1].velocity = {-0.5, 0.2, 0.1};
  for (ParticleGroup& group : s.particles) group.velocity_deviation = 0.2;
  s.particles[0].angular_velocity = {5.0, -20.0, 11.0};
  add_probe(s, Probe::Kind::region, "region");
  add_probe(s, Probe::Kind::profile, "profile");
  add_probe(s, Probe::Kind::contacts, "contacts");
  return s;
}

/// A bed that falls onto a plane and settles, periodic across.
inline Scene settled_bed() {
  Scene s = basic();
  s.domain.low = {0.0, 0.0, -0.001};
  s.domain.high = {8 * 1.02 * d, 8 * 1.02 * d, 20 * d};
  s.domain.periodic = {true, true, false};
  s.time.gravity = {1.0, 0.5, -9.81};
  Box fill = s.domain.box();
  fill.low.z = 0.0;
  fill.high.z = 10.5 * 1.02 * d;
  s.particles = {lattice(fill, 1.02 * d)};
  s.particles[0].velocity_deviation = 0.1;
  add_wall(s, "floor", PlaneShape{{0, 0, 0}, {0, 0, 1}}, "steel");
  add_probe(s, Probe::Kind::wall_force, "floor_force", "floor");
  add_probe(s, Probe::Kind::wall_pressure, "floor_pressure", "floor");
  add_probe(s, Probe::Kind::region, "region");
  return s;
}

/// Grains in a cylinder over a mesh cone; a disc closes the cone until a gate opens, then they drain through an outlet.
inline Scene hopper(double gate = 0.03) {
  Scene s = basic();
  s.domain.low = {-0.06, -0.06, -0.05};
  s.domain.high = {0.06, 0.06, 0.22};
  s.time.gravity = {0.0, 0.0, -9.81};
  ParticleGroup group = lattice({}, 1.03 * d);
  std::get<LatticeFill>(group.fill).region = CylinderRegion{{0, 0, 0.052}, 2, 0.052, 0.1};
  group.velocity = {0.1, 0.05, -0.5};
  group.velocity_deviation = 0.1;
  ParticleGroup few = lattice({}, 1.03 * d, "steel");
  std::get<LatticeFill>(few.fill).region = CylinderRegion{{0, 0, 0.155}, 2, 0.052, 0.03};
  s.particles = {group, few};
  add_wall(s, "silo", CylinderShape{{0, 0, 0.05}, {0, 0, 1}, 0.055, 0.2});
  add_wall(s, "cone", MeshShape{"cone.stl", shapes::cone_mesh(16, 3, 0.025, 0.055, 0.05)}, "steel");
  WallDefinition& door = add_wall(s, "gate", DiscShape{{0, 0, 0}, {0, 0, 1}, 0.03, 0.0});
  door.until = gate;
  s.outlets.push_back({"out", 4});
  add_probe(s, Probe::Kind::wall_force, "cone_force", "cone");
  add_probe(s, Probe::Kind::mass, "mass");
  add_probe(s, Probe::Kind::wall_pressure, "silo_pressure", "silo");
  return s;
}

/// Few grains in a large periodic box, fast.
inline Scene gas() {
  Scene s = basic();
  s.domain.high = {0.16, 0.15, 0.14};
  s.domain.periodic = {true, true, true};
  s.particles = {lattice(s.domain.box(), 0.017)};
  s.particles[0].velocity_deviation = 0.6;
  s.particles[0].angular_velocity = {10, 20, 30};
  for (PairLaw& p : s.contact.pairs) p.restitution = 0.95;
  add_probe(s, Probe::Kind::region, "region");
  return s;
}

/// Two materials, sizes 1:3, Hertz and Mindlin, in a closed box.
inline Scene polydisperse() {
  Scene s = basic();
  s.contact.normal = NormalLaw::hertz;
  s.contact.tangential = TangentialLaw::mindlin;
  s.time.step = 1e-5;
  s.domain.high = {0.1, 0.1, 0.14};
  s.time.gravity = {1.0, 0.0, -9.81};
  for (const char* material : {"glass", "steel"}) {
    ParticleGroup group;
    group.material = material;
    group.diameter.kind = SizeDistribution::Kind::uniform;
    group.diameter.low = 0.005;
    group.diameter.high = 0.015;
    RandomFill fill;
    Box box = s.domain.box();
    (material[0] == 'g' ? box.high.z : box.low.z) = 0.07;
    fill.region = BoxRegion{box};
    fill.count = 300;
    group.fill = fill;
    group.velocity = {0.2, 0.1, -1.0};
    group.velocity_deviation = 0.1;
    group.seed = material[0];
    s.particles.push_back(group);
  }
  add_wall(s, "box", BoxShape{s.domain.box()}, "steel");
  add_probe(s, Probe::Kind::wall_force, "box_force", "box");
  add_probe(s, Probe::Kind::contacts, "contacts");
  return s;
}

/// Boulders fall among fines of a tenth of their size, periodic along x and y: fines belong to one rank and touch a boulder of another.
inline Scene boulders() {
  Scene s = basic();
  s.contact.tangential = TangentialLaw::spring;
  s.time.step = 1e-5;
  s.domain.high = {0.3, 0.1, 0.1};
  s.domain.periodic = {true, true, false};
  s.time.gravity = {1.0, 0.0, -9.81};
  for (const bool is_fine : {true, false}) {
    ParticleGroup group;
    group.material = is_fine ? "glass" : "steel";
    group.diameter.value = is_fine ? 0.004 : 0.04;
    RandomFill fill;
    Box box = s.domain.box();
    (is_fine ? box.high.z : box.low.z) = is_fine ? 0.025 : 0.03;
    fill.region = BoxRegion{box};
    fill.count = is_fine ? 900 : 4;
    group.fill = fill;
    group.velocity = {is_fine ? 0.0 : 0.5, 0.1, is_fine ? -0.2 : -1.5};
    group.velocity_deviation = 0.1;
    group.seed = is_fine ? 11 : 12;
    s.particles.push_back(group);
  }
  add_wall(s, "floor", PlaneShape{{0, 0, 0}, {0, 0, 1}}, "steel");
  add_wall(s, "lid", PlaneShape{{0, 0, 0.1}, {0, 0, -1}}, "steel");
  add_probe(s, Probe::Kind::contacts, "contacts");
  return s;
}

/// Two dimensions, periodic along x; grains run over a wedge of mesh and drain through a hole in the floor.
inline Scene flat() {
  Scene s = basic();
  s.domain.dimensions = 2;
  s.domain.low = {0.0, -0.03, -d};
  s.domain.high = {0.3, 0.4, d};
  s.domain.periodic = {true, false, false};
  s.time.gravity = {2.0, -9.81, 0.0};
  s.particles = {lattice({{0.0, 0.06, -0.5 * d}, {0.3, 0.36, 0.5 * d}}, 1.05 * d)};
  s.particles[0].velocity_deviation = 0.1;
  TriangleMesh wedge;
  wedge.vertices = {{0.05, 0.0, -0.02}, {0.05, 0.0, 0.02},  {0.1, 0.04, -0.02},
                    {0.1, 0.04, 0.02},  {0.15, 0.0, -0.02}, {0.15, 0.0, 0.02}};
  wedge.triangles = {{0, 1, 2}, {1, 3, 2}, {2, 3, 4}, {3, 5, 4}};
  add_wall(s, "wedge", MeshShape{"wedge.obj", wedge});
  TriangleMesh floor;  // with a hole between x = 0.2 and 0.24
  floor.vertices = {{-0.01, 0.0, -0.02}, {-0.01, 0.0, 0.02}, {0.2, 0.0, -0.02},  {0.2, 0.0, 0.02},
                    {0.24, 0.0, -0.02},  {0.24, 0.0, 0.02},  {0.31, 0.0, -0.02}, {0.31, 0.0, 0.02}};
  floor.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 6, 5}, {5, 6, 7}};
  add_wall(s, "floor", MeshShape{"floor.obj", floor});
  s.outlets.push_back({"hole", 2});
  add_probe(s, Probe::Kind::mass, "mass");
  add_probe(s, Probe::Kind::wall_force, "wedge_force", "wedge");
  return s;
}

/// A quarter of a heap between mirrors; the power law, no rotation, an outlet box.
inline Scene mirrored() {
  Scene s = basic();
  s.contact.rotation = false;
  s.contact.tangential = TangentialLaw::power;
  s.domain.low = {0.0, 0.0, -0.02};
  s.domain.high = {0.2, 0.2, 0.2};
  s.time.gravity = {0.0, 0.0, -9.81};
  s.particles = {lattice({{0, 0, 0}, {0.083, 0.083, 0.103}}, 1.03 * d)};
  s.particles[0].velocity_deviation = 0.05;
  add_wall(s, "x", PlaneShape{{0, 0, 0}, {1, 0, 0}}).symmetry = true;
  add_wall(s, "y", PlaneShape{{0, 0, 0}, {0, 1, 0}}).symmetry = true;
  add_wall(s, "floor", PlaneShape{{0, 0, 0}, {0, 0, 1}});
  s.outlets.push_back({"rim", Box{{0.12, 0.0, -0.02}, {0.2, 0.2, 0.05}}});
  s.outlets.push_back({"far", Box{{0.0, 0.12, -0.02}, {0.2, 0.2, 0.05}}});
  add_probe(s, Probe::Kind::mass, "mass");
  add_probe(s, Probe::Kind::contacts, "contacts");
  return s;
}

/// Air in cells two to three grains wide.
inline Gas air(std::array<int, 3> cells) {
  Gas g;
  g.cells = cells;
  g.density = 1.2;
  g.viscosity = 1.8e-5;
  g.step = 2e-4;
  g.drag = DragLaw::gidaspow;
  return g;
}

/// A bed in a narrow column, blown up by a jet in its floor that grows with time; wider than deep, so that ranks lie beside and above
/// each other.
inline Scene fluidised_bed() {
  Scene s = basic();
  for (Material& material : s.materials) material.density *= 0.2;
  s.domain.high = {0.16, 0.08, 0.4};
  s.time.gravity = {0.0, 0.0, -9.81};
  s.particles = {lattice({{0, 0, 0}, {0.16, 0.08, 0.12}}, 1.03 * d)};
  s.particles[0].velocity_deviation = 0.05;
  add_wall(s, "box", BoxShape{s.domain.box()}, "steel");
  s.gas = air({6, 3, 16});
  GasBoundary floor, jet, top;
  floor.kind = jet.kind = GasBoundary::Kind::velocity;
  floor.face = jet.face = 4;
  floor.velocity = {0.0, 0.0, 1.2};
  floor.ramp = {{0.0, 0.2}, {0.05, 1.0}};
  jet.part = Box{{0.05, 0.02, -1.0}, {0.11, 0.06, 1.0}};
  jet.velocity = {0.3, 0.0, 9.0};
  jet.profile = GasBoundary::Profile::parabolic;
  top.kind = GasBoundary::Kind::pressure;
  top.face = 5;
  s.gas->boundaries = {floor, jet, top};
  s.outlets.push_back({"top", 5});
  add_probe(s, Probe::Kind::region, "region");
  add_probe(s, Probe::Kind::pressure_drop, "pressure_drop");
  add_probe(s, Probe::Kind::gas_profile, "gas_profile");
  add_probe(s, Probe::Kind::gas_mean, "gas_mean");
  return s;
}

/// Grains that a mean pressure gradient carries around a box, periodic along x and y; smoothed exchange.
inline Scene conveyed() {
  Scene s = basic();
  s.domain.high = {0.12, 0.1, 0.1};
  s.domain.periodic = {true, true, false};
  s.particles = {lattice(s.domain.box(), 0.02)};
  s.particles[0].velocity_deviation = 0.3;
  add_wall(s, "floor", PlaneShape{{0, 0, 0}, {0, 0, 1}}, "steel");
  add_wall(s, "lid", PlaneShape{{0, 0, 0.1}, {0, 0, -1}}, "steel");
  s.gas = air({7, 5, 9});
  s.gas->viscosity = 1e-3;
  s.gas->velocity = {3.0, 1.0, 0.0};
  s.gas->pressure_gradient = {-40.0, -10.0, 0.0};
  s.gas->drag = DragLaw::beetstra;
  s.gas->model = GasModel::b;
  s.gas->weights = GasWeights::smoothed;
  s.gas->smoothing = 0.015;
  add_probe(s, Probe::Kind::region, "region");
  return s;
}

/// The same bed in cells smaller than its grains, enough of them for two ranks to share them.
inline Scene finely_resolved() {
  Scene s = fluidised_bed();
  s.gas->cells = {24, 12, 60};
  s.gas->weights = GasWeights::smoothed;
  s.gas->smoothing = d;
  return s;
}

/// A jet through a flat bed, one cell deep.
inline Scene flat_jet() {
  Scene s = basic();
  for (Material& material : s.materials) material.density *= 0.2;
  s.domain.dimensions = 2;
  s.domain.low = {0.0, 0.0, -0.5 * d};
  s.domain.high = {0.24, 0.5, 0.5 * d};
  s.time.gravity = {0.0, -9.81, 0.0};
  s.particles = {lattice({{0, 0, -0.5 * d}, {0.24, 0.15, 0.5 * d}}, 1.05 * d)};
  s.particles[0].velocity_deviation = 0.05;
  for (auto [name, point, normal] : {std::tuple{"left", Vec3{0, 0, 0}, Vec3{1, 0, 0}},
                                     {"right", Vec3{0.24, 0, 0}, Vec3{-1, 0, 0}},
                                     {"floor", Vec3{0, 0, 0}, Vec3{0, 1, 0}}})
    add_wall(s, name, PlaneShape{point, normal}, "steel");
  s.outlets.push_back({"top", 3});
  s.gas = air({8, 17, 1});
  s.gas->weights = GasWeights::cell;
  GasBoundary jet, top;
  jet.kind = GasBoundary::Kind::velocity;
  jet.face = 2;
  jet.part = Box{{0.09, -1.0, -1.0}, {0.15, 1.0, 1.0}};
  jet.velocity = {0.0, 12.0, 0.0};
  top.kind = GasBoundary::Kind::pressure;
  top.face = 3;
  s.gas->boundaries = {jet, top};
  add_probe(s, Probe::Kind::mass, "mass");
  return s;
}

struct Named {
  const char* name;
  Scene scene;
  int n_steps;  // over which it is worth watching
};

inline std::vector<Named> all() {
  return {{"periodic flow", periodic_flow(), 2500},
          {"settled bed", settled_bed(), 3000},
          {"hopper", hopper(), 3500},
          {"gas", gas(), 2500},
          {"polydisperse", polydisperse(), 3000},
          {"boulders", boulders(), 1500},
          {"flat", flat(), 4000},
          {"mirrored", mirrored(), 3000},
          {"fluidised bed", fluidised_bed(), 2500},
          {"finely resolved", finely_resolved(), 500},
          {"conveyed", conveyed(), 2500},
          {"flat jet", flat_jet(), 3000}};
}

}  // namespace moraine::scenes
