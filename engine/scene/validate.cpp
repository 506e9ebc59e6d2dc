#include <algorithm>
#include <array>
#include <numeric>

#include "engine/particles/fields.hpp"
#include "engine/scene/checks.hpp"

namespace moraine {

namespace checks {

namespace {
/// Equal, or neither of them a number: a corner that was taken from the domain.
bool is_same_corner(Vec3 a, Vec3 b) {
  const auto is_same = [](double x, double y) { return x == y || (std::isnan(x) && std::isnan(y)); };
  return is_same(a.x, b.x) && is_same(a.y, b.y) && is_same(a.z, b.z);
}
}  // namespace

bool Findings::box(const std::string& key, const Box& box) {
  const bool has_domains_corner = is_same_corner(box.low, domain_.low) || is_same_corner(box.high, domain_.high);
  if (has_domains_corner && !is_usable(domain_) && key != "domain") return false;
  if (!finite(key + ".low", box.low, "m") || !finite(key + ".high", box.high, "m")) return false;
  bool is_good = true;
  for (int axis = 0; axis < 3; ++axis) {
    if (box.low[axis] < box.high[axis]) continue;
    error(fmt::format("{}.high[{}]", key, axis), "is {}; expected more than low[{}] = {} [m]", box.high[axis], axis,
          box.low[axis]);
    is_good = false;
  }
  return is_good;
}

bool meets(const Box& a, const Box& b) {
  for (int axis = 0; axis < 3; ++axis)
    if (a.low[axis] > b.high[axis] || a.high[axis] < b.low[axis]) return false;
  return true;
}

bool is_usable(const Domain& domain) {
  for (int axis = 0; axis < 3; ++axis)
    if (!std::isfinite(domain.low[axis]) || !std::isfinite(domain.high[axis]) ||
        !(domain.low[axis] < domain.high[axis]))
      return false;
  return true;
}

std::string text(Vec3 v) { return fmt::format("[{:.6g}, {:.6g}, {:.6g}]", v.x, v.y, v.z); }
std::string text(const Box& box) { return text(box.low) + " to " + text(box.high); }

const char* face_name(int face) {
  constexpr std::array names = {"x-low", "x-high", "y-low", "y-high", "z-low", "z-high"};
  return names[static_cast<std::size_t>(face)];
}

std::string listing(const std::vector<std::string>& names, std::size_t most) {
  std::string all;
  for (std::size_t i = 0; i < std::min(names.size(), most); ++i)
    all += fmt::format("{}\"{}\"", i ? ", " : "", names[i]);
  if (names.size() > most) all += fmt::format(" and {} more", names.size() - most);
  return all;
}

namespace {

/// Insertions, deletions and replacements between two words (Levenshtein 1966).
std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, diagonal + 1});
    }
  }
  return row.back();
}

}  // namespace

std::string nearest(const std::string& name, const std::vector<std::string>& known) {
  const std::string* best = nullptr;
  std::size_t least = std::max<std::size_t>(2, name.size() / 3) + 1;
  for (const std::string& candidate : known) {
    const std::size_t distance = edit_distance(name, candidate);
    if (distance >= least || distance >= candidate.size()) continue;
    least = distance;
    best = &candidate;
  }
  return best ? fmt::format("; did you mean \"{}\"?", *best) : std::string();
}

namespace {

void check_domain(const Scene& scene, Findings& found) {
  const Domain& domain = scene.domain;
  found.box("domain", domain.box());
  if (domain.dimensions != 2 && domain.dimensions != 3)
    found.error("domain.dimensions", "is {}; expected 2 or 3", domain.dimensions);
  if (domain.dimensions == 2 && domain.periodic[2])
    found.error("domain.periodic[2]", "is true; in two dimensions nothing moves along z: make it false");
  if (!is_usable(domain)) return;

  double largest = 0.0;
  std::size_t group = 0;
  for (std::size_t i = 0; i < scene.particles.size(); ++i) {
    const double high = diameter_range(scene.particles[i]).second;
    if (high > largest) largest = high, group = i;
  }
  for (int axis = 0; axis < 3; ++axis) {
    if (!domain.periodic[static_cast<std::size_t>(axis)]) continue;
    const double width = domain.high[axis] - domain.low[axis];
    if (width >= largest) continue;
    found.error(
        fmt::format("domain.periodic[{}]", axis),
        "is true, but the domain is {:.6g} m wide along {} and the largest grain (particles[{}]) has a diameter of "
        "{:.6g} m: it would touch itself; make the domain at least that wide",
        width, axis_names[axis], group, largest);
  }
}

void check_time(const Scene& scene, Findings& found) {
  const TimeControl& time = scene.time;
  const bool has_end = found.positive("time.end", time.end, "s");
  if (time.step && found.positive("time.step", *time.step, "s") && has_end && *time.step > time.end)
    found.error("time.step", "is {} s, longer than the whole run (time.end = {} s)", *time.step, time.end);
  if (found.positive("time.steps_per_contact", time.steps_per_contact, "-") && !time.step) {
    if (time.steps_per_contact < 5.0)
      found.error("time.steps_per_contact", "is {}; a contact cannot be followed in fewer than 5 steps, 50 are usual",
                  time.steps_per_contact);
    else if (time.steps_per_contact < 15.0)
      found.warning("time.steps_per_contact",
                    "is {}; with fewer than 15 steps a contact gains or loses energy, 50 are usual",
                    time.steps_per_contact);
  }
  found.not_negative("time.max_speed", time.max_speed, "m/s");
  found.not_negative("time.damping", time.damping, "1/s");
  if (found.finite("time.gravity", time.gravity, "m/s2") && scene.domain.dimensions == 2 && time.gravity.z != 0.0)
    found.warning("time.gravity", "has a z component of {} m/s2, which does nothing in two dimensions", time.gravity.z);
}

/// Gravity towards a side that nothing closes is the commonest slip of a first scene.
void check_that_something_holds_the_grains(const Scene& scene, Findings& found) {
  if (!scene.walls.empty() || !scene.outlets.empty()) return;
  for (int axis = 0; axis < 3; ++axis) {
    if (scene.time.gravity[axis] == 0.0 || scene.domain.periodic[static_cast<std::size_t>(axis)]) continue;
    if (axis == 2 && scene.domain.dimensions == 2) continue;
    found.warning("wall",
                  "missing: gravity pulls along {}, and neither a wall nor an outlet stands in the way; "
                  "grains that leave the domain stop the run",
                  axis_names[axis]);
  }
}

void check_output(const Scene& scene, Findings& found) {
  const Output& output = scene.output;
  found.not_negative("output.snapshots", output.snapshot_interval, "s");
  found.not_negative("output.checkpoints", output.checkpoint_interval, "s");
  if (output.checkpoints_kept < 1)
    found.error("output.checkpoints_kept", "is {}; expected 1 or more", output.checkpoints_kept);
  std::vector<std::string> known;
  for (const FieldInfo& row : field_table) known.emplace_back(row.name);
  for (std::size_t i = 0; i < output.fields.size(); ++i) {
    const std::string key = fmt::format("output.fields[{}]", i);
    const std::optional<Field> field = field_by_name(output.fields[i]);
    if (!field)
      found.error(key, "\"{}\" is not a field{}; fields: {}", output.fields[i], nearest(output.fields[i], known),
                  listing(known, known.size()));
    else if ((info(*field).need == Need::rotation || *field == Field::torque) && !scene.contact.rotation)
      found.error(key, "\"{}\" does not exist in a scene with contact.rotation = false", output.fields[i]);
    else if (info(*field).need == Need::energy && !output.energy)
      found.error(key, "\"{}\" exists only with output.energy = true", output.fields[i]);
    else if (info(*field).need == Need::gas && !(scene.gas && scene.gas->drag))
      found.error(key, "\"{}\" exists only in a scene with [gas] and a drag law", output.fields[i]);
  }
}

/// "auto", or ranks x threads such as "4x2".
bool is_layout(const std::string& layout) {
  if (layout == "auto") return true;
  const std::size_t cross = layout.find('x');
  if (cross == std::string::npos) return false;
  const auto is_count = [](const std::string& digits) {
    return !digits.empty() && digits.size() < 7 && digits[0] != '0' &&
           std::all_of(digits.begin(), digits.end(), [](char c) { return c >= '0' && c <= '9'; });
  };
  return is_count(layout.substr(0, cross)) && is_count(layout.substr(cross + 1));
}

void check_run(const Scene& scene, Findings& found) {
  const RunControl& run = scene.run;
  if (!is_layout(run.layout))
    found.error("run.layout", "is \"{}\"; expected \"auto\" or ranks x threads such as \"2x4\"", run.layout);
  found.not_negative("run.skin", run.skin, "m");
  if (!(run.max_overlap > 0.0 && run.max_overlap <= 1.0))
    found.error("run.max_overlap", "is {}; expected more than 0 and at most 1 (a share of the smaller radius)",
                run.max_overlap);
  const std::vector<std::string> known(concern_names.begin(), concern_names.end());
  for (std::size_t i = 0; i < run.stop_on.size(); ++i) {
    const std::string &name = run.stop_on[i], key = fmt::format("run.stop_on[{}]", i);
    const bool is_of_energy = name == name_of(Concern::energy);
    if (std::find(known.begin(), known.end(), name) == known.end())
      found.error(key, "\"{}\" is no warning of a run{}; there are: {}", name, nearest(name, known),
                  listing(known, known.size()));
    else if (is_of_energy ? !scene.output.energy : !scene.gas)
      found.error(key, "\"{}\" is watched only in a scene with {}", name,
                  is_of_energy ? "output.energy = true" : "[gas]");
  }
}

}  // namespace
}  // namespace checks

std::vector<Problem> validate(const Scene& scene) { return validate(scene, World()); }

std::vector<Problem> validate(const Scene& scene, const World& world) {
  checks::Findings found(scene.domain, world);
  checks::check_domain(scene, found);
  checks::check_time(scene, found);
  checks::check_materials(scene, found);
  checks::check_contact(scene, found);
  checks::check_particles(scene, found);
  checks::check_walls(scene, found);
  checks::check_outlets(scene, found);
  checks::check_inlets(scene, found);
  checks::check_gas(scene, found);
  checks::check_that_something_holds_the_grains(scene, found);
  checks::check_output(scene, found);
  checks::check_probes(scene, found);
  checks::check_run(scene, found);
  return found.take();
}

}  // namespace moraine
