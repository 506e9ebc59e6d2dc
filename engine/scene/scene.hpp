// A scene: everything that defines a run, as plain structs in SI units with defaults. Whoever builds a scene (the TOML
// reader, Python, a test) starts from these defaults and overrides what it means to. Files named by a scene (meshes,
// start positions) are loaded by the reader, so that the engine never opens a file.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "kernels/base/box.hpp"
#include "kernels/base/vec3.hpp"
#include "kernels/contact/law_kinds.hpp"
#include "kernels/drag/kinds.hpp"

namespace moraine {

class World;

inline constexpr double infinity = std::numeric_limits<double>::infinity();

struct Domain {
  Vec3 low;   // [m]
  Vec3 high;  // [m]
  std::array<bool, 3> periodic = {false, false, false};
  int dimensions = 3;  // 2: the z components of motion are frozen
  Box box() const { return {low, high}; }
};

struct TimeControl {
  double end = 0.0;                 // [s]
  std::optional<double> step;       // [s]; none: chosen from the stiffest contact
  double steps_per_contact = 50.0;  // [-] with an automatic step: steps in the shortest contact
  double max_speed = 0.0;           // [m/s] fastest approach to expect, for Hertz contacts; 0: estimated from the scene
  Vec3 gravity;                     // [m/s2]
  double damping = 0.0;             // [1/s] bulk viscosity c: F = -c m v, T = -c I omega
};

struct Material {
  std::string name;
  double density = 0.0;  // [kg/m3]
  double young = 0.0;    // [Pa]; needed by Hertz contacts
  double poisson = 0.3;  // [-]
};

/// Contact parameters of one pair of materials.
struct PairLaw {
  std::array<std::string, 2> between;
  double normal_stiffness = 0.0;               // [N/m]; linear normal law
  std::optional<double> tangential_stiffness;  // [N/m]; spring and power; none: 2/7 of the normal one (linear only)
  double restitution = 1.0;                    // [-] normal, in (0, 1]
  double friction = 0.0;                       // [-] Coulomb's coefficient
  std::optional<double> tangential_damping;  // [-] tangential dashpot over the normal one (linear; none: 0.5), or over
                                             //     the one that matches the tangential spring (Hertz; none: 1)
  double tangential_viscosity = 0.0;         // [N s/m]; viscous tangential law
  std::optional<double> tangential_displacement;  // [m] delta_max of the power law; none: 1.5 mu F_N / k_t
  double rolling_friction = 0.0;                  // [-] torque of rolling resistance over R* F_n
  std::optional<double> rolling_stiffness;        // [N m/rad] rolling spring; none: 2.25 k_n (mu_r R*)^2
  double rolling_damping = 0.3;                   // [-] share of the critical damping; rolling spring
  double work_of_adhesion = 0.0;                  // [J/m2] jkr
  double cohesion_energy_density = 0.0;           // [J/m3] sjkr
  double cohesion_force = 0.0;                    // [N] linear
  double cohesion_range = 0.0;                    // [m] linear: gap at which the attraction ends
  double surface_tension = 0.0;                   // [N/m] liquid bridge
  double contact_angle = 0.0;                     // [rad] of the liquid
  double liquid_volume = 0.0;                     // [m3] of a bridge
};

struct ContactLaws {
  NormalLaw normal = NormalLaw::linear;
  TangentialLaw tangential = TangentialLaw::spring;
  RollingLaw rolling = RollingLaw::none;
  CohesionLaw cohesion = CohesionLaw::none;
  bool rotation = true;
  std::vector<PairLaw> pairs;
};

/// Diameters of a group of grains [m].
struct SizeDistribution {
  enum class Kind { single, uniform, normal, lognormal, list };
  Kind kind = Kind::single;
  double value = 0.0;                  // single: the diameter
  double low = 0.0, high = 0.0;        // bounds of uniform; truncation of normal and lognormal
  double mean = 0.0, deviation = 0.0;  // normal, lognormal: mean and standard deviation of the diameter
  std::vector<double> values;          // list: diameters ...
  std::vector<double> weights;         // ... and their shares by number (need not add up to 1)
};

/// A part of space to be filled. `axis` of a cylinder: 0, 1, 2 for x, y, z.
struct BoxRegion {
  Box box;
};
struct CylinderRegion {
  Vec3 base;
  int axis = 2;
  double radius = 0.0;
  double length = 0.0;
};
struct SphereRegion {
  Vec3 centre;
  double radius = 0.0;
};
using Region = std::variant<BoxRegion, CylinderRegion, SphereRegion>;

/// Random positions without overlap, to a solid fraction or a count (exactly one of them is given).
struct RandomFill {
  Region region;
  std::optional<double> solid_fraction;  // [-] volume of grains over volume of region
  std::optional<std::int64_t> count;
};
/// Grains on a lattice in a region, spacing between neighbours; jitter displaces each by up to that fraction of the
/// free gap.
struct LatticeFill {
  enum class Kind { cubic, hexagonal };
  Kind kind = Kind::cubic;
  Region region;
  double spacing = 0.0;               // [m]; 0: largest diameter times 1.001
  double jitter = 0.0;                // [-] 0 to 1
  std::optional<std::int64_t> count;  // stop after so many
};

/// One grain at birth.
struct GrainSeed {
  Vec3 position;               // [m]
  Vec3 velocity;               // [m/s]
  Vec3 angular_velocity;       // [rad/s]
  double radius = 0.0;         // [m]
  std::uint16_t material = 0;  // index into Scene::materials
};
/// The rows of a list that a rank keeps where several share it: blocks of consecutive rows, dealt out in turn. A rank
/// that is not below n_ranks keeps none.
struct ListShare {
  std::uint64_t rank = 0, n_ranks = 1;
  std::uint64_t block = 1024;  // rows
  bool is_empty() const { return rank >= n_ranks; }
  bool has(std::uint64_t row) const { return row / block % n_ranks == rank; }
  /// Number in the list of the i-th row that the rank keeps; both count from 0.
  std::uint64_t row(std::uint64_t i) const { return (i / block * n_ranks + rank) * block + i % block; }
};
/// What a run must know of a whole list, of which its rank may have a share only.
struct ListFacts {
  struct OfMaterial {
    std::uint64_t n_grains = 0;
    double smallest = infinity, largest = 0.0;  // [m] diameters; of radii that can be used
  };
  std::uint64_t n_grains = 0;
  std::vector<OfMaterial> of_material;  // by index into Scene::materials, as far as there are grains
  double sum_of_diameters = 0.0;        // [m]
  double fastest = 0.0;                 // [m/s]
  bool uses(std::size_t material) const { return material < of_material.size() && of_material[material].n_grains > 0; }
};
/// Grains read from a file or listed in the scene. Columns that the source did not have are taken from the group.
struct ListedGrains {
  std::string source;             // file name, for messages; empty: listed in the scene
  std::vector<GrainSeed> grains;  // of this rank's share
  bool has_radius = false;
  bool has_velocity = false;  // of both velocities
  bool has_material = false;  // the material of a group, where it has one, goes before that of its grains
  ListShare share = {};
  std::optional<ListFacts> whole = {};  // where ranks share the list; none: all its grains are here
};

struct ParticleGroup {
  std::string material;
  SizeDistribution diameter;
  std::variant<RandomFill, LatticeFill, ListedGrains> fill;
  Vec3 velocity;                    // [m/s]
  double velocity_deviation = 0.0;  // [m/s] standard deviation of each velocity component around `velocity`
  Vec3 angular_velocity;            // [rad/s]
  std::uint64_t seed = 1;
};

struct TriangleMesh {
  std::vector<Vec3> vertices;                          // [m]
  std::vector<std::array<std::int32_t, 3>> triangles;  // indices into vertices
};

/// Wall shapes. Grains touch a plane from the side its normal points to; every other shape from either side.
struct PlaneShape {
  Vec3 point;
  Vec3 normal{0, 0, 1};
};
struct BoxShape {
  Box box;
};  // six planes that face inwards
struct CylinderShape {
  Vec3 base;
  Vec3 axis{0, 0, 1};
  double radius = 0.0;
  double length = 0.0;
};  // lateral surface from base along axis
struct ConeShape {
  Vec3 base;
  Vec3 axis{0, 0, 1};
  double radius_base = 0.0;
  double radius_top = 0.0;
  double length = 0.0;
};
struct DiscShape {
  Vec3 centre;
  Vec3 normal{0, 0, 1};
  double radius = 0.0;
  double hole_radius = 0.0;
};
struct MeshShape {
  std::string file;
  TriangleMesh mesh;
};

/// One motion of a wall; the wall is as described where it has not moved. The motions of a wall are carried out one after the other:
/// a later one takes along where the earlier ones have brought the wall. Axes and origins are fixed in space.
struct WallMotion {
  enum class Kind {
    translate,  // with `velocity`, or through `places`
    rotate,     // with `speed`, or through `angles`
    vibrate,    // by amplitude sin(2 pi frequency t + phase) along `axis`
    swing,      // by the same angle about the axis through `origin`
    servo,      // along, or about, the axis until the grains push with `force` or turn with `torque`
    script,  // as a function of the program that runs the scene says (Simulation::set_wall_motion); the only motion of its wall
  };
  Kind kind = Kind::translate;
  Vec3 velocity;                              // [m/s]
  std::vector<std::array<double, 4>> places;  // [s], [m] displacement; straight between, resting beyond
  Vec3 origin;  // [m] of rotate, swing, and a servo that turns; of script: the point whose velocity is given
  Vec3 axis{0, 0, 1};
  double speed = 0.0;                         // [rad/s] right-handed about the axis
  std::vector<std::array<double, 2>> angles;  // [s], [rad]; straight between, resting beyond
  std::vector<std::array<double, 2>> ramp;    // [s], [-] factor on velocity or speed; straight between, constant beyond
  double amplitude = 0.0;                     // [m], or [rad] of swing
  double frequency = 0.0;                     // [Hz]
  double phase = 0.0;                         // [rad]
  std::optional<double> force;                // [N] servo: what the grains are to push with along the axis
  std::optional<double> torque;               // [N m] servo: about it
  double gain = 0.0;                          // [m/(s N)] or [rad/(s N m)] servo: speed per missing force or torque
  double max_speed = 0.0;  // [m/s] or [rad/s] servo; of script [m/s]: no point of it in the domain is faster
  double mass = 0.0;       // [kg] or [kg m2] servo: inertia against changes of the speed
  bool turns() const { return kind == Kind::rotate || kind == Kind::swing || (kind == Kind::servo && torque); }
};

struct WallDefinition {
  std::string name;
  std::string material;
  std::variant<PlaneShape, BoxShape, CylinderShape, ConeShape, DiscShape, MeshShape> shape;
  bool frictionless = false;
  bool symmetry = false;    // planes only: a mirror; grains meet their own image, without friction
  double from = 0.0;        // [s] the wall exists from this time ...
  double until = infinity;  // [s] ... until this time
  std::vector<WallMotion> motion = {};
  bool has_force_map = false;  // meshes: the mean force on each triangle goes with the snapshots
  bool has(WallMotion::Kind kind) const {
    for (const WallMotion& m : motion)
      if (m.kind == kind) return true;
    return false;
  }
};

/// Where grains leave the scene: as their centre passes a face of the domain or lies behind a plane, as it lies in a region, or as it
/// crosses a disc or a mesh.
struct Outlet {
  std::string name;
  // face: 0 x-low, 1 x-high, 2 y-low, 3 y-high, 4 z-low, 5 z-high
  std::variant<int, Box, CylinderRegion, SphereRegion, PlaneShape, DiscShape, MeshShape> where;
  double from = 0.0;          // [s] it is open from this time ...
  double until = infinity;    // [s] ... until this time
  bool is_once = false;       // open in one step only, that in which `from` is reached
  std::string recycles = {};  // inlet through which its grains come back; empty: none
};

/// A flat polygon, its corners in order around it.
struct PolygonShape {
  std::vector<Vec3> points;  // [m]
};

/// Where grains are born while the scene runs. Grains lie wholly inside a region, or with their centre on a disc or polygon and
/// wholly inside its rim. What it owes but finds no room for stays owed.
struct Inlet {
  std::string name;
  std::string material;
  SizeDistribution diameter;
  std::variant<BoxRegion, CylinderRegion, SphereRegion, DiscShape, PolygonShape> where;
  // What it gives; at most one of these, and none only where outlets recycle into it.
  std::optional<double> number_rate;          // [1/s]
  std::optional<double> mass_rate;            // [kg/s]
  std::optional<std::int64_t> fill_count;     // so many grains are to be inside the region
  std::optional<double> fill_mass;            // [kg] so much is to be inside
  std::optional<double> fill_solid_fraction;  // [-] so much of the region is to be filled
  std::optional<ListedGrains> list;           // these, each at its place
  // No more than that altogether; recycled grains do not count.
  std::optional<std::int64_t> total_count;
  std::optional<double> total_mass;  // [kg]
  double from = 0.0;                 // [s]
  double until = infinity;           // [s]
  double interval = 0.0;             // [s] between births; 0: as soon as a grain is owed (rates), else chosen
  Vec3 velocity;                     // [m/s]
  double velocity_deviation = 0.0;   // [m/s] standard deviation of each velocity component around `velocity`
  Vec3 angular_velocity;             // [rad/s]
  std::uint64_t seed = 1;
};

/// What the gas meets on a face of the domain, or on a part of one. Faces count as in Outlet. Where nothing is given the gas meets a
/// wall that it sticks to; later entries go before earlier ones where they overlap.
struct GasBoundary {
  enum class Kind { velocity, pressure, no_slip, free_slip };
  enum class Profile { uniform, parabolic };  // parabolic: zero at the edges of the part, its mean is the velocity
  Kind kind = Kind::no_slip;
  int face = 0;
  std::optional<Box> part;  // [m] the cells whose face centres lie in it; none: the whole face
  /// [m/s] kind velocity: volume of gas per time and area (superficial), positive along the axes. no_slip: of the wall, along itself.
  Vec3 velocity;
  Profile profile = Profile::uniform;
  std::vector<std::array<double, 2>>
      ramp;               // [s], [-]: factor of the velocity over time, linear between, constant beyond
  double pressure = 0.0;  // [Pa] kind pressure, above hydrostatic
};

/// Volume-averaged gas between the grains.
struct Gas {
  std::array<int, 3> cells{};  // z: 1 in two dimensions
  double density = 0.0;        // [kg/m3]
  double viscosity = 0.0;      // [Pa s]
  std::optional<double>
      step;  // [s] at most; none: chosen. A whole number of grain steps; divided further where the gas is fast
  std::optional<DragLaw> drag;  // none: grains do not feel the gas, nor the gas the grains
  GasModel model = GasModel::a;
  GasWeights weights = GasWeights::trilinear;
  double smoothing = 0.0;            // [m] standard deviation of the spread, for weights = smoothed
  double least_void_fraction = 0.3;  // [-] cells are not taken as denser than that; how often is counted
  bool moves_gas = true;             // false: grains feel the gas, but not the gas the grains (one-way)
  Vec3 velocity;                     // [m/s] at the start, between the grains
  Vec3 pressure_gradient;            // [Pa/m] mean, in periodic directions
  double tolerance = 1e-6;           // [-] largest mass imbalance of a cell in a gas step, of the gas it holds
  std::vector<GasBoundary> boundaries;
};

/// Time series written to NAME.csv in the run directory.
struct Probe {
  enum class Kind {
    energy,         // the energy ledger
    wall_force,     // force on `wall` [N] and torque about the origin [N m]
    wall_pressure,  // normal force on `wall` per area, in `bins` slices along `axis` of its extent
    region,         // in `region`: count, solid fraction, mean velocity, mean squared fluctuation, coordination number
    mass,           // born, inside, left: counts and masses, and the mass flow through the outlets
    profile,        // solid fraction and mean velocity in `bins` slices of `region` along `axis`
    contacts,       // number of contacts, mean and maximum overlap relative to the radius
    pressure,       // of the gas at `points`
    pressure_drop,  // of the gas along `axis`, between two planes
    bed_height,     // height along `axis` below which `share` of the grains' mass lies, and their mean height
    gas_profile,    // averages over time since `from` in the layers of cells of `region` along `axis`
    gas_mean,       // averages over time since `from` in every cell, kept with snapshots and checkpoints
    mixing,  // how well grains of `material` are mixed with the others in cells of `region`, `bins` along its longest side
    fields,  // coarse-grained fields on a grid over `region`, averaged over time, in files of their own
  };
  Kind kind = Kind::energy;
  std::string name;
  std::string wall;
  Box region;  // [m]
  int axis = 2;
  int bins = 1;
  double interval = 0.0;                         // [s]
  std::vector<Vec3> points;                      // [m]
  std::optional<std::array<double, 2>> between;  // [m] along the axis; none: the faces of the domain
  double share = 0.95;                           // [-]
  double from = 0.0;                             // [s]
  std::string material = {};
  bool by_material = false;        // region, profile, fields: of each material besides
  std::array<int, 3> cells = {};   // fields: of the region
  int width = 1;                   // [cells] fields: a grain is spread over as many as two of these to each side
  std::optional<int> margin = {};  // [cells] fields: beyond the region; none: as far as the weight reaches
  double average = 0.0;            // [s] fields: whose samples are averaged into one file; 0: each is a file of its own
  bool has_table = false;          // fields: files as CSV besides
};
/// As a scene file has it: "wall_force".
const char* name_of(Probe::Kind kind);
/// True where the probe looks at the gas.
bool needs_gas(Probe::Kind kind);

struct Output {
  std::string directory;             // empty: runs/NAME of the scene file
  double snapshot_interval = 0.0;    // [s]; 0: none but the last
  double checkpoint_interval = 0.0;  // [s] of simulated time; 0: only at the end and on signals
  int checkpoints_kept = 2;
  bool distributed = false;  // snapshots and checkpoints: a file per rank, and one in front that shows their rows
  std::vector<std::string> fields;  // of snapshots; empty: all that travel
  bool energy = false;              // keep the energy ledger
  std::vector<Probe> probes;
};

enum class Precision { double_, mixed };

/// What may follow the grains as they move from the space of one rank to that of another: the shares of the cores of a node that
/// ranks have, the cuts between ranks, both, or nothing.
enum class Balance { automatic, threads, cuts, off };

/// What a run survives, but whoever reads its results must know.
enum class Concern { energy, gas_balance, void_fraction };
inline constexpr std::array<const char*, 3> concern_names = {"energy", "gas_balance", "void_fraction"};
constexpr const char* name_of(Concern concern) { return concern_names[static_cast<std::size_t>(concern)]; }

struct RunControl {
  std::string layout = "auto";  // ranks x threads
  Balance balance = Balance::automatic;
  Precision precision = Precision::double_;
  double skin = 0.0;                 // [m]; 0: chosen
  double max_overlap = 0.5;          // [-] of the smaller radius; beyond it the run stops
  std::vector<std::string> stop_on;  // names of concerns that end the run, not only warn
};

struct Scene {
  std::string title;
  Domain domain;
  TimeControl time;
  std::vector<Material> materials;
  ContactLaws contact;
  std::vector<ParticleGroup> particles;
  std::vector<WallDefinition> walls;
  std::vector<Outlet> outlets;
  std::vector<Inlet> inlets;
  std::optional<Gas> gas;
  Output output;
  RunControl run;

  /// Index of the material with that name, or -1.
  int material_index(const std::string& name) const;
  /// Parameters for two materials, in either order; nullptr where the scene gives none.
  const PairLaw* pair_law(const std::string& a, const std::string& b) const;
};

/// Something wrong with a scene: which key, what is wrong with it, and the cure.
struct Problem {
  std::string key;      // path such as "particles[1].diameter"
  std::string message;  // what was found, what was expected
  bool is_warning = false;
};

/// Every problem of a scene that can be seen without building it. Empty: the scene can be run.
std::vector<Problem> validate(const Scene& scene);
/// The same where the ranks of `world` share the scene's lists, which look at their shares and find the same together.
/// All ranks call it. Overlaps of two listed grains are not looked for where each rank has a part of them.
std::vector<Problem> validate(const Scene& scene, const World& world);

/// Thrown where a scene cannot be run; `what()` lists all problems, one a line.
struct SceneError : std::runtime_error {
  explicit SceneError(std::vector<Problem> all) : std::runtime_error(text(all)), problems(std::move(all)) {}
  std::vector<Problem> problems;

 private:
  static std::string text(const std::vector<Problem>& all) {
    std::string lines;
    for (const Problem& problem : all) {
      if (!lines.empty()) lines += '\n';
      lines += problem.key.empty() ? problem.message : problem.key + ": " + problem.message;
    }
    return lines;
  }
};

}  // namespace moraine
