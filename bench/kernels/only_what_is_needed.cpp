// What a scene saves by what it leaves out: sweep and motion of a bed with everything that a scene can ask of them, then
// without one thing at a time, then without more and more; and what each shipped scene asks for, against everything.
#include <algorithm>
#include <filesystem>
#include <map>

#include "bench/kernels/bed.hpp"
#include "engine/run/plan.hpp"
#include "io/scene_toml/scene_toml.hpp"

namespace moraine::bench {

namespace {

/// What a scene asks of contacts and motion. The third dimension is a matter of what is set to zero, and costs the same.
struct Needs {
  std::string name;
  LawChoice choice;
  bool has_images = false, has_walls = false, has_gas = false, is_flat = false;
};

constexpr NormalLaw linear = NormalLaw::linear;
constexpr TangentialLaw spring = TangentialLaw::spring, viscous = TangentialLaw::viscous, none = TangentialLaw::none;

/// Everything, with the normal law of a scene.
Needs everything(NormalLaw normal) {
  return {"all_in", {normal, normal == linear ? spring : TangentialLaw::mindlin, true, false, true}, true, true, true};
}

Needs without(const char* name, void (*leave_out)(Needs&)) {
  Needs needs = everything(linear);
  needs.name = name;
  leave_out(needs);
  return needs;
}

std::vector<Needs> ladder() {
  std::vector<Needs> rungs = {everything(linear)};
  const std::pair<const char*, void (*)(Needs&)> parts[] = {
      {"ledger", [](Needs& n) { n.choice.has_ledger = false; }},
      {"gas", [](Needs& n) { n.has_gas = false; }},
      {"walls", [](Needs& n) { n.has_walls = false; }},
      {"images", [](Needs& n) { n.has_images = false; }},
      {"species", [](Needs& n) { n.choice.is_uniform = true; }},
      {"third_dimension", [](Needs& n) { n.is_flat = true; }},
      {"rotation", [](Needs& n) { n.choice.has_rotation = false; }},
      {"history", [](Needs& n) { n.choice.tangential = viscous; }},
      {"friction", [](Needs& n) { n.choice.tangential = none; }}};
  for (const auto& [name, leave_out] : parts)
    rungs.push_back(without((std::string("without/") + name).c_str(), leave_out));
  Needs less = everything(linear);
  int number = 0;
  for (const auto& [name, leave_out] : parts) {
    leave_out(less);
    less.name = "then/" + std::to_string(++number) + "_" + name;
    rungs.push_back(less);
  }
  return rungs;
}

/// What a scene file asks for.
Needs needs_of(const std::string& name) {
  const Scene scene = read_scene(std::filesystem::path(MORAINE_EXAMPLES) / name / "scene.toml");
  Needs needs;
  needs.name = "scene/" + name;
  needs.choice = {scene.contact.normal, scene.contact.tangential, scene.contact.rotation, are_grains_alike(scene),
                  scene.output.energy};
  needs.has_images = scene.domain.periodic[0] || scene.domain.periodic[1] || scene.domain.periodic[2];
  needs.has_walls = !scene.walls.empty();
  needs.has_gas = scene.gas && scene.gas->drag;
  needs.is_flat = scene.domain.dimensions == 2;
  return needs;
}

/// One pass: each tile swept, then its grains summed and advanced. One grain in twenty touches a wall, as in a bed twenty
/// grains deep.
class Pass {
 public:
  Pass(const Needs& needs, Size size)
      : bed_(bed(size, needs.choice.has_rotation)),
        floor_(bed_.particles, 20),
        sweep_(bed_.sweep(needs.choice, needs.has_images)),
        sums_(bed_.sums(needs.choice)),
        kernels_(contact_kernels(needs.choice)),
        motion_(motion_kernel(needs.choice.has_rotation, needs.choice.has_ledger)),
        slot_(slot_size(needs.choice.has_rotation, needs.choice.has_ledger)),
        has_walls_(needs.has_walls) {
    bed_.restart(needs.choice);
    sums_.kick.is_flat = needs.is_flat;
    if (needs.has_gas) {
      push_.assign(3 * static_cast<std::size_t>(bed_.particles.size()), 1e-3);
      sums_.push = push_.data();
    }
  }
  double n_grains() const { return bed_.n_grains(); }
  void operator()() {
    if (has_walls_) {
      const WallSweep walls{bed_.particles.records(), floor_.view, &bed_.table, Bed::dt, 0.5};
      benchmark::DoNotOptimize(kernels_.walls(walls, {0, floor_.n}));
    }
    benchmark::DoNotOptimize(bed_.run(kernels_.pairs, sweep_, slot_, [this](const Tile& tile) {
      if (has_walls_) show_touches(tile);
      benchmark::DoNotOptimize(motion_(sums_, nullptr, {tile.grain_begin, tile.grain_end}));
    }));
  }

 private:
  /// Those of the tile's grains.
  void show_touches(const Tile& tile) {
    const auto first = std::lower_bound(floor_.grain.begin(), floor_.grain.end(), tile.grain_begin);
    const auto last = std::lower_bound(first, floor_.grain.end(), tile.grain_end);
    const std::ptrdiff_t begin = first - floor_.grain.begin();
    sums_.wall_grain = floor_.grain.data() + begin;
    sums_.wall_slots = floor_.slots.data() + begin * slot_;
    sums_.n_wall = last - first;
  }

  Bed& bed_;
  Floor floor_;
  std::vector<double> push_;
  PairSweep sweep_;
  GrainSums sums_;
  ContactKernels kernels_;
  MotionKernel motion_;
  int slot_;
  bool has_walls_;
};

/// Keeps the time of the fastest pass: the one that least else got in the way of.
class Fastest {
 public:
  void operator()(Pass& pass) {
    const double start = clock_seconds(1);
    pass();
    seconds_ = std::min(seconds_, clock_seconds(1) - start);
  }
  double seconds() const { return seconds_; }

 private:
  double seconds_ = 1e300;
};

double all_in_seconds(NormalLaw normal, Size size) {
  static std::map<std::pair<NormalLaw, Size>, double> known;
  if (const auto found = known.find({normal, size}); found != known.end()) return found->second;
  Pass pass(everything(normal), size);
  Fastest fastest;
  for (int n = 0; n < (size == Size::k200 ? 20 : 200); ++n) fastest(pass);
  return known[{normal, size}] = fastest.seconds();
}

void measure_needs(benchmark::State& state, const Needs& needs, Size size) {
  const double all = all_in_seconds(needs.choice.normal, size);
  Pass pass(needs, size);
  pass();
  Work work;
  work.items_name = "grains/s";
  work.items = pass.n_grains();
  Fastest fastest;
  measure(state, work, [&] { fastest(pass); });
  state.counters["saved_%"] = 100.0 * (1.0 - fastest.seconds() / all);
  state.counters["ratio"] = all / fastest.seconds();
}

}  // namespace

void add_only_what_is_needed() {
  for (const Size size : {Size::k20, Size::k200})
    for (const Needs& needs : ladder())
      add("needed/" + needs.name + "/" + name_of(size),
          [=](benchmark::State& state) { measure_needs(state, needs, size); });
  for (const auto& entry : std::filesystem::directory_iterator(MORAINE_EXAMPLES))
    if (std::filesystem::exists(entry.path() / "scene.toml")) {
      const std::string name = entry.path().filename().string();
      add("needed/scene/" + name + "/20k",
          [name](benchmark::State& state) { measure_needs(state, needs_of(name), Size::k20); });
    }
}

}  // namespace moraine::bench
