#include "engine/run/census.hpp"

#include <algorithm>
#include <array>
#include <span>

#include "comm/totals.hpp"
#include "engine/scene/kept_count.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

namespace {

using Accumulators = std::map<std::string, std::vector<double>>;

const std::vector<double>& find(const Accumulators& accumulators, const std::string& name, std::size_t n) {
  const auto found = accumulators.find(name);
  if (found == accumulators.end() || (found->second.size() != 1 && found->second.size() != n))
    throw SceneError({{"", "the checkpoint holds no \"" + name + "\"", false}});
  return found->second;
}

std::vector<double> kept(const ExactSum& sum) {
  const auto words = sum.words();
  return {words.begin(), words.end()};
}

/// A single number is a sum that was rounded when it was kept (files of version 0.1).
ExactSum kept_sum(const Accumulators& accumulators, const std::string& name) {
  const std::vector<double>& values = find(accumulators, name, ExactSum::n_words);
  ExactSum sum;
  if (values.size() == 1) {
    sum.add(values[0]);
    return sum;
  }
  std::array<std::int64_t, ExactSum::n_words> words;
  std::transform(values.begin(), values.end(), words.begin(), [](double v) { return static_cast<std::int64_t>(v); });
  return ExactSum::from_words(words);
}

}  // namespace

double kept_number(const Accumulators& accumulators, const std::string& name) { return find(accumulators, name, 1)[0]; }

std::uint64_t CensusTaker::n_born() const {
  std::uint64_t n = 0;
  for (const OfMaterial& kind : of_material) n += kind.n_born;
  return n;
}

std::uint64_t CensusTaker::n_left() const {
  std::uint64_t n = 0;
  for (const OfMaterial& kind : of_material) n += kind.n_left;
  return n;
}

void CensusTaker::count_born(std::uint16_t material, double mass) {
  ++of_material[material].n_born;
  of_material[material].mass_born.add(mass);
}

void CensusTaker::count_left(std::uint16_t material, double mass, std::size_t outlet) {
  ++of_material[material].n_left;
  of_material[material].mass_left.add(mass);
  ++n_left_through[outlet];
}

CensusTaker CensusTaker::total(const World& world) const {
  if (world.is_alone()) return *this;
  CensusTaker all = *this;
  std::vector<std::uint64_t> counts = n_left_through;
  std::vector<ExactSum> sums = {energy_left, wall_work};
  for (const OfMaterial& kind : of_material) {
    counts.insert(counts.end(), {kind.n_born, kind.n_left});
    sums.insert(sums.end(), {kind.mass_born, kind.mass_left});
  }
  world.sum(std::span<std::uint64_t>(counts));
  moraine::total(world, sums);
  const std::size_t n_outlets = n_left_through.size();
  std::copy_n(counts.begin(), n_outlets, all.n_left_through.begin());
  all.energy_left = sums[0];
  all.wall_work = sums[1];
  for (std::size_t m = 0; m < of_material.size(); ++m)
    all.of_material[m] = {counts[n_outlets + 2 * m], counts[n_outlets + 2 * m + 1], sums[2 + 2 * m], sums[3 + 2 * m]};
  return all;
}

Census CensusTaker::census() const {
  Census census;
  ExactSum born, left;
  for (const OfMaterial& kind : of_material) {
    census.of_material.push_back({static_cast<double>(kind.n_born), static_cast<double>(kind.n_left),
                                  kind.mass_born.value(), kind.mass_left.value()});
    born.add(kind.mass_born);
    left.add(kind.mass_left);
  }
  census.n_born = static_cast<double>(n_born());
  census.n_left = static_cast<double>(n_left());
  census.mass_born = born.value();
  census.mass_left = left.value();
  census.n_left_through.assign(n_left_through.begin(), n_left_through.end());
  return census;
}

void CensusTaker::keep(Accumulators& accumulators) const {
  ExactSum born, left;
  std::vector<double> counts;
  for (std::size_t m = 0; m < of_material.size(); ++m) {
    const OfMaterial& kind = of_material[m];
    counts.insert(counts.end(), {static_cast<double>(kind.n_born), static_cast<double>(kind.n_left)});
    const std::string number = std::to_string(m);
    accumulators["mass_born_" + number] = kept(kind.mass_born);
    accumulators["mass_left_" + number] = kept(kind.mass_left);
    born.add(kind.mass_born);
    left.add(kind.mass_left);
  }
  accumulators["born"] = {static_cast<double>(n_born())};
  accumulators["left"] = {static_cast<double>(n_left())};
  accumulators["mass_born"] = kept(born);
  accumulators["mass_left"] = kept(left);
  accumulators["energy_left"] = kept(energy_left);
  accumulators["wall_work"] = kept(wall_work);
  if (!counts.empty()) accumulators["born_and_left_of_materials"] = counts;
  if (!n_left_through.empty()) accumulators["left_through_outlets"] = {n_left_through.begin(), n_left_through.end()};
}

CensusTaker CensusTaker::from(const Accumulators& accumulators, const CensusTaker& inside) {
  CensusTaker taker = inside;
  taker.energy_left = kept_sum(accumulators, "energy_left");
  if (accumulators.contains("wall_work")) taker.wall_work = kept_sum(accumulators, "wall_work");
  const std::size_t n_materials = inside.of_material.size();
  if (const auto found = accumulators.find("born_and_left_of_materials"); found != accumulators.end()) {
    std::vector<double> through;
    if (!inside.n_left_through.empty())
      through = find(accumulators, "left_through_outlets", inside.n_left_through.size());
    if (found->second.size() != 2 * n_materials || through.size() != inside.n_left_through.size())
      throw SceneError({{"", "the checkpoint is of a scene with other materials or outlets", false}});
    for (std::size_t m = 0; m < n_materials; ++m) {
      const std::string number = std::to_string(m);
      taker.of_material[m] = {
          kept_count(found->second[2 * m], found->first), kept_count(found->second[2 * m + 1], found->first),
          kept_sum(accumulators, "mass_born_" + number), kept_sum(accumulators, "mass_left_" + number)};
    }
    for (std::size_t k = 0; k < through.size(); ++k)
      taker.n_left_through[k] = kept_count(through[k], "left_through_outlets");
    return taker;
  }
  const auto n_left = kept_count(kept_number(accumulators, "left"), "left");
  if (n_materials == 0) return taker;
  OfMaterial& first = taker.of_material[0];
  first.n_left = n_left;
  first.mass_left = kept_sum(accumulators, "mass_left");
  first.n_born += n_left;
  first.mass_born.add(first.mass_left);
  if (!taker.n_left_through.empty()) taker.n_left_through[0] = n_left;
  return taker;
}

}  // namespace moraine
