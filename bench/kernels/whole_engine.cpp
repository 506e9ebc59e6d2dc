// What the kernels add up to: the contacts-and-motion part of a step with walls and periodic faces, a rebuild, the state hash, and
// exact sums.
#include <algorithm>
#include <cstring>
#include <memory>
#include <thread>
#include <vector>

#include "bench/kernels/bed.hpp"
#include "engine/contacts/contacts.hpp"
#include "engine/particles/fill.hpp"
#include "engine/run/state_hash.hpp"
#include "engine/walls/walls.hpp"
#include "kernels/base/exact_sum.hpp"
#include "kernels/base/random.hpp"

namespace moraine::bench {

namespace {

Scene in_precision(Precision precision, Scene scene) {
  scene.run.precision = precision;
  return scene;
}

/// A bed of bench/peers as the engine holds it.
struct Engine {
  Scene scene;
  Walls walls;
  Particles particles{FieldNeeds{}};
  std::unique_ptr<Contacts> contacts;
  Kick kick;
  double dt;

  double travelled = 0.0;  // a bed at rest: its grains come nowhere

  Engine(const std::string& deck, Size size, int n_threads, Precision precision = Precision::double_)
      : scene(in_precision(precision, bed_scene(deck, size))), walls(scene), dt(*scene.time.step) {
    put_grains(scene, make_grains(scene, 1), particles);
    const double r = particles.radius(0);
    contacts = std::make_unique<Contacts>(
        scene, walls,
        GrainKind{true, particles.inverse_mass(0), 1.0 / particles.inverse_mass(0), 1.0, r, r, SizeClasses(r)},
        World());
    kick.gain = kick.time = kick.drift = dt;
    kick.gravity = scene.time.gravity;
    contacts->rebuild(particles, width(), 0.0, n_threads);
    StepResult result;
    for (int step = 0; step < 5; ++step) contacts->advance(particles, kick, dt, travelled, n_threads, result);
  }
  ListWidth width() const { return {Bed::skin, Bed::skin, dt, 2.0 * particles.radius(0), true}; }
  Work work(int n_threads) const {
    Work work;
    work.items_name = "grains/s";
    work.items = particles.size();
    work.n_threads = n_threads;
    return work;
  }
};

void step(benchmark::State& state, const std::string& deck, Size size, int n_threads, Precision precision) {
  Engine engine(deck, size, n_threads, precision);
  StepResult result;
  measure(state, engine.work(n_threads), [&] {
    engine.contacts->advance(engine.particles, engine.kick, engine.dt, engine.travelled, n_threads, result);
  });
  state.counters["contacts"] = static_cast<double>(result.n_touching);
}

void rebuild(benchmark::State& state, Size size, int n_threads) {
  Engine engine("bed.toml", size, n_threads);
  measure(state, engine.work(n_threads),
          [&] { engine.contacts->rebuild(engine.particles, engine.width(), 0.0, n_threads); });
}

void hash(benchmark::State& state, Size size) {
  Engine engine("bed.toml", size, 1);
  measure(state, engine.work(1),
          [&] { benchmark::DoNotOptimize(state_hash(World(), engine.particles, *engine.contacts, 1, {}, nullptr)); });
}

void exact_sum(benchmark::State& state, std::size_t n) {
  std::vector<double> values;
  for (std::size_t k = 0; k < n; ++k) values.push_back(random_normal(3, k, RandomPurpose::velocity));
  Work work;
  work.items_name = "terms/s";
  work.items = static_cast<double>(n);
  work.bytes = work.working_set = 8.0 * work.items;
  measure(state, work, [&] {
    ExactSum sum;
    for (const double value : values) sum.add(value);
    benchmark::DoNotOptimize(sum.value());
  });
}

}  // namespace

void add_whole_engine() {
  const int all = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  const std::vector<int> threads = all > 1 ? std::vector<int>{1, all} : std::vector<int>{1};
  for (const char* deck : {"bed.toml", "bed_hertz.toml"})
    for (const Size size : {Size::k20, Size::k200})
      for (const int n : threads)
        for (const Precision precision : {Precision::double_, Precision::mixed})
          add("step/" + std::string(deck, std::strchr(deck, '.')) + (precision == Precision::mixed ? "/float/" : "/") +
                  name_of(size) + "/threads:" + std::to_string(n),
              [=, deck = std::string(deck)](benchmark::State& s) { step(s, deck, size, n, precision); });
  for (const Size size : {Size::k20, Size::k200})
    for (const int n : threads)
      add("rebuild/" + name_of(size) + "/threads:" + std::to_string(n),
          [=](benchmark::State& s) { rebuild(s, size, n); });
  for (const Size size : {Size::k20, Size::k200})
    add("state_hash/" + name_of(size), [=](benchmark::State& s) { hash(s, size); });
  for (const std::size_t n : {std::size_t{1} << 12, std::size_t{1} << 20, std::size_t{1} << 23})
    add("exact_sum/" + std::to_string(n), [=](benchmark::State& s) { exact_sum(s, n); });
}

}  // namespace moraine::bench
