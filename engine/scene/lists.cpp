#include "engine/scene/lists.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "comm/totals.hpp"

namespace moraine {

namespace {

/// Of the grains that are here; the sum of diameters goes into `diameters`, which does not depend on their order.
ListFacts facts_of_share(const ListedGrains& list, ExactSum& diameters) {
  ListFacts facts;
  facts.n_grains = list.grains.size();
  for (const GrainSeed& grain : list.grains) {
    if (grain.material >= facts.of_material.size()) facts.of_material.resize(std::size_t{grain.material} + 1);
    ListFacts::OfMaterial& kind = facts.of_material[grain.material];
    ++kind.n_grains;
    facts.fastest = std::max(facts.fastest, length(grain.velocity));
    if (!list.has_radius) continue;
    const double diameter = 2.0 * grain.radius;
    diameters.add(diameter);
    if (!std::isfinite(diameter) || diameter <= 0.0) continue;
    kind.smallest = std::min(kind.smallest, diameter);
    kind.largest = std::max(kind.largest, diameter);
  }
  return facts;
}

template <typename Predicate>
bool any_list(const Scene& scene, Predicate is_it) {
  return std::any_of(scene.particles.begin(), scene.particles.end(), [&](const ParticleGroup& group) {
    const auto* const list = std::get_if<ListedGrains>(&group.fill);
    return list && is_it(*list);
  });
}

}  // namespace

ListFacts facts_of(const ListedGrains& list) {
  if (list.whole) return *list.whole;
  ExactSum diameters;
  ListFacts facts = facts_of_share(list, diameters);
  facts.sum_of_diameters = diameters.value();
  return facts;
}

std::vector<bool> grain_materials(const Scene& scene) {
  std::vector<bool> is_grain(scene.materials.size(), false);
  const auto add = [&](const std::string& name) {
    if (const int m = scene.material_index(name); m >= 0) is_grain[static_cast<std::size_t>(m)] = true;
  };
  const auto add_list = [&](const ListedGrains& list) {
    const ListFacts facts = facts_of(list);
    for (std::size_t m = 0; m < is_grain.size(); ++m)
      if (facts.uses(m)) is_grain[m] = true;
  };
  for (const ParticleGroup& group : scene.particles) {
    add(group.material);
    if (const auto* listed = std::get_if<ListedGrains>(&group.fill)) add_list(*listed);
  }
  for (const Inlet& inlet : scene.inlets) {
    add(inlet.material);
    if (inlet.list) add_list(*inlet.list);
  }
  return is_grain;
}

void share_facts(const World& world, ListedGrains& list) {
  if (world.is_alone()) return;
  ExactSum diameters;
  ListFacts facts = facts_of_share(list, diameters);
  facts.sum_of_diameters = total(world, diameters);

  const bool is_root = world.is_root();
  std::array<std::uint64_t, 4> most = {facts.of_material.size(), is_root && list.has_radius,
                                       is_root && list.has_velocity, is_root && list.has_material};
  world.max(most);
  facts.of_material.resize(most[0]);
  list.has_radius = most[1] > 0;
  list.has_velocity = most[2] > 0;
  list.has_material = most[3] > 0;

  std::vector<std::uint64_t> counts = {facts.n_grains};
  std::vector<double> extremes = {facts.fastest};
  for (const ListFacts::OfMaterial& kind : facts.of_material) {
    counts.push_back(kind.n_grains);
    extremes.insert(extremes.end(), {-kind.smallest, kind.largest});
  }
  world.sum(counts);
  world.max(extremes);
  facts.n_grains = counts[0];
  facts.fastest = extremes[0];
  for (std::size_t m = 0; m < facts.of_material.size(); ++m)
    facts.of_material[m] = {counts[m + 1], -extremes[2 * m + 1], extremes[2 * m + 2]};
  list.whole = std::move(facts);
}

bool is_scattered(const Scene& scene) {
  return any_list(scene, [](const ListedGrains& list) { return list.share.n_ranks > 1; });
}

bool is_shared(const Scene& scene) {
  return any_list(scene, [](const ListedGrains& list) { return list.whole.has_value(); });
}

}  // namespace moraine
