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

void check_materials(const Scene& scene, Findings& found);
void check_contact(const Scene& scene, Findings& found);
void check_particles(const Scene& scene, Findings& found);
void check_walls(const Scene& scene, Findings& found);
void check_outlets(const Scene& scene, Findings& found);
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
