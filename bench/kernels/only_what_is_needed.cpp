// What a scene saves by what it leaves out: sweep and motion of a bed with everything that the linear spring can carry, then
// without one thing at a time, then without more and more.
#include <algorithm>
#include <map>

#include "bench/kernels/bed.hpp"

namespace moraine::bench {

namespace {

struct Needs {
  const char* name;
  LawChoice choice;
  bool has_images;
};

constexpr NormalLaw linear = NormalLaw::linear;
constexpr TangentialLaw spring = TangentialLaw::spring, viscous = TangentialLaw::viscous, none = TangentialLaw::none;
// normal, tangential, rotation, uniform, ledger; periodic images
constexpr Needs all_in{"all_in", {linear, spring, true, false, true}, true};
constexpr Needs ladder[] = {
    all_in,
    {"without/ledger", {linear, spring, true, false, false}, true},
    {"without/images", {linear, spring, true, false, true}, false},
    {"without/mixture", {linear, spring, true, true, true}, true},
    {"without/rotation", {linear, spring, false, false, true}, true},
    {"without/history", {linear, viscous, true, false, true}, true},
    {"without/friction", {linear, none, true, false, true}, true},
    {"without/double", {linear, spring, true, false, true, RollingLaw::none, CohesionLaw::none, true}, true},
    {"then/1_ledger", {linear, spring, true, false, false}, true},
    {"then/2_images", {linear, spring, true, false, false}, false},
    {"then/3_mixture", {linear, spring, true, true, false}, false},
    {"then/4_rotation", {linear, spring, false, true, false}, false},
    {"then/5_history", {linear, viscous, false, true, false}, false},
    {"then/6_friction", {linear, none, false, true, false}, false},
    {"then/7_double", {linear, none, false, true, false, RollingLaw::none, CohesionLaw::none, true}, false},
};

/// One pass: each tile swept, then its grains summed and advanced.
class Pass {
 public:
  Pass(const Needs& needs, Size size)
      : bed_(bed(size, needs.choice.has_rotation)),
        sweep_(bed_.sweep(needs.choice, needs.has_images)),
        sums_(bed_.sums(needs.choice)),
        pairs_(contact_kernels(needs.choice).pairs),
        motion_(motion_kernel(needs.choice.has_rotation, needs.choice.has_ledger, false, needs.choice.is_mixed)),
        slot_(slot_bytes(needs.choice)) {
    bed_.restart(needs.choice);
    sums_.acting = bed_.thread().acting.data();
  }
  double n_grains() const { return bed_.n_grains(); }
  void operator()() {
    benchmark::DoNotOptimize(bed_.run(pairs_, sweep_, slot_, [this](const Tile& tile) {
      benchmark::DoNotOptimize(motion_(sums_, nullptr, {tile.grain_begin, tile.grain_end}));
    }));
  }

 private:
  Bed& bed_;
  PairSweep sweep_;
  GrainSums sums_;
  PairKernel pairs_;
  MotionKernel motion_;
  std::int64_t slot_;
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

double all_in_seconds(Size size) {
  static std::map<Size, double> known;
  if (const auto found = known.find(size); found != known.end()) return found->second;
  Pass pass(all_in, size);
  Fastest fastest;
  for (int n = 0; n < (size == Size::k200 ? 20 : 200); ++n) fastest(pass);
  return known[size] = fastest.seconds();
}

}  // namespace

void add_only_what_is_needed() {
  for (const Size size : {Size::k20, Size::k200})
    for (const Needs& needs : ladder)
      add("needed/" + std::string(needs.name) + "/" + name_of(size), [=](benchmark::State& state) {
        const double everything = all_in_seconds(size);
        Pass pass(needs, size);
        pass();
        Work work;
        work.items_name = "grains/s";
        work.items = pass.n_grains();
        Fastest fastest;
        measure(state, work, [&] { fastest(pass); });
        state.counters["saved_%"] = 100.0 * (1.0 - fastest.seconds() / everything);
      });
}

}  // namespace moraine::bench
