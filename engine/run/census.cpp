#include "engine/run/census.hpp"

#include <algorithm>
#include <array>

#include "comm/totals.hpp"
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

CensusTaker CensusTaker::total(const World& world) const {
  if (world.is_alone()) return *this;
  std::array<std::uint64_t, 2> counts = {n_born, n_left};
  world.sum(counts);
  std::array<ExactSum, 3> sums = {mass_born, mass_left, energy_left};
  moraine::total(world, sums);
  return {counts[0], counts[1], sums[0], sums[1], sums[2]};
}

Census CensusTaker::census() const {
  return {static_cast<double>(n_born), static_cast<double>(n_left), mass_born.value(), mass_left.value()};
}

void CensusTaker::keep(Accumulators& accumulators) const {
  accumulators["born"] = {static_cast<double>(n_born)};
  accumulators["left"] = {static_cast<double>(n_left)};
  accumulators["mass_born"] = kept(mass_born);
  accumulators["mass_left"] = kept(mass_left);
  accumulators["energy_left"] = kept(energy_left);
}

CensusTaker CensusTaker::from(const Accumulators& accumulators) {
  CensusTaker taker;
  taker.n_born = static_cast<std::uint64_t>(kept_number(accumulators, "born"));
  taker.n_left = static_cast<std::uint64_t>(kept_number(accumulators, "left"));
  taker.mass_born = kept_sum(accumulators, "mass_born");
  taker.mass_left = kept_sum(accumulators, "mass_left");
  taker.energy_left = kept_sum(accumulators, "energy_left");
  return taker;
}

}  // namespace moraine
