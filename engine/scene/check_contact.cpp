// Materials, contact laws, and the parameters of every pair of materials that can meet.
#include <algorithm>
#include <array>
#include <numbers>
#include <set>
#include <string_view>

#include "engine/scene/checks.hpp"
#include "engine/scene/lists.hpp"

namespace moraine::checks {

namespace {

/// Materials by what they are used for; indices into Scene::materials, ascending.
struct Uses {
  std::set<std::size_t> grains;
  std::set<std::size_t> walls;
};

Uses uses_of(const Scene& scene) {
  Uses uses;
  const auto add = [&](std::set<std::size_t>& to, const std::string& name) {
    if (const int index = scene.material_index(name); index >= 0) to.insert(static_cast<std::size_t>(index));
  };
  const std::vector<bool> is_grain = grain_materials(scene);
  for (std::size_t m = 0; m < is_grain.size(); ++m)
    if (is_grain[m]) uses.grains.insert(m);
  for (const WallDefinition& wall : scene.walls)
    if (!wall.symmetry) add(uses.walls, wall.material);
  return uses;
}

/// The combinations of laws that are compiled; a test compares them with is_listed() of kernels/contact.
struct Combination {
  NormalLaw normal;
  TangentialLaw tangential;
};
constexpr std::array listed_combinations = {
    Combination{NormalLaw::linear, TangentialLaw::none},   Combination{NormalLaw::linear, TangentialLaw::viscous},
    Combination{NormalLaw::linear, TangentialLaw::spring}, Combination{NormalLaw::linear, TangentialLaw::power},
    Combination{NormalLaw::hertz, TangentialLaw::none},    Combination{NormalLaw::hertz, TangentialLaw::viscous},
    Combination{NormalLaw::hertz, TangentialLaw::spring},  Combination{NormalLaw::hertz, TangentialLaw::mindlin},
    Combination{NormalLaw::hertz, TangentialLaw::power},
};

/// How alike two tangential laws are: a law with history is nearest to another with history.
int difference(TangentialLaw a, TangentialLaw b) {
  if (a == b) return 0;
  return has_history(a) == has_history(b) ? 1 : 2;
}

/// Rolling resistance and cohesion are compiled with the two usual pairs of laws only.
void check_further(const ContactLaws& contact, Findings& found) {
  const bool has_rolling = contact.rolling != RollingLaw::none, has_cohesion = contact.cohesion != CohesionLaw::none;
  if (!has_rolling && !has_cohesion) return;
  const std::string key = has_cohesion ? "contact.cohesion" : "contact.rolling";
  const std::string_view name = has_cohesion ? name_of(contact.cohesion) : name_of(contact.rolling);
  if (contact.cohesion == CohesionLaw::jkr && contact.normal == NormalLaw::linear)
    found.error(key,
                "\"jkr\" cannot be combined with normal = \"linear\"; nearest: normal = \"hertz\" with tangential = "
                "\"mindlin\", or cohesion = \"linear\" or \"sjkr\" with normal = \"linear\"");
  const TangentialLaw listed = contact.normal == NormalLaw::linear ? TangentialLaw::spring : TangentialLaw::mindlin;
  if (contact.tangential != listed)
    found.error(key,
                "\"{}\" cannot be combined with tangential = \"{}\"; nearest: tangential = \"{}\" with normal = \"{}\" "
                "(friction = 0 leaves tangential forces out)",
                name, name_of(contact.tangential), name_of(listed), name_of(contact.normal));
  if (has_rolling && !contact.rotation)
    found.error("contact.rolling", "\"{}\" needs rotation = true: grains that do not rotate do not roll",
                name_of(contact.rolling));
}

void check_combination(const ContactLaws& contact, Findings& found) {
  const auto is_it = [&](const Combination& c) {
    return c.normal == contact.normal && c.tangential == contact.tangential;
  };
  if (std::any_of(listed_combinations.begin(), listed_combinations.end(), is_it)) return;
  const Combination* near = nullptr;   // same normal law, most alike tangential law
  const Combination* other = nullptr;  // same tangential law
  for (const Combination& c : listed_combinations) {
    if (c.tangential == contact.tangential) other = &c;
    if (c.normal != contact.normal) continue;
    if (!near || difference(c.tangential, contact.tangential) < difference(near->tangential, contact.tangential))
      near = &c;
  }
  std::string listed;
  for (const Combination& c : listed_combinations)
    if (c.normal == contact.normal)
      listed += fmt::format("{}\"{}\"", listed.empty() ? "" : ", ", name_of(c.tangential));
  found.error(
      "contact.tangential",
      "\"{}\" cannot be combined with normal = \"{}\"; nearest: normal = \"{}\" with tangential = "
      "\"{}\"{}; with \"{}\" there are {}",
      name_of(contact.tangential), name_of(contact.normal), name_of(near->normal), name_of(near->tangential),
      other ? fmt::format(", or normal = \"{}\" with \"{}\"", name_of(other->normal), name_of(other->tangential)) : "",
      name_of(contact.normal), listed);
}

/// An entry whose other name is misspelt may be the one that is missed.
bool may_be_misspelt(const Scene& scene, const std::string& a, const std::string& b) {
  const auto is_unknown = [&](const std::string& name) { return scene.material_index(name) < 0; };
  return std::any_of(scene.contact.pairs.begin(), scene.contact.pairs.end(), [&](const PairLaw& pair) {
    const auto& [first, second] = pair.between;
    return (is_unknown(first) && (second == a || second == b || is_unknown(second))) ||
           (is_unknown(second) && (first == a || first == b));
  });
}

void check_pair_values(const ContactLaws& laws, const PairLaw& pair, const std::string& key, Findings& found) {
  if (laws.normal == NormalLaw::linear)
    found.positive(key + ".normal_stiffness", pair.normal_stiffness, "N/m");
  else if (pair.normal_stiffness != 0.0)
    found.warning(key + ".normal_stiffness", "is not used: a Hertz contact takes its stiffness from young and poisson");
  if (pair.tangential_stiffness) {
    found.positive(key + ".tangential_stiffness", *pair.tangential_stiffness, "N/m");
    if (laws.normal == NormalLaw::hertz && laws.tangential == TangentialLaw::power)
      found.warning(key + ".tangential_stiffness",
                    "is not used: with a Hertz contact the power law takes it from young and poisson");
    else if (laws.tangential != TangentialLaw::spring && laws.tangential != TangentialLaw::power)
      found.warning(key + ".tangential_stiffness", "is not used by tangential = \"{}\"", name_of(laws.tangential));
  } else if (laws.normal == NormalLaw::hertz && laws.tangential == TangentialLaw::spring) {
    found.error(key + ".tangential_stiffness",
                "missing: normal = \"hertz\" with tangential = \"spring\" needs it [N/m]; "
                "tangential = \"mindlin\" takes it from young and poisson");
  }
  if (!(pair.restitution > 0.0 && pair.restitution <= 1.0))
    found.error(key + ".restitution", "is {}; expected more than 0 and at most 1", pair.restitution);
  found.not_negative(key + ".friction", pair.friction, "-");
  if (pair.tangential_damping) found.not_negative(key + ".tangential_damping", *pair.tangential_damping, "-");
  found.not_negative(key + ".tangential_viscosity", pair.tangential_viscosity, "N s/m");
  if (pair.tangential_viscosity > 0.0 && laws.tangential != TangentialLaw::viscous)
    found.warning(key + ".tangential_viscosity", "is not used by tangential = \"{}\"", name_of(laws.tangential));
  if (pair.tangential_displacement) {
    found.positive(key + ".tangential_displacement", *pair.tangential_displacement, "m");
    if (laws.tangential != TangentialLaw::power)
      found.warning(key + ".tangential_displacement", "is not used by tangential = \"{}\"", name_of(laws.tangential));
  }
}

/// A number of a pair that belongs to one law: checked where the scene has the law, reported where it has another.
void check_belongs(const std::string& key, double value, const char* unit, bool is_used, std::string_view law,
                   std::string_view other, Findings& found) {
  found.not_negative(key, value, unit);
  if (value != 0.0 && !is_used) found.warning(key, "is not used by {} = \"{}\"", law, other);
}

void check_further_values(const ContactLaws& laws, const PairLaw& pair, const std::string& key, Findings& found) {
  const bool rolls = laws.rolling != RollingLaw::none;
  check_belongs(key + ".rolling_friction", pair.rolling_friction, "-", rolls, "rolling", name_of(laws.rolling), found);
  if (pair.rolling_stiffness) {
    found.positive(key + ".rolling_stiffness", *pair.rolling_stiffness, "N m/rad");
    if (laws.rolling != RollingLaw::spring)
      found.warning(key + ".rolling_stiffness", "is not used by rolling = \"{}\"", name_of(laws.rolling));
  }
  if (!(pair.rolling_damping >= 0.0 && pair.rolling_damping <= 1.0))
    found.error(key + ".rolling_damping", "is {}; expected 0 to 1 (critical damping)", pair.rolling_damping);
  const auto belongs = [&](const char* name, double value, const char* unit, CohesionLaw law) {
    check_belongs(key + name, value, unit, laws.cohesion == law, "cohesion", name_of(laws.cohesion), found);
  };
  belongs(".work_of_adhesion", pair.work_of_adhesion, "J/m2", CohesionLaw::jkr);
  belongs(".cohesion_energy_density", pair.cohesion_energy_density, "J/m3", CohesionLaw::sjkr);
  belongs(".cohesion_force", pair.cohesion_force, "N", CohesionLaw::linear);
  belongs(".cohesion_range", pair.cohesion_range, "m", CohesionLaw::linear);
  belongs(".surface_tension", pair.surface_tension, "N/m", CohesionLaw::liquid_bridge);
  belongs(".liquid_volume", pair.liquid_volume, "m3", CohesionLaw::liquid_bridge);
  belongs(".contact_angle", pair.contact_angle, "rad", CohesionLaw::liquid_bridge);
  if (pair.contact_angle > 0.5 * std::numbers::pi)
    found.error(key + ".contact_angle", "is {} rad; expected at most pi/2: a liquid that does not wet makes no bridges",
                pair.contact_angle);
  if (laws.cohesion == CohesionLaw::liquid_bridge && (pair.surface_tension > 0.0) != (pair.liquid_volume > 0.0))
    found.error(
        key + (pair.liquid_volume > 0.0 ? ".surface_tension" : ".liquid_volume"),
        "missing: a liquid bridge needs both surface_tension [N/m] and liquid_volume [m3]; a pair without either has "
        "no bridges");
}

void check_pairs(const Scene& scene, Findings& found) {
  std::vector<std::string> names;
  for (const Material& material : scene.materials) names.push_back(material.name);
  const std::vector<PairLaw>& pairs = scene.contact.pairs;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const std::string key = fmt::format("contact.pair[{}]", i);
    for (std::size_t side = 0; side < 2; ++side) {
      const std::string& name = pairs[i].between[side];
      if (scene.material_index(name) < 0)
        found.error(fmt::format("{}.between[{}]", key, side), "\"{}\" is not a material{}", name, nearest(name, names));
    }
    if (const PairLaw* first = scene.pair_law(pairs[i].between[0], pairs[i].between[1]); first != &pairs[i])
      found.error(key + ".between", "[\"{}\", \"{}\"] was given before, by contact.pair[{}]", pairs[i].between[0],
                  pairs[i].between[1], first - pairs.data());
    check_pair_values(scene.contact, pairs[i], key, found);
    check_further_values(scene.contact, pairs[i], key, found);
  }
}

void check_that_pairs_are_complete(const Scene& scene, const Uses& uses, Findings& found) {
  std::set<std::size_t> partners = uses.grains;
  partners.insert(uses.walls.begin(), uses.walls.end());
  for (const std::size_t grain : uses.grains)
    for (const std::size_t partner : partners) {
      if (uses.grains.contains(partner) && partner < grain) continue;
      const std::string &a = scene.materials[grain].name, &b = scene.materials[partner].name;
      if (scene.pair_law(a, b) || may_be_misspelt(scene, a, b)) continue;
      found.error("contact.pair",
                  "missing for \"{0}\" and \"{1}\", which can meet; add [[contact.pair]] with "
                  "between = [\"{0}\", \"{1}\"], or one without `between` for all pairs not named",
                  a, b);
    }
}

}  // namespace

void check_materials(const Scene& scene, Findings& found) {
  if (scene.materials.empty() && !scene.gas)
    found.error("material", "missing: a scene needs at least one [[material]] with name and density");
  if (scene.materials.size() > 65535)
    found.error("material", "{} materials; at most 65535 are possible", scene.materials.size());
  const Uses uses = uses_of(scene);
  for (std::size_t i = 0; i < scene.materials.size(); ++i) {
    const Material& material = scene.materials[i];
    const std::string key = fmt::format("material[{}]", i);
    if (material.name.empty()) found.error(key + ".name", "is empty; give the material a name");
    if (const int first = scene.material_index(material.name); first != static_cast<int>(i))
      found.error(key + ".name", "\"{}\" is the name of material[{}] too; names must differ", material.name, first);
    if (uses.grains.contains(i))
      found.positive(key + ".density", material.density, "kg/m3");
    else
      found.not_negative(key + ".density", material.density, "kg/m3");
    if (scene.contact.normal == NormalLaw::hertz && (uses.grains.contains(i) || uses.walls.contains(i)))
      found.positive(key + ".young", material.young, "Pa");
    else
      found.not_negative(key + ".young", material.young, "Pa");
    if (!(material.poisson > -1.0 && material.poisson <= 0.5))
      found.error(key + ".poisson", "is {}; expected more than -1 and at most 0.5", material.poisson);
  }
}

void check_contact(const Scene& scene, Findings& found) {
  check_combination(scene.contact, found);
  check_further(scene.contact, found);
  check_pairs(scene, found);
  check_that_pairs_are_complete(scene, uses_of(scene), found);
}

}  // namespace moraine::checks
