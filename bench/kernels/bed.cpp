#include "bench/kernels/bed.hpp"

#include <algorithm>
#include <map>
#include <numbers>

#include "engine/contacts/law_table.hpp"
#include "engine/particles/fill.hpp"
#include "io/scene_toml/scene_toml.hpp"
#include "kernels/base/random.hpp"

namespace moraine::bench {

namespace {

double uniform(std::uint64_t counter, std::uint64_t draw) {
  return 2.0 * random_uniform(1, counter, RandomPurpose::choice, draw) - 1.0;
}
Vec3 random_vector(std::uint64_t counter, std::uint64_t first) {
  return {uniform(counter, first), uniform(counter, first + 1), uniform(counter, first + 2)};
}

void cut(ListedGrains& list) {  // a column of about a thousand
  std::erase_if(list.grains, [](const GrainSeed& g) { return g.position.x > 0.018 || g.position.y > 0.036; });
}

void repeat(ListedGrains& list, int n, double length) {
  const std::vector<GrainSeed> first = list.grains;
  for (int copy = 1; copy < n; ++copy)
    for (GrainSeed grain : first) {
      grain.position.x += copy * length;
      list.grains.push_back(grain);
    }
}

/// The same parameters for each pair of materials, those of all laws.
LawTable law_table() {
  Scene scene = bed_scene("bed_hertz.toml", Size::k1);
  PairLaw& law = scene.contact.pairs[0];
  law.normal_stiffness = 2400.0;
  law.tangential_stiffness = 685.7;
  law.tangential_viscosity = 0.02;
  const PairParameters p = pair_parameters(scene, "glass", "glass");
  LawTable table;
  for (std::size_t row = 0; row < 3; ++row) table.set(row, p);
  return table;
}
constexpr std::array<std::uint8_t, 4> species_table = {0, 1, 1, 2};

double doubles(double n) { return 8.0 * n; }

}  // namespace

std::string name_of(Size size) { return size == Size::k1 ? "1k" : size == Size::k20 ? "20k" : "200k"; }

std::string name_of(NormalLaw normal, TangentialLaw tangential) {
  static constexpr const char* names[] = {"none", "viscous", "spring", "mindlin", "power"};
  return (normal == NormalLaw::linear ? "linear_" : "hertz_") +
         std::string(names[static_cast<std::size_t>(tangential)]);
}

Scene bed_scene(const std::string& deck, Size size) {
  Scene scene = read_scene(std::string(MORAINE_BENCH_BEDS) + "/" + deck);
  auto& list = std::get<ListedGrains>(scene.particles[0].fill);
  if (size == Size::k1) cut(list);
  if (size == Size::k200) {
    repeat(list, 10, scene.domain.high.x);
    scene.domain.high.x *= 10.0;
  }
  return scene;
}

Bed::Bed(Size size, bool has_rotation) : particles({has_rotation, true, false, false}), table(law_table()) {
  const Scene scene = bed_scene("bed.toml", size);
  domain = scene.domain.box();
  put_grains(scene, make_grains(scene, 1), particles);
  for (std::int32_t i = 0; i < particles.size(); ++i) {
    particles.set_material(i, static_cast<std::uint16_t>(i % 2));
    const Vec3 v = random_vector(particles.gid(i), 0), w = random_vector(particles.gid(i), 3);
    for (int c = 0; c < 3; ++c) {
      particles.set_real(Field::velocity, i, c, 1e-3 * v[c]);
      if (has_rotation) particles.set_real(Field::angular_velocity, i, c, 0.5 * w[c]);
    }
  }
  cells.sort(Centres::of(particles), domain, {false, false, false}, 2.0 * particles.radius(0) + skin, 1);
  particles.reorder(cells.order(), 1);
  needs.has_species = true;
  needs.slot_size = slot_size(true, true);
  needs.species_table = species_table.data();
  needs.n_materials = 2;
  PairCarry nothing;
  pairs.build(particles, cells, {}, {}, {}, skin, {}, needs, cells.order(), nothing, 1);
  n_slots = thread().tiles.back().pair_end;
  images.assign(static_cast<std::size_t>(n_slots), 0);
  image_shift.assign(image::n_codes, Vec3{});
}

void Bed::restart(const LawChoice& choice) {
  if (!has_history(choice.tangential)) return;
  const PairParameters p = table.at(0);
  // Friction holds a displacement of mu F_n / k_t; the power law, which grows softer, half as much again.
  double limit =
      p[Parameter::friction] * (choice.normal == NormalLaw::linear || choice.tangential == TangentialLaw::spring
                                    ? p[Parameter::normal_stiffness] / p[Parameter::tangential_stiffness]
                                    : p[Parameter::young] / (6.0 * p[Parameter::shear]));
  if (choice.tangential == TangentialLaw::power) limit *= 1.5;
  ThreadPairs& mine = thread();
  mine.columns = memory_of(choice);
  mine.is_mixed = choice.is_mixed;
  for (std::int64_t k = 0; k < n_slots; ++k) {
    const auto q = static_cast<std::size_t>(k);
    mine.set_memory(k, {});
    if (mine.a[q] == particles.dummy()) continue;
    const double overlap =
        2.0 * particles.radius(0) - length(particles.position(mine.a[q]) - particles.position(mine.b[q]));
    if (!(overlap > 0.0)) continue;
    const auto counter = static_cast<std::uint64_t>(k);
    const Vec3 size = limit * overlap * 0.6 * (1.0 + uniform(counter, 9)) * normalized(random_vector(counter, 6));
    mine.set_memory(k, {{size.x, size.y, size.z}, 0.0, {}});
  }
}

PairSweep Bed::sweep(const LawChoice& choice, bool has_images) {
  ThreadPairs& mine = thread();
  PairSweep s;
  s.records = particles.records();
  s.a = mine.a.data();
  s.b = mine.b.data();
  s.image = has_images ? images.data() : nullptr;
  s.image_shift = image_shift.data();
  s.species = choice.is_uniform ? nullptr : mine.species.data();
  s.history = mine.history.data();
  s.was_near = mine.was_near.data();
  s.marks = mine.marks.data();
  s.acting = mine.acting.data();
  s.table = &table;
  s.inverse_mass = particles.inverse_mass(0);
  s.radius = particles.radius(0);
  s.dt = dt;
  s.max_overlap = 0.5;
  return s;
}

GrainSums Bed::sums(const LawChoice& choice) {
  ThreadPairs& mine = thread();
  GrainSums s;
  s.records = particles.records();
  s.first_grain = mine.grain_begin;
  s.offsets = mine.offsets.data();
  s.entries = mine.entries.data();
  s.slots = pairs.slots();
  s.first_word = mine.first_word.empty() ? nullptr : mine.first_word.data();
  s.inside = domain;
  s.kick.gain = s.kick.time = s.kick.drift = dt;
  s.kick.gravity = {0.0, 0.0, -9.81};
  s.dissipated = choice.has_ledger ? particles.dissipated() : nullptr;
  return s;
}

Bed& bed(Size size, bool has_rotation) {
  static std::map<std::pair<Size, bool>, std::unique_ptr<Bed>> beds;
  std::unique_ptr<Bed>& found = beds[{size, has_rotation}];
  if (!found) found = std::make_unique<Bed>(size, has_rotation);
  return *found;
}

double flops_of_contact(const LawChoice& choice) {
  const bool is_hertz = choice.normal == NormalLaw::hertz;
  const bool has_spring = has_history(choice.tangential), is_power = choice.tangential == TangentialLaw::power;
  double n = 25.0 + (is_hertz ? 14.0 : 3.0) + 6.0;  // the contact's motion, the normal law, the force
  if (choice.has_rotation) n += 9.0 + (choice.tangential == TangentialLaw::none ? 0.0 : 21.0);
  if (!choice.is_uniform) n += is_hertz ? 10.0 + (has_spring ? 5.0 : 0.0) : 10.0 + (has_spring ? 1.0 : 0.0);
  if (choice.tangential == TangentialLaw::viscous) n += 3.0 + 8.0;
  if (has_spring) n += is_power ? 57.0 : 37.0;
  if (is_hertz && has_spring && choice.tangential != TangentialLaw::spring) n += 2.0;
  if (choice.has_ledger) n += 6.0 + (has_spring ? 28.0 : choice.tangential == TangentialLaw::viscous ? 7.0 : 0.0);
  return n;
}

Work work_of_sweep(const Bed& bed, const LawChoice& choice, bool has_images, double n_touching) {
  Work work;
  const double per_pair = 8.0 + (choice.is_uniform ? 0.0 : 1.0) + (has_images ? 1.0 : 0.0);
  const double number = static_cast<double>(number_size(choice.is_mixed));
  const double history = number * memory_size(memory_of(choice));
  const double records = bed.n_grains() * doubles(record_size(choice.has_rotation));
  work.items_name = "contacts/s";
  work.items = n_touching;
  work.bytes = bed.n_pairs() * (per_pair + 2.0 * history) + records;
  work.flops = 10.0 * bed.n_pairs() + flops_of_contact(choice) * n_touching;
  work.working_set = bed.n_pairs() * (per_pair + history) + records;
  return work;
}

Work work_of_motion(const Bed& bed, const LawChoice& choice) {
  Work work;
  const double n = bed.n_grains(), n_entries = 2.0 * bed.n_pairs();
  const double record = doubles(record_size(choice.has_rotation)), dissipated = choice.has_ledger ? doubles(4.0) : 0.0;
  work.items_name = "grains/s";
  work.items = n;
  work.bytes = n * (2.0 * record + 2.0 * dissipated + 4.0) + 4.0 * n_entries;
  work.flops = n * (33.0 + (choice.has_rotation ? 10.0 : 0.0) + (choice.has_ledger ? 13.0 : 0.0)) +
               n_entries * (3.0 + (choice.has_rotation ? 6.0 : 0.0) + (choice.has_ledger ? 1.5 : 0.0));
  work.working_set = n * (record + dissipated + 4.0) + 4.0 * n_entries;
  return work;
}

}  // namespace moraine::bench
