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

/// Grains of one size at given places and velocities.
inline ParticleGroup listed(std::vector<GrainSeed> grains, double diameter = d, const std::string& material = "glass") {
  ListedGrains list;
  list.grains = std::move(grains);
  list.has_velocity = true;
  ParticleGroup group;
  group.material = material;
  group.diameter.value = diameter;
  group.fill = std::move(list);
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

/// Coarse-grained fields in a part of the domain.
inline void add_fields(Scene& scene, Box region, std::array<int, 3> cells, bool by_material = false, int width = 1) {
  add_probe(scene, Probe::Kind::fields, "fields_" + std::to_string(scene.output.probes.size()));
  Probe& probe = scene.output.probes.back();
  probe.region = region;
  probe.cells = cells;
  probe.by_material = by_material;
  probe.width = width;
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
  add_fields(s, s.domain.box(), {6, 4, 5}, true);
  for (Probe& probe : s.output.probes) probe.by_material = probe.kind != Probe::Kind::contacts;
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
  add_fields(s, {{0.01, 0.0, 0.0}, {0.07, 8 * 1.02 * d, 0.1}}, {3, 1, 6}, false, 2);
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
  add_wall(s, "cone", MeshShape{"cone.stl", shapes::cone_mesh(16, 3, 0.025, 0.055, 0.05)}, "steel").has_force_map =
      true;
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
    group.seed = static_cast<std::uint64_t>(material[0]);
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
  add_fields(s, {{0.0, 0.0, -d}, {0.3, 0.3, d}}, {9, 8, 1});
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

/// Wet grains that roll stiffly, poured into a mesh cone that a gate closes until it opens: liquid bridges among them and to the walls,
/// which break as they drain.
inline Scene wet_hopper() {
  Scene s = hopper(0.06);
  s.contact.rolling = RollingLaw::spring;
  s.contact.cohesion = CohesionLaw::liquid_bridge;
  for (PairLaw& p : s.contact.pairs) {
    p.rolling_friction = 0.1;
    p.surface_tension = 0.3;
    p.contact_angle = 0.3;
    p.liquid_volume = 5e-9;
  }
  s.contact.pairs[1].liquid_volume = 2e-9;  // steel is less wet
  return s;
}

/// Sticky grains of two sizes that two streams throw against each other, across all faces.
inline Scene sticky_flow() {
  Scene s = periodic_flow();
  s.contact.normal = NormalLaw::hertz;
  s.contact.tangential = TangentialLaw::mindlin;
  s.contact.rolling = RollingLaw::constant;
  s.contact.cohesion = CohesionLaw::jkr;
  s.time.step = 2e-5;
  s.particles[1].diameter.value = 0.7 * d;
  for (PairLaw& p : s.contact.pairs) {
    p.normal_stiffness = 0.0;
    p.rolling_friction = 0.05;
    p.work_of_adhesion = 3.0;
  }
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
  add_fields(s, s.domain.box(), {1, 2, 8});
  return s;
}

/// The same bed, into which grains are dropped and from which those that fly high are taken back to its foot.
inline Scene spouted_bed() {
  Scene s = fluidised_bed();
  Inlet drop;
  drop.name = "drop";
  drop.material = "glass";
  drop.diameter.value = d;
  drop.where = BoxRegion{{{0.0, 0.0, 0.3}, {0.16, 0.08, 0.33}}};
  drop.number_rate = 400.0;
  drop.velocity = {0.0, 0.0, -0.5};
  Inlet foot = drop;
  foot.name = "foot";
  foot.number_rate.reset();
  foot.where = BoxRegion{{{0.0, 0.0, 0.0}, {0.16, 0.08, 0.25}}};
  s.inlets = {drop, foot};
  Outlet high{"high", Box{{0.0, 0.0, 0.118}, {0.08, 0.08, 0.2}}};
  high.recycles = "foot";
  s.outlets.push_back(high);
  add_probe(s, Probe::Kind::mass, "mass");
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

/// Grains half as heavy as the water around them, which rise to the lid of a closed box and hang on to their push from step to step.
inline Scene in_water() {
  Scene s = basic();
  for (Material& material : s.materials) material.density *= 0.2;
  s.domain.high = {0.12, 0.04, 0.16};
  s.domain.periodic = {true, false, false};
  s.time.gravity = {0.0, 0.0, -9.81};
  s.particles = {lattice({{0, 0, 0.02}, {0.12, 0.04, 0.12}}, 1.05 * d)};
  s.particles[0].velocity_deviation = 0.1;
  add_wall(s, "floor", PlaneShape{{0, 0, 0}, {0, 0, 1}}, "steel");
  add_wall(s, "lid", PlaneShape{{0, 0, 0.16}, {0, 0, -1}}, "steel");
  add_wall(s, "front", PlaneShape{{0, 0, 0}, {0, 1, 0}}, "steel");
  add_wall(s, "back", PlaneShape{{0, 0.04, 0}, {0, -1, 0}}, "steel");
  s.gas = air({6, 2, 8});
  s.gas->density = 1000.0;
  s.gas->viscosity = 1e-3;
  s.gas->drag = DragLaw::di_felice;
  add_probe(s, Probe::Kind::pressure_drop, "pressure_drop");
  return s;
}

/// The fluidised bed in cells smaller than its grains, enough of them for two ranks to share them.
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

/// A mesh drum that starts to turn, with a blade that swings, a floor that shakes and a lid that turns with it and presses: every
/// motion of walls.
inline Scene drum() {
  Scene s = basic();
  s.domain.low = {-0.07, -0.07, -0.02};
  s.domain.high = {0.07, 0.07, 0.1};
  s.time.gravity = {-9.81, 0.0, 0.5};
  s.particles = {lattice({}, 1.03 * d), lattice({}, 1.03 * d, "steel")};
  std::get<LatticeFill>(s.particles[0].fill).region = CylinderRegion{{0, 0, 0.001}, 2, 0.045, 0.022};
  std::get<LatticeFill>(s.particles[1].fill).region = CylinderRegion{{0, 0, 0.024}, 2, 0.045, 0.022};
  for (ParticleGroup& group : s.particles) group.velocity_deviation = 0.1;
  using Kind = WallMotion::Kind;
  WallMotion turn;
  turn.kind = Kind::rotate;
  turn.speed = 14.0;
  turn.ramp = {{0.0, 0.0}, {0.02, 1.0}};
  TriangleMesh shell = shapes::cone_mesh(18, 3, 0.05, 0.05, 0.1);
  for (Vec3& vertex : shell.vertices) vertex.z -= 0.01;
  WallDefinition& turning = add_wall(s, "shell", MeshShape{"shell.stl", shell}, "steel");
  turning.motion = {turn};
  turning.has_force_map = true;
  WallMotion shake;
  shake.kind = Kind::vibrate;
  shake.amplitude = 4e-4;
  shake.frequency = 45.0;
  shake.phase = 0.3;
  add_wall(s, "floor", PlaneShape{{0, 0, -0.001}, {0, 0, 1}}, "steel").motion = {shake};
  WallMotion press;
  press.kind = Kind::servo;
  press.force = 1.5;
  press.gain = 0.05;
  press.max_speed = 0.2;
  press.mass = 0.01;
  add_wall(s, "lid", DiscShape{{0, 0, 0.06}, {0, 0, 1}, 0.049, 0.0}).motion = {turn, press};
  WallMotion swing, carry;
  swing.kind = Kind::swing;
  swing.amplitude = 0.7;
  swing.frequency = 5.0;
  carry.places = {{0.0, 0.0, 0.0, 0.0}, {0.04, 0.008, 0.0, 0.0}, {0.08, 0.0, 0.01, 0.0}};
  TriangleMesh blade;
  blade.vertices = {{-0.015, 0, -0.005}, {0.015, 0, -0.005}, {-0.015, 0, 0.05}, {0.015, 0, 0.05}};
  blade.triangles = {{0, 1, 2}, {1, 3, 2}};
  add_wall(s, "blade", MeshShape{"blade.stl", blade}).motion = {swing, carry};
  for (const char* wall : {"shell", "floor", "lid", "blade"})
    add_probe(s, Probe::Kind::wall_force, std::string(wall) + "_force", wall);
  return s;
}

/// The drum with a lid and a blade that a program moves: see trace::drive().
inline Scene driven() {
  Scene s = drum();
  for (WallDefinition& wall : s.walls)
    if (wall.name == "lid" || wall.name == "blade") {
      WallMotion script;
      script.kind = WallMotion::Kind::script;
      script.max_speed = wall.name == "lid" ? 0.5 : 3.0;
      if (wall.name == "blade") script.origin = {0.003, 0.0, 0.02};
      wall.motion = {script};
    }
  return s;
}

/// A hopper with a blade that turns, fed by inlets of every kind and drained by outlets of every kind; what falls out comes back.
inline Scene refilled_hopper() {
  Scene s = basic();
  s.domain.low = {-0.06, -0.06, -0.02};
  s.domain.high = {0.06, 0.06, 0.25};
  s.time.gravity = {0.0, 0.0, -9.81};
  s.particles = {lattice({}, 1.03 * d)};
  std::get<LatticeFill>(s.particles[0].fill).region = CylinderRegion{{0, 0, 0.09}, 2, 0.05, 0.03};
  s.particles[0].velocity_deviation = 0.1;
  add_wall(s, "silo", CylinderShape{{0, 0, 0.05}, {0, 0, 1}, 0.055, 0.2});
  add_wall(s, "cone", MeshShape{"cone.stl", shapes::cone_mesh(16, 3, 0.022, 0.055, 0.05)}, "steel");
  TriangleMesh blade;
  blade.vertices = {{-0.05, 0, 0.06}, {0.05, 0, 0.06}, {-0.05, 0, 0.08}, {0.05, 0, 0.08}};
  blade.triangles = {{0, 1, 2}, {1, 3, 2}};
  WallMotion turn;
  turn.kind = WallMotion::Kind::rotate;
  turn.speed = 9.0;
  add_wall(s, "blade", MeshShape{"blade.stl", blade}, "steel").motion = {turn};

  Inlet top;
  top.name = "top";
  top.material = "glass";
  top.diameter.value = d;
  top.where = CylinderRegion{{0, 0, 0.19}, 2, 0.05, 0.03};
  top.number_rate = 900.0;
  top.velocity = {0.1, 0.0, -1.0};
  top.velocity_deviation = 0.1;
  Inlet side = top;
  side.name = "side";
  side.material = "steel";
  side.diameter.kind = SizeDistribution::Kind::uniform;
  side.diameter.low = 0.006;
  side.diameter.high = 0.009;
  side.where = DiscShape{{0, 0, 0.17}, {0, 0.2, 1}, 0.05, 0.01};
  side.number_rate.reset();
  side.mass_rate = 0.5;
  side.from = 0.01;
  Inlet back = top;
  back.name = "back";
  back.number_rate.reset();
  back.where = BoxRegion{{{-0.03, -0.03, 0.235}, {0.03, 0.03, 0.248}}};
  Inlet kept = top;
  kept.name = "kept";
  kept.number_rate.reset();
  kept.fill_count = 9;
  kept.where = SphereRegion{{0, 0, 0.14}, 0.03};
  kept.interval = 2e-3;
  kept.until = 0.06;
  Inlet crowded = top;  // finds no room for most of what it owes
  crowded.name = "crowded";
  crowded.number_rate = 4000.0;
  crowded.where = PolygonShape{{{0.0, -0.045, 0.18}, {0.03, -0.02, 0.18}, {0.0, -0.005, 0.18}}};
  crowded.from = 0.03;
  s.inlets = {top, side, back, kept, crowded};

  Outlet bottom{"bottom", 4};
  bottom.recycles = "back";
  Outlet ring{"ring", DiscShape{{0, 0, 0.001}, {0, 0, 1}, 0.015, 0.006}};
  Outlet cut{"cut", Box{{0.0, 0.0, 0.08}, {0.06, 0.06, 0.12}}};
  cut.from = 0.05;
  cut.is_once = true;
  TriangleMesh trap;
  trap.vertices = {{-0.05, -0.05, 0.1}, {-0.02, -0.05, 0.1}, {-0.02, 0.0, 0.1}};
  trap.triangles = {{0, 1, 2}};
  Outlet net{"net", MeshShape{"trap.stl", trap}};
  net.from = 0.06;
  net.recycles = "back";
  s.outlets = {bottom, ring, cut, net};
  add_probe(s, Probe::Kind::mass, "mass");
  add_probe(s, Probe::Kind::wall_force, "blade_force", "blade");
  add_probe(s, Probe::Kind::mixing, "mixing");
  s.output.probes.back().material = "steel";
  return s;
}

/// Rows of grains of equal size, each an eighth as heavy as the one before, almost touching: hit at their heavy ends they shoot their
/// light ones at each other, ten times as fast as anything was before (Galileo's cannon). A list of neighbours with a skin of a radius, which
/// all before them would not use up for long, is old before they meet, just outside it.
inline Scene cannons() {
  constexpr int n_stages = 5;
  constexpr double r = 0.5 * d, dt = 4e-5, pi = 3.14159265358979323846;
  constexpr double slow = 0.0017 * r / dt;  // [m/s]
  Scene s;
  s.time.end = 10.0;
  s.time.step = dt;
  s.run.skin = r;
  s.domain.high = {0.4, 0.06, 0.06};
  s.contact.rotation = false;
  s.contact.tangential = TangentialLaw::none;
  const double volume = 4.0 / 3.0 * pi * r * r * r;
  for (int k = 0; k < n_stages; ++k)
    s.materials.push_back(
        {"stage" + std::to_string(k), 5.0 * static_cast<double>(1 << 3 * (n_stages - 1 - k)), 5e6, 0.3});
  for (int a = 0; a < n_stages; ++a)
    for (int b = a; b < n_stages; ++b) {
      const Material &first = s.materials[static_cast<std::size_t>(a)],
                     &second = s.materials[static_cast<std::size_t>(b)];
      PairLaw p;
      p.between = {first.name, second.name};
      const double mass = volume * first.density * second.density / (first.density + second.density);
      p.normal_stiffness = mass * (pi / (10.0 * dt)) * (pi / (10.0 * dt));  // ten steps a contact
      p.restitution = 0.98;
      s.contact.pairs.push_back(p);
    }
  ListedGrains list;
  list.has_velocity = list.has_radius = true;
  for (int row = 0; row < 12; ++row)
    for (const double side : {-1.0, 1.0}) {
      const double middle = 0.07 + 0.13 * (row % 3) + 0.004 * (row / 3);
      double x = middle + side * (r + 0.51 * r);  // the light ones are a little more than a skin apart
      for (int k = n_stages - 1; k >= 0; --k) {
        GrainSeed seed;
        seed.radius = r;
        seed.material = static_cast<std::uint16_t>(k);
        if (k == 0) {
          x += side * 41.5 * slow * dt;
          seed.velocity = {-side * slow * (1.0 - 0.002 * row), 0.0, 0.0};
        }
        seed.position = {x, 0.015 + 0.03 * (row / 3 % 2), 0.015 + 0.03 * (row / 6)};
        x += side * 1.0002 * d;
        list.grains.push_back(seed);
      }
    }
  ParticleGroup group;
  group.fill = list;
  s.particles = {group};
  add_wall(s, "box", BoxShape{s.domain.box()}, "stage0");
  add_probe(s, Probe::Kind::contacts, "contacts");
  return s;
}

/// The same with contact forces in float.
inline Scene in_mixed_precision(Scene s) {
  s.run.precision = Precision::mixed;
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
          {"drum", drum(), 2500},
          {"refilled hopper", refilled_hopper(), 2500},
          {"spouted bed", spouted_bed(), 1500},
          {"wet hopper", wet_hopper(), 2500},
          {"sticky flow", sticky_flow(), 1500},
          {"fluidised bed", fluidised_bed(), 2500},
          {"finely resolved", finely_resolved(), 500},
          {"conveyed", conveyed(), 2500},
          {"in water", in_water(), 1500},
          {"flat jet", flat_jet(), 3000},
          {"cannons", cannons(), 750},
          {"polydisperse, mixed precision", in_mixed_precision(polydisperse()), 1500},
          {"refilled hopper, mixed precision", in_mixed_precision(refilled_hopper()), 1500},
          {"sticky flow, mixed precision", in_mixed_precision(sticky_flow()), 800}};
}

}  // namespace moraine::scenes
