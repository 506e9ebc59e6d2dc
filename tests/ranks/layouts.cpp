// The same bits on any number of ranks: every scene gives on R ranks of T threads what it gives alone.
#include <catch2/catch.hpp>
#include <cstdio>
#include <cstring>
#include <utility>

#include "engine/particles/fill.hpp"
#include "engine/run/projection.hpp"
#include "tests/invariance/trace.hpp"
#include "tests/ranks/ranks.hpp"
#include "tests/support/flow_scenes.hpp"

using namespace moraine;

namespace {

/// Ranks and threads; layouts with more ranks than the job has are left out.
struct Layout {
  int ranks, threads;
};
constexpr Layout layouts[] = {{1, 4}, {2, 1}, {2, 2}, {3, 1}, {4, 1}, {5, 1}, {8, 1}, {2, 3}};
constexpr int every = 250;

constexpr Balance modes[] = {Balance::automatic, Balance::threads, Balance::cuts, Balance::off};

/// Threads of a rank that change at each rebuild, as no balancer would have it.
int odd_threads(int rank, std::uint64_t rebuild) { return 1 + static_cast<int>((3 * rebuild + rank) % 4); }

std::string name_of(const char* scene, const Layout& layout) {
  return std::string(scene) + " on " + std::to_string(layout.ranks) + "x" + std::to_string(layout.threads);
}

void put(std::string& bytes, const void* from, std::size_t n) { bytes.append(static_cast<const char*>(from), n); }
void put(std::string& bytes, std::uint64_t value) { put(bytes, &value, sizeof value); }
void put(std::string& bytes, const trace::Bits& bits) {
  put(bytes, bits.values.size());
  put(bytes, bits.values.data(), bits.values.size() * sizeof(double));
}

/// Takes apart what put() has put together.
class Parcel {
 public:
  explicit Parcel(const std::string& bytes) : bytes_(bytes) {}
  std::uint64_t number() {
    std::uint64_t value = 0;
    std::memcpy(&value, take(sizeof value), sizeof value);
    return value;
  }
  std::string text(std::size_t n) { return {take(n), n}; }
  trace::Bits bits() {
    trace::Bits bits;
    bits.values.resize(number());
    if (const std::size_t n = bits.values.size() * sizeof(double); n > 0) std::memcpy(bits.values.data(), take(n), n);
    return bits;
  }

 private:
  const char* take(std::size_t n) { return bytes_.data() + std::exchange(at_, at_ + n); }
  const std::string& bytes_;
  std::size_t at_ = 0;
};

/// What the first rank's run alone shows, on all ranks: it takes its time, and all would find the same.
std::vector<trace::Moment> run_alone(const Scene& scene, int n_steps) {
  const World& all = ranks::world();
  std::string bytes;
  if (all.is_root()) {
    const std::vector<trace::Moment> moments = trace::record(scene, 1, n_steps, every);
    put(bytes, moments.size());
    for (const trace::Moment& moment : moments) {
      for (const std::uint64_t value : {moment.step, moment.n_born, moment.n_left, moment.n_inside}) put(bytes, value);
      put(bytes, moment.hash.size());
      put(bytes, moment.hash.data(), moment.hash.size());
      put(bytes, moment.probes.size());
      for (const trace::Bits& probe : moment.probes) put(bytes, probe);
      put(bytes, moment.ledger);
    }
  }
  all.broadcast(bytes);
  Parcel parcel(bytes);
  std::vector<trace::Moment> moments(parcel.number());
  for (trace::Moment& moment : moments) {
    for (std::uint64_t* const value : {&moment.step, &moment.n_born, &moment.n_left, &moment.n_inside})
      *value = parcel.number();
    moment.hash = parcel.text(parcel.number());
    moment.probes.resize(parcel.number());
    for (trace::Bits& probe : moment.probes) probe = parcel.bits();
    moment.ledger = parcel.bits();
  }
  return moments;
}

/// Runs every scene on every layout: for a quarter of the time for which it is worth watching (lengthened = 1), or so many times as long
/// as that (without gas at least 20,000 steps).
void compare_layouts(int lengthened) {
  const World& all = ranks::world();
  std::uint64_t n_migrated = 0, n_moved_cuts = 0;
  std::size_t n_runs = 0;
  for (auto& [name, scene, n_watched] : scenes::all()) {
    scene.output.energy = true;
    // Gas steps on more ranks than cores take their time.
    const int n_steps = lengthened == 1 ? std::max(2 * every, n_watched / 4)
                        : scene.gas     ? lengthened * n_watched
                                        : std::max(20000, lengthened * n_watched);
    const std::vector<trace::Moment> alone = run_alone(scene, n_steps);
    for (const Layout& layout : layouts) {
      if (layout.ranks > all.size()) continue;
      const std::optional<World> world = all.first(layout.ranks);
      ++n_runs;
      if (!world) continue;
      // Each scene and each layout come by all ways of balance, every fifth run by numbers of threads that jump about.
      scene.run.balance = modes[n_runs % std::size(modes)];
      INFO(name_of(name, layout) << ", balance " << n_runs % std::size(modes));
      Simulation simulation(scene, layout.threads, *world);
      if (n_runs % 3 == 0) simulation.bound_skin(0.0);  // as where memory is short
      if (n_runs % 5 == 0)
        simulation.force_threads([rank = world->rank()](std::uint64_t rebuild) { return odd_threads(rank, rebuild); });
      try {
        CHECK(trace::difference(alone, trace::record(simulation, n_steps, every)) == "");
      } catch (const RunError& error) {  // the others wait for this rank: say it now
        std::fprintf(stderr, "%s, rank %d: %s\n", name_of(name, layout).c_str(), world->rank(), error.what());
        all.abort(1);
      }
      n_migrated += simulation.n_migrated();
      n_moved_cuts += simulation.n_cuts() - (layout.ranks > 1 ? 1 : 0);
    }
  }
  all.sum(std::span(&n_migrated, 1));
  all.sum(std::span(&n_moved_cuts, 1));
  const std::uint64_t least = lengthened == 1 ? 1 : 4;  // a quarter of the steps
  CHECK((all.size() == 1 || n_migrated > 250 * least));
  CHECK((all.size() == 1 || n_moved_cuts > 2 * least));
}

}  // namespace

TEST_CASE("a scene gives the same hashes, probes and energies on any ranks and threads") { compare_layouts(1); }

TEST_CASE("so does it over 20,000 steps, with gas over five times as many as above", "[.long]") { compare_layouts(5); }

TEST_CASE("a run restored on other ranks and threads is the unbroken run, bit by bit") {
  const World& all = ranks::world();
  for (auto& [name, scene, n_steps] : scenes::all()) {
    scene.output.energy = true;
    const std::vector<trace::Moment> alone = run_alone(scene, n_steps / every * every);
    // From layout to layout, each for a part of the run.
    std::optional<Image> image;
    std::vector<trace::Moment> broken;
    constexpr Layout stations[] = {{2, 1}, {8, 1}, {1, 3}, {3, 2}, {5, 1}};
    int n_done = 0;
    const int n_moments = n_steps / every, n_stations = static_cast<int>(std::size(stations));
    for (int s = 0; s < n_stations; ++s) {
      const Layout layout{std::min(stations[s].ranks, all.size()), stations[s].threads};
      INFO(name_of(name, layout));
      const std::optional<World> world = all.first(layout.ranks);
      const int n_end = n_moments * (s + 1) / n_stations;
      std::vector<trace::Moment> part;
      std::optional<Image> rows;
      if (world) {
        std::optional<Simulation> simulation;
        if (image)
          simulation.emplace(scene, layout.threads, ranks::spread(*image, *world), *world);
        else
          simulation.emplace(scene, layout.threads, *world);
        if (s == 0)
          part.push_back(trace::look(*simulation));  // later it has been looked at already: averages count once
        for (int moment = n_done; moment < n_end; ++moment) {
          for (int i = 0; i < every; ++i) simulation->step();
          part.push_back(trace::look(*simulation));
        }
        rows = simulation->checkpoint();
      }
      image = ranks::whole(rows, all);
      n_done = n_end;
      broken.insert(broken.end(), part.begin(), part.end());
    }
    if (all.is_root()) CHECK(trace::difference(alone, broken) == "");
  }
}

TEST_CASE("space is divided anew where the grains leave it, and no bit changes") {
  // A bed that slides to one end of a long box: the shares of the start do not stay equal.
  Scene scene = scenes::settled_bed();
  scene.output.energy = true;
  scene.domain.periodic = {false, false, false};
  scene.domain.high.x *= 3.0;
  scenes::add_wall(scene, "box", BoxShape{scene.domain.box()}, "steel");
  scene.time.gravity = {9.81, 0.0, -2.0};
  const int n_steps = 6000;
  const std::vector<trace::Moment> alone = run_alone(scene, n_steps);
  const World& all = ranks::world();
  Simulation simulation(scene, 1, all);
  CHECK(trace::difference(alone, trace::record(simulation, n_steps, every)) == "");
  CHECK((all.size() == 1 || simulation.n_cuts() > 1));
}

namespace {

double* row(const FieldView& view, std::int64_t i) {
  return reinterpret_cast<double*>(static_cast<std::byte*>(view.values) + i * view.stride);
}

/// Drives the grains around the middle of the domain, the faster the further out they are.
void stir(Simulation& simulation) {
  const Box box = simulation.scene().domain.box();
  const Vec3 middle = 0.5 * (box.low + box.high);
  simulation.set_body_force([&simulation, middle](std::span<double> acceleration) {
    const FieldView position = *simulation.view(Field::position);
    for (std::int64_t i = 0; i < position.n; ++i) {
      const double* const p = row(position, i);
      acceleration[static_cast<std::size_t>(3 * i)] = -300.0 * (p[1] - middle.y);
      acceleration[static_cast<std::size_t>(3 * i + 1)] = 300.0 * (p[0] - middle.x);
    }
  });
}

/// Slows every other grain down, from outside.
void slow_some_down(Simulation& simulation) {
  const FieldView velocity = *simulation.view(Field::velocity), gid = *simulation.view(Field::gid);
  for (std::int64_t i = 0; i < velocity.n; ++i)
    if (static_cast<const std::uint64_t*>(gid.values)[i] % 2 == 0)
      for (int axis = 0; axis < 3; ++axis) row(velocity, i)[axis] *= 0.5;
  simulation.grains_changed();
}

std::vector<trace::Moment> stirred(Simulation& simulation, int n_steps) {
  stir(simulation);
  return trace::record(simulation, n_steps, every);
}

}  // namespace

TEST_CASE("forces and velocities from outside give the same bits on any ranks and threads, and after a restart") {
  const World& all = ranks::world();
  for (Scene scene : {scenes::settled_bed(), scenes::conveyed()}) {
    scene.output.energy = true;
    Simulation alone(scene, 1);
    const std::vector<trace::Moment> before = stirred(alone, 2 * every);
    slow_some_down(alone);
    const std::vector<trace::Moment> after = stirred(alone, 2 * every);
    for (const Layout& layout : layouts) {
      const std::optional<World> world = all.first(std::min(layout.ranks, all.size()));
      if (!world) continue;
      INFO(name_of("stirred", layout));
      Simulation first(scene, layout.threads, *world);
      CHECK(trace::difference(before, stirred(first, 2 * every)) == "");
      Simulation second(scene, layout.threads, first.checkpoint(), *world);
      slow_some_down(second);
      CHECK(trace::difference(after, stirred(second, 2 * every)) == "");
    }
  }
}

TEST_CASE("walls that a program moves give the same bits on any ranks and threads, and after a restart") {
  const World& all = ranks::world();
  Scene scene = scenes::driven();
  scene.output.energy = true;
  constexpr int n_steps = 300, between = 150;
  Simulation alone(scene, 1);
  trace::drive(alone);
  const std::vector<trace::Moment> before = trace::record(alone, n_steps, between);
  const std::vector<trace::Moment> after = trace::record(alone, n_steps, between);
  for (const Layout& layout : layouts) {
    const std::optional<World> world = all.first(std::min(layout.ranks, all.size()));
    if (!world) continue;
    INFO(name_of("driven", layout));
    Simulation first(scene, layout.threads, *world);
    trace::drive(first);
    CHECK(trace::difference(before, trace::record(first, n_steps, between)) == "");
    Simulation second(scene, layout.threads, first.checkpoint(), *world);
    trace::drive(second);
    CHECK(trace::difference(after, trace::record(second, n_steps, between)) == "");
  }
}

TEST_CASE("ranks that are told different motions of a wall say so, and do not part") {
  const World& all = ranks::world();
  if (all.is_alone()) return;
  Simulation simulation(scenes::driven(), 1, all);
  trace::drive(simulation);
  simulation.set_wall_motion("lid", [rank = all.rank()](double) { return WallRates{{0.0, 0.0, 1e-3 * rank}, {}}; });
  std::string said;
  try {
    for (int i = 0; i < 400; ++i) simulation.step();
  } catch (const RunError& error) {
    said = error.what();
  }
  CHECK(said ==
        "wall \"lid\" is moved differently by the scripts of the ranks: its function must depend on the time alone");
}

TEST_CASE("a heavy ball that throws up light grains does so on all ranks alike") {
  Scene scene = scenes::basic();
  scene.domain.low = {-0.1, -0.1, -0.01};
  scene.domain.high = {0.1, 0.1, 0.4};
  scene.time.gravity = {0.0, 0.0, -9.81};
  scene.time.step = 2e-6;
  for (PairLaw& law : scene.contact.pairs) law.normal_stiffness = 2e6, law.restitution = 0.95;
  scene.particles = {scenes::lattice({{-0.1, -0.1, 0.0}, {0.1, 0.1, 0.04}}, 1.1 * scenes::d)};
  ListedGrains ball;
  ball.has_velocity = ball.has_radius = true;
  GrainSeed seed;
  seed.position = {0.003, -0.002, 0.075};
  seed.radius = 0.03;
  seed.velocity = {0.5, 0.0, -4.0};
  ball.grains = {seed};
  ParticleGroup group;
  group.material = "steel";
  group.diameter.value = 0.06;
  group.fill = ball;
  scene.particles.push_back(group);
  scenes::add_wall(scene, "box", BoxShape{{{-0.1, -0.1, 0.0}, {0.1, 0.1, 0.4}}}, "steel");
  const int n_steps = 4000;
  const std::vector<trace::Moment> alone = run_alone(scene, n_steps);
  Simulation simulation(scene, 1, ranks::world());
  CHECK(trace::difference(alone, trace::record(simulation, n_steps, every)) == "");
}

TEST_CASE(
    "grains that become faster than anybody foresaw make all ranks look early, however many ranks lie between, and no "
    "bit "
    "changes") {
  const Scene scene = scenes::cannons();
  const std::vector<trace::Moment> alone = run_alone(scene, 2 * every);
  for (const int n_ranks : {2, 4, 8}) {
    const std::optional<World> world = ranks::world().first(std::min(n_ranks, ranks::world().size()));
    if (!world || world->is_alone()) continue;
    INFO(n_ranks << " ranks");
    Simulation simulation(scene, 1, *world);
    CHECK(trace::difference(alone, trace::record(simulation, 2 * every, every)) == "");
    CHECK(simulation.n_early_looks() > 0);
    CHECK(simulation.n_early_looks() < simulation.n_looks() / 2);
  }
}

TEST_CASE("a flight record of what a run survives tells of grains and cells on any ranks, and changes no bit") {
  const Scene scene = scenes::fluidised_bed();
  const std::vector<trace::Moment> alone = run_alone(scene, every);
  Simulation simulation(scene, 1, ranks::world());
  for (int n = 0; n < 20; ++n) simulation.step();
  for (const Concern concern : {Concern::energy, Concern::gas_balance}) simulation.begin_record(concern);
  for (int n = 0; n < 32; ++n) simulation.step();
  const std::vector<FlightRecord> records = simulation.take_records();
  REQUIRE(records.size() == 2);
  CHECK(records[1].gas_steps.size() > 200);
  std::string grains, cells;
  for (const std::string& text : ranks::world().gather_at_root(records[1].grains)) grains += text;
  for (const std::string& text : ranks::world().gather_at_root(records[1].gas_cells)) cells += text;
  if (ranks::world().is_root()) {
    CHECK(std::count(grains.begin(), grains.end(), '\n') > 33);
    CHECK(cells.find(",densest,") != std::string::npos);
  }
  while (static_cast<int>(simulation.step_number()) < every) simulation.step();
  CHECK(simulation.state_hash().text() == alone.back().hash);
}

TEST_CASE("what a projection counts for a number of ranks is what a run on them has", "[.][projection]") {
  const World& all = ranks::world();
  for (auto& [name, scene, n_steps] : scenes::all()) {
    const std::vector<GrainSeed> grains = make_grains(scene, 1);
    for (const int n_ranks : {2, 3, 4, 5, 6, 7, 8, 11, 13, 16}) {
      REQUIRE(n_ranks <= all.size());
      const std::optional<World> world = all.first(n_ranks);
      if (!world) continue;
      INFO(name << " on " << n_ranks << " ranks");
      const Simulation simulation(scene, 1, *world);
      const RankCounts expected = count_ranks(scene, grains, n_ranks)[static_cast<std::size_t>(world->rank())];
      const HaloCounts found = simulation.halo_counts();
      CHECK(static_cast<std::int64_t>(simulation.n_own_grains()) == expected.n_grains);
      CHECK(static_cast<std::int64_t>(found.n_ghosts) == expected.n_ghosts);
      CHECK(static_cast<std::int64_t>(found.n_sent) == expected.n_sent);
      CHECK(static_cast<int>(found.n_neighbours) == expected.n_neighbours);
      CHECK(static_cast<int>(found.n_messages) == expected.n_messages);
      CHECK(static_cast<std::int64_t>(found.n_bytes) == expected.bytes);
      CHECK(simulation.n_own_pairs() == expected.n_pairs);
    }
  }
}
