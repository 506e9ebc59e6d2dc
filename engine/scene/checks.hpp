// The parts of validate(): each looks at one section of a scene and adds what it finds. Private to engine/scene.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "comm/world.hpp"
#include "engine/scene/scene.hpp"

namespace moraine::checks {

/// Collects problems. Messages read on from the key: "time.end" "is -1; expected more than 0 [s]".
class Findings {
 public:
  /// `world`: the ranks that look at the scene together.
  explicit Findings(const Domain& domain, const World& world = {}) : domain_(domain), world_(world) {}
  const World& world() const { return world_; }

  template <class... Args>
  void error(std::string key, fmt::format_string<Args...> format, Args&&... args) {
    problems_.push_back({std::move(key), fmt::format(format, std::forward<Args>(args)...), false});
  }
  template <class... Args>
  void warning(std::string key, fmt::format_string<Args...> format, Args&&... args) {
    problems_.push_back({std::move(key), fmt::format(format, std::forward<Args>(args)...), true});
  }

  // Each returns whether the value is as it must be. `unit` is written in brackets; "-" for pure numbers.
  bool finite(const std::string& key, double value, const char* unit) {
    if (std::isfinite(value)) return true;
    error(key, "is {}; expected a finite number [{}]", value, unit);
    return false;
  }
  bool finite(const std::string& key, Vec3 value, const char* unit) {
    if (std::isfinite(value.x) && std::isfinite(value.y) && std::isfinite(value.z)) return true;
    error(key, "is [{}, {}, {}]; expected finite numbers [{}]", value.x, value.y, value.z, unit);
    return false;
  }
  bool positive(const std::string& key, double value, const char* unit) {
    if (std::isfinite(value) && value > 0.0) return true;
    error(key, "is {}; expected a number greater than 0 [{}]", value, unit);
    return false;
  }
  bool not_negative(const std::string& key, double value, const char* unit) {
    if (std::isfinite(value) && value >= 0.0) return true;
    error(key, "is {}; expected 0 or more [{}]", value, unit);
    return false;
  }
  /// A box with low < high in every direction. A corner that it has from the domain is told of there, not here.
  bool box(const std::string& key, const Box& box);

  std::vector<Problem> take() { return std::move(problems_); }

 private:
  const Domain& domain_;
  World world_;
  std::vector<Problem> problems_;
};

inline constexpr char axis_names[] = "xyz";

/// False where the domain cannot be used to judge anything else.
bool is_usable(const Domain& domain);
std::string text(Vec3 v);
std::string text(const Box& box);
/// Names in quotes with commas between; the first few of many.
std::string listing(const std::vector<std::string>& names, std::size_t most = 8);
/// The known name nearest to one that is not known, as " (did you mean ...?)"; empty where none is near.
std::string nearest(const std::string& name, const std::vector<std::string>& known);

/// "y-low" of 2.
const char* face_name(int face);

/// Smallest and largest diameter that a group can give [m]; zeros where it says nothing usable.
std::pair<double, double> diameter_range(const ParticleGroup& group);

/// Whether two boxes have a point in common, faces included.
bool meets(const Box& a, const Box& b);

/// Diameters of a distribution.
void check_sizes(const SizeDistribution& sizes, const std::string& key, Findings& found);
/// A region that lies in the domain; false where it cannot be used. `key` is that of the region.
bool check_region(const Scene& scene, const Region& region, const std::string& key, Findings& found);
/// Room in a region, given by the box around it, for a diameter.
void check_room(const Box& bounds, double largest, const std::string& key, const Domain& domain, Findings& found);
Box bounds(const Region& region);

// Shapes; `key` is that of what has the shape.
void check_plane(const PlaneShape& plane, const std::string& key, const Domain& domain, Findings& found);
void check_disc(const DiscShape& disc, const std::string& key, const Domain& domain, Findings& found);
void check_mesh(const MeshShape& mesh, const std::string& key, const Domain& domain, Findings& found);

/// Index of the first thing of the same name before i, or i.
template <class Things>
std::size_t first_named_like(const Things& things, std::size_t i) {
  for (std::size_t j = 0; j < i; ++j)
    if (things[j].name == things[i].name) return j;
  return i;
}

template <class Things>
void check_name(const Things& things, std::size_t i, const std::string& section, Findings& found) {
  const std::string key = fmt::format("{}[{}].name", section, i);
  if (things[i].name.empty())
    found.error(key, "is empty; give it a name");
  else if (const std::size_t first = first_named_like(things, i); first != i)
    found.error(key, "\"{}\" is the name of {}[{}] too; names must differ", things[i].name, section, first);
}

void check_materials(const Scene& scene, Findings& found);
void check_contact(const Scene& scene, Findings& found);
void check_particles(const Scene& scene, Findings& found);
void check_walls(const Scene& scene, Findings& found);
void check_outlets(const Scene& scene, Findings& found);
void check_inlets(const Scene& scene, Findings& found);
void check_gas(const Scene& scene, Findings& found);
void check_probes(const Scene& scene, Findings& found);

/// A sphere listed in a scene, for the search for overlaps.
struct ListedSphere {
  Vec3 centre;
  double radius = 0.0;
};
struct OverlapReport {
  std::int64_t count = 0;   // pairs that overlap by more than the limit
  std::int64_t first = -1;  // the worst of them, by overlap over the smaller radius; indices into the list
  std::int64_t second = -1;
  double overlap = 0.0;   // [m]
  double relative = 0.0;  // [-] overlap over the smaller radius
};
/// Pairs whose overlap exceeds `limit` times the smaller radius; periodic images count. Time grows as the number of
/// spheres.
OverlapReport find_overlaps(const std::vector<ListedSphere>& spheres, const Domain& domain, double limit);

/// Overlap of a listed grain with anything, at the start, over the smaller radius: beyond it the scene is refused.
inline constexpr double max_start_overlap = 0.2;

}  // namespace moraine::checks
