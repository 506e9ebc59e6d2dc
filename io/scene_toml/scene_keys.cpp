// The table of keys: one row a key.
#include "io/scene_toml/scene_keys.hpp"

#include <fmt/format.h>

#include <concepts>

#include "io/scene_toml/growth.hpp"
#include "io/scene_toml/words.hpp"

namespace moraine::scene_toml {

namespace {

// ---- what a type is called, and how a default is written
// -------------------------------------------------------------------

template <class V>
struct TypeName;
template <>
struct TypeName<double> {
  static constexpr const char* text = "number";
};
template <>
struct TypeName<int> {
  static constexpr const char* text = "whole number";
};
template <>
struct TypeName<std::int64_t> {
  static constexpr const char* text = "whole number";
};
template <>
struct TypeName<std::uint64_t> {
  static constexpr const char* text = "whole number";
};
template <>
struct TypeName<bool> {
  static constexpr const char* text = "true or false";
};
template <>
struct TypeName<std::string> {
  static constexpr const char* text = "text";
};
template <>
struct TypeName<Vec3> {
  static constexpr const char* text = "[x, y, z]";
};
template <>
struct TypeName<std::array<bool, 3>> {
  static constexpr const char* text = "[x, y, z], each true or false";
};
template <>
struct TypeName<std::array<std::string, 2>> {
  static constexpr const char* text = "two names";
};
template <>
struct TypeName<std::array<double, 2>> {
  static constexpr const char* text = "[low, high]";
};
template <>
struct TypeName<std::vector<std::array<double, 2>>> {
  static constexpr const char* text = "list of [time, factor]";
};
template <>
struct TypeName<std::vector<std::array<double, 4>>> {
  static constexpr const char* text = "list of [time, x, y, z]";
};
template <>
struct TypeName<std::vector<double>> {
  static constexpr const char* text = "list of numbers";
};
template <>
struct TypeName<std::vector<std::string>> {
  static constexpr const char* text = "list of names";
};
template <class V>
struct TypeName<std::optional<V>> : TypeName<V> {};

std::string preset_text(double v) { return std::isinf(v) ? "infinite" : fmt::format("{}", v); }
template <std::integral V>
std::string preset_text(V v) {
  return fmt::format("{}", v);
}
std::string preset_text(bool v) { return v ? "true" : "false"; }
std::string preset_text(const std::string& v) { return v.empty() ? "none" : "\"" + v + "\""; }
std::string preset_text(Vec3 v) { return fmt::format("[{}, {}, {}]", v.x, v.y, v.z); }
std::string preset_text(const std::array<bool, 3>& v) { return fmt::format("[{}, {}, {}]", v[0], v[1], v[2]); }
template <class V>
std::string preset_text(const std::optional<V>&) {
  return "none";
}
template <class V>
std::string preset_text(const std::vector<V>&) {
  return "none";
}
template <class V, std::size_t n>
std::string preset_text(const std::array<V, n>&) {
  return "none";
}

// ---- rows
// ------------------------------------------------------------------------------------------------------------------

enum Presence { optional_key, required_key };

/// A row whose value is read into a member of the same type. `preset` overrides the default that the struct has.
template <class T, class V>
Key<T> value(const char* name, V T::*member, About about, Presence presence = optional_key,
             const char* preset = nullptr) {
  const bool is_required = presence == required_key;
  KeyDoc doc{"",         name, TypeName<V>::text, about.unit, preset ? preset : preset_text(T{}.*member), about.meaning,
             is_required};
  return {doc,
          [member, unit = about.unit](Reader& reader, const At& at, T& out) { reader.read(at, unit, out.*member); }};
}

/// The same for a struct inside the T, as `group` in a draft.
template <class T, class Inner>
KeyTable<T> inside(Inner T::*part, const KeyTable<Inner>& table, KeyTable<T> more) {
  KeyTable<T> out;
  for (const Key<Inner>& key : table.keys)
    out.keys.push_back(
        {key.doc, [part, read = key.read](Reader& reader, const At& at, T& draft) { read(reader, at, draft.*part); },
         key.describe_inside});
  for (Key<T>& key : more.keys) out.keys.push_back(std::move(key));
  return out;
}

/// A row whose value is one of a few words.
template <class T, class E>
Key<T> choice(const char* name, E T::*member, std::vector<std::pair<std::string, E>> words, About about,
              const char* preset, Presence presence = optional_key) {
  std::vector<std::string> names;
  for (const auto& [word, meaning] : words) names.push_back(word);
  KeyDoc doc{"", name, quoted_list(names, "or"), about.unit, preset, about.meaning, presence == required_key};
  return {doc, [member, names, words](Reader& reader, const At& at, T& out) {
            std::size_t index = 0;
            if (reader.read_choice(at, names, index)) out.*member = words[index].second;
          }};
}

template <class T>
Key<T> direction(const char* name, Vec3 T::*member, const char* preset, const char* meaning) {
  return {{"", name, "[x, y, z] or \"x\", \"-x\", ...", "-", preset, meaning},
          [member](Reader& reader, const At& at, T& out) { reader.read_direction(at, out.*member); }};
}

template <class T>
Key<T> axis(const char* name, int T::*member, const char* meaning) {
  return {{"", name, "\"x\", \"y\" or \"z\"", "", "\"z\"", meaning},
          [member](Reader& reader, const At& at, T& out) { reader.read_axis(at, out.*member); }};
}

/// A table inside a table.
template <class T, class Inner>
Key<T> table(const char* name, Inner T::*member, const KeyTable<Inner>& inner, const char* preset, const char* meaning,
             Presence presence = optional_key) {
  return {{"", name, "table", "", preset, meaning, presence == required_key},
          [member, &inner](Reader& reader, const At& at, T& out) { inner.read(reader, at, out.*member); },
          [&inner](const std::string& section, std::vector<KeyDoc>& docs) { inner.describe(section, docs); }};
}
template <class T, class Inner>
Key<T> table(const char* name, std::optional<Inner> T::*member, const KeyTable<Inner>& inner, const char* preset,
             const char* meaning, Presence presence = optional_key) {
  return {{"", name, "table", "", preset, meaning, presence == required_key},
          [member, &inner](Reader& reader, const At& at, T& out) {
            out.*member = Inner{};
            inner.read(reader, at, *(out.*member));
          },
          [&inner](const std::string& section, std::vector<KeyDoc>& docs) { inner.describe(section, docs); }};
}

/// A list of tables: [[name]].
template <class T, class Inner>
Key<T> tables(const char* name, std::vector<Inner> T::*member, const KeyTable<Inner>& inner, const char* meaning,
              Presence presence = optional_key) {
  return {{"", name, fmt::format("list of tables, [[{}]]", name), "", "none", meaning, presence == required_key},
          [member, &inner](Reader& reader, const At& at, T& out) {
            if (at.node.kind == Node::Kind::table) {
              reader.complain(at,
                              fmt::format("expected a list of tables, found one table; write [[{0}]] with two brackets",
                                          at.path()));
              return;
            }
            if (!reader.expect_list(at, "a list of tables")) return;
            for (std::size_t i = 0; i < at.node.items.size(); ++i) {
              (out.*member).emplace_back();
              inner.read(reader, At{at.node.items[i], at.node.items[i].begin, &at, {}, i}, (out.*member).back());
            }
          },
          [&inner](const std::string& section, std::vector<KeyDoc>& docs) { inner.describe(section, docs); }};
}

// ---- sections
// --------------------------------------------------------------------------------------------------------------

const KeyTable<BoxDraft>& box_keys() {
  static const KeyTable<BoxDraft> keys{{
      value("low", &BoxDraft::low, {"m", "corner with the lowest coordinates"}, optional_key, "the domain's"),
      value("high", &BoxDraft::high, {"m", "corner with the highest coordinates"}, optional_key, "the domain's"),
  }};
  return keys;
}

const KeyTable<Domain>& domain_keys() {
  static const KeyTable<Domain> keys{{
      value("low", &Domain::low, {"m", "corner of the domain with the lowest coordinates"}, required_key),
      value("high", &Domain::high, {"m", "corner of the domain with the highest coordinates"}, required_key),
      value("periodic", &Domain::periodic, {"", "directions in which grains that leave come back on the other side"}),
      value("dimensions", &Domain::dimensions, {"-", "3, or 2: nothing moves along z"}),
  }};
  return keys;
}

Key<TimeControl> step_key() {
  return {{"", "step", "\"auto\" or number", "s", "\"auto\"", "time step; auto chooses it from the stiffest contact"},
          [](Reader& reader, const At& at, TimeControl& out) {
            if (at.node.kind == Node::Kind::text && at.node.text == "auto") return;
            if (at.node.kind == Node::Kind::text && !in_si(at.node.text, "s"))
              reader.complain(at, "expected \"auto\" or a number [s]");
            else
              reader.read(at, "s", out.step);
          }};
}

const KeyTable<TimeControl>& time_keys() {
  static const KeyTable<TimeControl> keys{{
      value("end", &TimeControl::end, {"s", "simulated time at which the run ends"}, required_key),
      step_key(),
      value("steps_per_contact", &TimeControl::steps_per_contact,
            {"-", "with step = \"auto\": steps in the shortest contact"}),
      value("max_speed", &TimeControl::max_speed,
            {"m/s", "fastest approach to expect, which shortens Hertz contacts; 0: estimated from the scene"}),
      value("gravity", &TimeControl::gravity, {"m/s2", "acceleration of gravity"}),
      value("damping", &TimeControl::damping,
            {"1/s", "bulk viscosity c: a force -c m v on each grain, a torque -c I omega on one that rotates"}),
  }};
  return keys;
}

const KeyTable<Material>& material_keys() {
  static const KeyTable<Material> keys{{
      value("name", &Material::name, {"", "name by which grains, walls and pairs refer to it"}, required_key),
      value("density", &Material::density, {"kg/m3", "density; needed where grains are made of it"}),
      value("young", &Material::young, {"Pa", "Young's modulus; needed by Hertz contacts"}),
      value("poisson", &Material::poisson, {"-", "Poisson's ratio"}),
  }};
  return keys;
}

const KeyTable<PairDraft>& pair_keys() {
  static const KeyTable<PairLaw> law{{
      value("normal_stiffness", &PairLaw::normal_stiffness, {"N/m", "spring of the linear normal law; needed by it"}),
      value("tangential_stiffness", &PairLaw::tangential_stiffness,
            {"N/m", "spring of the tangential laws spring and power"}, optional_key, "2/7 of the normal one (linear)"),
      value("restitution", &PairLaw::restitution, {"-", "speed after over speed before a head-on impact"}),
      value("friction", &PairLaw::friction, {"-", "Coulomb's coefficient"}),
      value("tangential_damping", &PairLaw::tangential_damping,
            {"-",
             "tangential dashpot over the normal one (linear), or over the one that matches the tangential spring "
             "(Hertz)"},
            optional_key, "0.5 (linear), 1 (Hertz)"),
      value("tangential_viscosity", &PairLaw::tangential_viscosity, {"N s/m", "dashpot of the viscous tangential law"}),
      value("tangential_displacement", &PairLaw::tangential_displacement,
            {"m", "displacement at which the power law reaches friction"}, optional_key, "1.5 mu F_N / k_t"),
      value("rolling_friction", &PairLaw::rolling_friction,
            {"-", "rolling resistance: its largest torque over normal force and reduced radius"}),
      value("rolling_stiffness", &PairLaw::rolling_stiffness, {"N m/rad", "spring of the rolling law spring"},
            optional_key, "2.25 k_n (mu_r R*)^2"),
      value("rolling_damping", &PairLaw::rolling_damping,
            {"-", "dashpot of the rolling law spring, over the critical one"}),
      value("work_of_adhesion", &PairLaw::work_of_adhesion, {"J/m2", "energy that parts two surfaces; cohesion jkr"}),
      value("cohesion_energy_density", &PairLaw::cohesion_energy_density,
            {"J/m3", "attraction over area of contact; cohesion sjkr"}),
      value("cohesion_force", &PairLaw::cohesion_force, {"N", "attraction in contact; cohesion linear"}),
      value("cohesion_range", &PairLaw::cohesion_range, {"m", "gap at which the attraction ends; cohesion linear"}),
      value("surface_tension", &PairLaw::surface_tension, {"N/m", "of the liquid; cohesion liquid_bridge"}),
      value("contact_angle", &PairLaw::contact_angle, {"rad", "of the liquid; cohesion liquid_bridge"}),
      value("liquid_volume", &PairLaw::liquid_volume, {"m3", "of each bridge; cohesion liquid_bridge"}),
  }};
  static const KeyTable<PairDraft> keys =
      inside(&PairDraft::law, law,
             {{value("between", &PairDraft::between,
                     {"", "the two materials; without it: all pairs that no other entry names"}, optional_key,
                     "all other pairs")}});
  return keys;
}

const KeyTable<ContactDraft>& contact_keys() {
  using Laws = ContactLaws;
  static const KeyTable<Laws> laws{{
      choice("normal", &Laws::normal, {{"linear", NormalLaw::linear}, {"hertz", NormalLaw::hertz}},
             {"", "normal law: linear spring and dashpot, or Hertz with matching damping"}, "\"linear\""),
      choice("tangential", &Laws::tangential,
             {{"none", TangentialLaw::none},
              {"viscous", TangentialLaw::viscous},
              {"spring", TangentialLaw::spring},
              {"mindlin", TangentialLaw::mindlin},
              {"power", TangentialLaw::power}},
             {"", "tangential law, under Coulomb's cap; mindlin with hertz only"}, "\"spring\""),
      value("rotation", &Laws::rotation, {"", "false: grains do not rotate, and carry nothing for it"}),
      choice("rolling", &Laws::rolling,
             {{"none", RollingLaw::none}, {"constant", RollingLaw::constant}, {"spring", RollingLaw::spring}},
             {"",
              "rolling resistance: a torque of constant size against rolling, or an elastic-plastic spring with a "
              "dashpot"},
             "\"none\""),
      choice("cohesion", &Laws::cohesion,
             {{"none", CohesionLaw::none},
              {"jkr", CohesionLaw::jkr},
              {"sjkr", CohesionLaw::sjkr},
              {"linear", CohesionLaw::linear},
              {"liquid_bridge", CohesionLaw::liquid_bridge}},
             {"",
              "attraction: Johnson, Kendall and Roberts (with hertz), its simplified form, a force that falls linearly "
              "with the "
              "gap, or liquid bridges"},
             "\"none\""),
  }};
  static const KeyTable<ContactDraft> keys =
      inside(&ContactDraft::laws, laws,
             {{tables("pair", &ContactDraft::pairs, pair_keys(), "parameters for pairs of materials")}});
  return keys;
}

const KeyTable<CylinderRegion>& cylinder_region_keys() {
  static const KeyTable<CylinderRegion> keys{{
      value("base", &CylinderRegion::base, {"m", "centre of the lower end"}, required_key),
      axis("axis", &CylinderRegion::axis, "direction of the axis"),
      value("radius", &CylinderRegion::radius, {"m", "radius"}, required_key),
      value("length", &CylinderRegion::length, {"m", "length along the axis"}, required_key),
  }};
  return keys;
}

const KeyTable<SphereRegion>& sphere_region_keys() {
  static const KeyTable<SphereRegion> keys{{
      value("centre", &SphereRegion::centre, {"m", "centre"}, required_key),
      value("radius", &SphereRegion::radius, {"m", "radius"}, required_key),
  }};
  return keys;
}

const KeyTable<RegionDraft>& region_keys() {
  static const KeyTable<RegionDraft> keys{{
      table("box", &RegionDraft::box, box_keys(), "none", "a box"),
      table("cylinder", &RegionDraft::cylinder, cylinder_region_keys(), "none", "a cylinder along x, y or z"),
      table("sphere", &RegionDraft::sphere, sphere_region_keys(), "none", "a sphere"),
  }};
  return keys;
}

Key<FillDraft> lattice_key() {
  return {{"", "lattice", "\"cubic\" or \"hexagonal\"", "", "none", "grains in rows instead of at random"},
          [](Reader& reader, const At& at, FillDraft& out) {
            std::size_t index = 0;
            if (reader.read_choice(at, {"cubic", "hexagonal"}, index))
              out.lattice = index == 0 ? LatticeFill::Kind::cubic : LatticeFill::Kind::hexagonal;
          }};
}

/// True where the file says that the scene has two dimensions.
bool is_flat(const Reader& reader) {
  const Node* domain = reader.root().find("domain");
  const Node* dimensions = domain ? domain->find("dimensions") : nullptr;
  return dimensions && dimensions->kind == Node::Kind::integer && dimensions->integer == 2;
}

/// In two dimensions a place may be given by x and y; the grain then lies halfway through the domain.
Key<FillDraft> positions_key() {
  return {{"", "positions", "list of [x, y, z]", "m", "none",
           "centres of the grains, one by one; in two dimensions [x, y] will do"},
          [](Reader& reader, const At& at, FillDraft& out) {
            out.positions.emplace();
            reader.read_points(at, *out.positions, std::numeric_limits<double>::quiet_NaN(), is_flat(reader));
          }};
}

const KeyTable<FillDraft>& fill_keys() {
  static const KeyTable<FillDraft> keys{{
      table("region", &FillDraft::region, region_keys(), "the domain",
            "part of space to fill: one of box, cylinder, sphere"),
      value("solid_fraction", &FillDraft::solid_fraction,
            {"-", "random fill: volume of grains over volume of the region; this or count"}),
      value("count", &FillDraft::count, {"-", "random fill: number of grains; lattice: at most so many"}),
      lattice_key(),
      value("spacing", &FillDraft::spacing, {"m", "lattice: distance between neighbours"}, optional_key,
            "1.001 times the largest diameter"),
      value("jitter", &FillDraft::jitter, {"-", "lattice: random displacement, 0 to 1, as a share of the free gap"}),
      value("file", &FillDraft::file, {"", "list of grains: .csv (also .gz) with columns x, y, z and others, or .h5"}),
      positions_key(),
  }};
  return keys;
}

const KeyTable<SizeDistribution>& distribution_keys() {
  using Sizes = SizeDistribution;
  static const KeyTable<Sizes> keys{{
      choice("distribution", &Sizes::kind,
             {{"uniform", Sizes::Kind::uniform},
              {"normal", Sizes::Kind::normal},
              {"lognormal", Sizes::Kind::lognormal},
              {"list", Sizes::Kind::list}},
             {"", "shape of the distribution by number"}, "none", required_key),
      value("low", &Sizes::low, {"m", "smallest diameter; for normal and lognormal the distribution is cut there"},
            optional_key, "3 deviations below the mean, but at least a tenth of it"),
      value("high", &Sizes::high, {"m", "largest diameter"}, optional_key, "3 deviations above the mean"),
      value("mean", &Sizes::mean, {"m", "normal, lognormal: mean diameter"}, optional_key, "none"),
      value("deviation", &Sizes::deviation, {"m", "normal, lognormal: standard deviation of the diameter"},
            optional_key, "none"),
      value("values", &Sizes::values, {"m", "list: diameters"}),
      value("weights", &Sizes::weights, {"-", "list: shares by number"}, optional_key, "equal shares"),
  }};
  return keys;
}

/// Which keys go with which distribution, and the bounds where none are given.
void complete_distribution(Reader& reader, const At& at, SizeDistribution& sizes) {
  using Kind = SizeDistribution::Kind;
  const auto has = [&](const char* key) { return at.node.find(key) != nullptr; };
  const auto need = [&](const char* key) {
    if (!has(key)) reader.complain_missing(at, key, distribution_keys().find(key)->doc);
  };
  const auto refuse = [&](const char* key, const char* word) {
    if (const Node* found = at.node.find(key))
      reader.complain(At{*found, at.place, &at, key}, fmt::format("does not go with distribution = \"{}\"", word));
  };
  const std::vector<const char*> moments = {"mean", "deviation"}, lists = {"values", "weights"},
                                 bounds = {"low", "high"};
  switch (sizes.kind) {
    case Kind::uniform:
      for (const char* key : bounds) need(key);
      for (const char* key : moments) refuse(key, "uniform");
      for (const char* key : lists) refuse(key, "uniform");
      return;
    case Kind::list:
      need("values");
      for (const char* key : bounds) refuse(key, "list");
      for (const char* key : moments) refuse(key, "list");
      return;
    case Kind::single: return;  // the word was wrong, and was complained about
    case Kind::normal:
    case Kind::lognormal: break;
  }
  for (const char* key : moments) need(key);
  for (const char* key : lists) refuse(key, sizes.kind == Kind::normal ? "normal" : "lognormal");
  if (!(sizes.mean > 0.0) || !(sizes.deviation >= 0.0)) return;
  double low = std::max(sizes.mean - 3.0 * sizes.deviation, 0.1 * sizes.mean);
  double high = sizes.mean + 3.0 * sizes.deviation;
  if (sizes.kind == Kind::lognormal) {
    const double ratio = sizes.deviation / sizes.mean;
    const double sigma = std::sqrt(std::log1p(ratio * ratio));
    const double median = sizes.mean / std::sqrt(1.0 + ratio * ratio);
    low = std::max(median * std::exp(-3.0 * sigma), 0.1 * sizes.mean);
    high = median * std::exp(3.0 * sigma);
  }
  if (!has("low")) sizes.low = low;
  if (!has("high")) sizes.high = high;
}

template <class Draft>
Key<Draft> diameter_key() {
  KeyDoc doc{
      "",
      "diameter",
      "number, [low, high] or table",
      "m",
      "none",
      "diameter of the grains: one, uniform between two, or a distribution; not needed where a file gives sizes"};
  const auto read = [](Reader& reader, const At& at, Draft& out) {
    SizeDistribution& sizes = out.diameter;
    out.has_diameter = true;
    if (at.node.kind == Node::Kind::table) {
      distribution_keys().read(reader, at, sizes);
      complete_distribution(reader, at, sizes);
    } else if (at.node.kind == Node::Kind::list) {
      std::vector<double> bounds;
      if (!reader.read(at, "m", bounds)) return;
      if (bounds.size() != 2) {
        reader.complain(at, "expected a diameter [m], [low, high], or a table with a distribution");
        return;
      }
      sizes.kind = SizeDistribution::Kind::uniform;
      sizes.low = bounds[0];
      sizes.high = bounds[1];
    } else {
      reader.read(at, "m", sizes.value);
    }
  };
  return {doc, read,
          [](const std::string& section, std::vector<KeyDoc>& docs) { distribution_keys().describe(section, docs); }};
}

const KeyTable<ParticleDraft>& particle_keys() {
  using Group = ParticleGroup;
  static const KeyTable<Group> group{{
      value("material", &Group::material, {"", "material of the grains; goes before that of a file"}, optional_key,
            "the file's, or the only one"),
      value("velocity", &Group::velocity, {"m/s", "initial velocity"}),
      value("velocity_deviation", &Group::velocity_deviation,
            {"m/s", "standard deviation of each component of the velocity around it"}),
      value("angular_velocity", &Group::angular_velocity, {"rad/s", "initial angular velocity"}),
      value("seed", &Group::seed, {"-", "seed of everything that is random about the group"}),
  }};
  static const KeyTable<ParticleDraft> keys =
      inside(&ParticleDraft::group, group,
             {{diameter_key<ParticleDraft>(),
               table("fill", &ParticleDraft::fill, fill_keys(), "none",
                     "where the grains are: solid_fraction or count in a region, lattice, file, or positions",
                     required_key)}});
  return keys;
}

const KeyTable<WallMotion>& motion_keys() {
  using Motion = WallMotion;
  using Kind = Motion::Kind;
  static const KeyTable<Motion> keys{{
      choice(
          "type", &Motion::kind,
          {{"translate", Kind::translate},
           {"rotate", Kind::rotate},
           {"vibrate", Kind::vibrate},
           {"swing", Kind::swing},
           {"servo", Kind::servo},
           {"script", Kind::script}},
          {"",
           "translate with a velocity or through places; rotate about an axis; vibrate: amplitude sin(2 pi frequency "
           "t + phase) along the axis; swing: the same about the axis; servo: driven until the grains push as given; "
           "script: as a function of the Python script that runs the scene says"},
          "none", required_key),
      value("velocity", &Motion::velocity, {"m/s", "translate: velocity"}),
      value("places", &Motion::places,
            {"m", "translate: displacement at given times, straight between, resting before and after"}),
      value("origin", &Motion::origin,
            {"m", "rotate, swing, servo with torque: a point of the axis; script: the point whose velocity is given"}),
      direction("axis", &Motion::axis, "\"z\"", "direction of the axis"),
      value("speed", &Motion::speed, {"rad/s", "rotate: angular velocity, right-handed about the axis"}),
      value("angles", &Motion::angles,
            {"s", "rotate: angle [rad] at given times, straight between, resting before and after"}, optional_key,
            "none"),
      value("ramp", &Motion::ramp,
            {"s", "translate, rotate: factor on velocity or speed over time, straight between, constant beyond"}),
      value("amplitude", &Motion::amplitude, {"m or rad", "vibrate [m], swing [rad]: amplitude"}),
      value("frequency", &Motion::frequency, {"Hz", "vibrate, swing: frequency"}),
      value("phase", &Motion::phase, {"rad", "vibrate, swing: phase at time 0"}),
      value("force", &Motion::force,
            {"N", "servo: force with which the grains are to push the wall along the axis; this or torque"}),
      value("torque", &Motion::torque,
            {"N m",
             "servo: torque with which the grains are to turn the wall about the axis; negative drives it "
             "forwards against them"}),
      value("gain", &Motion::gain,
            {"m/(s N)", "servo: speed along (about) the axis for each unit of force (torque) beyond the wanted one"}),
      value("max_speed", &Motion::max_speed,
            {"m/s or rad/s", "servo: it never becomes faster; script [m/s]: no point of the wall in the domain may"}),
      value("mass", &Motion::mass, {"kg or kg m2", "servo: inertia against changes of its speed; 0: none"}),
  }};
  return keys;
}

const KeyTable<PlaneShape>& plane_keys() {
  static const KeyTable<PlaneShape> keys{{
      value("point", &PlaneShape::point, {"m", "a point of the plane"}, required_key),
      direction("normal", &PlaneShape::normal, "\"z\"", "the side on which the grains are"),
  }};
  return keys;
}

const KeyTable<DiscShape>& disc_keys() {
  static const KeyTable<DiscShape> keys{{
      value("centre", &DiscShape::centre, {"m", "centre"}, required_key),
      direction("normal", &DiscShape::normal, "\"z\"", "normal of the disc"),
      value("radius", &DiscShape::radius, {"m", "outer radius"}, required_key),
      value("hole_radius", &DiscShape::hole_radius, {"m", "radius of the hole in the middle"}),
  }};
  return keys;
}

const KeyTable<MeshDraft>& mesh_keys() {
  static const KeyTable<MeshDraft> keys{{
      value("file", &MeshDraft::file, {"", "STL or OBJ file"}, required_key),
      value("scale", &MeshDraft::scale, {"-", "factor on all coordinates of the file; 0.001 for millimetres"}),
      value("translate", &MeshDraft::translate, {"m", "displacement, after scaling"}),
  }};
  return keys;
}

const KeyTable<WallDraft>& wall_keys() {
  static const KeyTable<CylinderShape> cylinder{{
      value("base", &CylinderShape::base, {"m", "centre of one end"}, required_key),
      direction("axis", &CylinderShape::axis, "\"z\"", "direction from the base to the other end"),
      value("radius", &CylinderShape::radius, {"m", "radius"}, required_key),
      value("length", &CylinderShape::length, {"m", "length along the axis"}, required_key),
  }};
  static const KeyTable<ConeShape> cone{{
      value("base", &ConeShape::base, {"m", "centre of one end"}, required_key),
      direction("axis", &ConeShape::axis, "\"z\"", "direction from the base to the other end"),
      value("radius_base", &ConeShape::radius_base, {"m", "radius at the base"}, required_key),
      value("radius_top", &ConeShape::radius_top, {"m", "radius at the other end"}, required_key),
      value("length", &ConeShape::length, {"m", "length along the axis"}, required_key),
  }};
  using Wall = WallDefinition;
  static const KeyTable<Wall> wall{{
      value("name", &Wall::name, {"", "name by which probes refer to it"}, required_key),
      value("material", &Wall::material, {"", "material of the wall; not needed by symmetry planes"}, optional_key,
            "the only material"),
      value("frictionless", &Wall::frictionless, {"", "true: no tangential force"}),
      value("symmetry", &Wall::symmetry, {"", "true: a mirror (planes only); grains meet their own image"}),
      value("from", &Wall::from, {"s", "the wall exists from this time ..."}),
      value("until", &Wall::until, {"s", "... until this time"}),
      value("force_map", &Wall::has_force_map,
            {"", "true (meshes only): snapshots show the mean force and pressure on each triangle"}),
      tables(
          "motion", &Wall::motion, motion_keys(),
          "motions, carried out one after the other: a later one takes along where the earlier ones have brought the "
          "wall"),
  }};
  static const KeyTable<WallDraft> keys = inside(
      &WallDraft::wall, wall,
      {{table("plane", &WallDraft::plane, plane_keys(), "none",
              "an infinite plane; touched from the side of its normal"),
        table("box", &WallDraft::box, box_keys(), "none", "six planes that face inwards; {} is the whole domain"),
        table("cylinder", &WallDraft::cylinder, cylinder, "none", "the lateral surface of a cylinder"),
        table("cone", &WallDraft::cone, cone, "none", "the lateral surface of a truncated cone"),
        table("disc", &WallDraft::disc, disc_keys(), "none", "a flat disc, with a hole or without"),
        table("mesh", &WallDraft::mesh, mesh_keys(), "none", "triangles from a file")}});
  return keys;
}

/// A face of the domain, by its number.
template <class T, class V>
Key<T> face(V T::*member, const char* meaning, Presence presence = optional_key) {
  return {{"", "face", "\"x-low\", \"x-high\", \"y-low\", \"y-high\", \"z-low\" or \"z-high\"", "", "none", meaning,
           presence == required_key},
          [member](Reader& reader, const At& at, T& out) {
            std::size_t index = 0;
            if (reader.read_choice(at, {"x-low", "x-high", "y-low", "y-high", "z-low", "z-high"}, index))
              out.*member = static_cast<int>(index);
          }};
}

const KeyTable<OutletDraft>& outlet_keys() {
  static const KeyTable<Outlet> outlet{{
      value("name", &Outlet::name, {"", "name"}, required_key),
      value("from", &Outlet::from, {"s", "grains leave from this time ..."}),
      value("until", &Outlet::until, {"s", "... until this time"}),
      value("recycle", &Outlet::recycles,
            {"", "name of the inlet through which the same grains come back, with new numbers"}),
  }};
  static const KeyTable<OutletDraft> keys =
      inside(&OutletDraft::outlet, outlet,
             {{face(&OutletDraft::face, "a face of the domain: grains leave as their centre passes it"),
               table("box", &OutletDraft::box, box_keys(), "none", "grains leave as their centre enters it"),
               table("cylinder", &OutletDraft::cylinder, cylinder_region_keys(), "none", "the same"),
               table("sphere", &OutletDraft::sphere, sphere_region_keys(), "none", "the same"),
               table("plane", &OutletDraft::plane, plane_keys(), "none", "grains leave as their centre is behind it"),
               table("disc", &OutletDraft::disc, disc_keys(), "none", "grains leave as their centre crosses it"),
               table("mesh", &OutletDraft::mesh, mesh_keys(), "none", "grains leave as their centre crosses it"),
               value("at", &OutletDraft::at, {"s", "open once only, in the step in which this time is reached"})}});
  return keys;
}

/// Corners of a polygon.
Key<InletDraft> polygon_key() {
  return {{"", "polygon", "list of [x, y, z]", "m", "none", "a flat polygon in space: its corners, in order around it"},
          [](Reader& reader, const At& at, InletDraft& out) {
            out.polygon.emplace();
            reader.read_points(at, *out.polygon, std::numeric_limits<double>::quiet_NaN(), is_flat(reader));
          }};
}

const KeyTable<InletDraft>& inlet_keys() {
  static const KeyTable<InletFillDraft> fill{{
      value("count", &InletFillDraft::count, {"-", "until so many grains are inside the region"}),
      value("mass", &InletFillDraft::mass, {"kg", "until so much is inside"}),
      value("solid_fraction", &InletFillDraft::solid_fraction, {"-", "until so much of the region is filled"}),
  }};
  static const KeyTable<Inlet> inlet{{
      value("name", &Inlet::name, {"", "name"}, required_key),
      value("material", &Inlet::material, {"", "material of the grains; goes before that of a file"}, optional_key,
            "the only one, or the file's"),
      value("number_rate", &Inlet::number_rate, {"1/s", "grains a second"}),
      value("mass_rate", &Inlet::mass_rate, {"kg/s", "mass a second; what is owed stays below one grain"}),
      value("total_count", &Inlet::total_count, {"-", "no more grains altogether"}),
      value("total_mass", &Inlet::total_mass, {"kg", "no more mass altogether"}),
      value("from", &Inlet::from, {"s", "grains are born from this time ..."}),
      value("until", &Inlet::until, {"s", "... until this time"}),
      value("interval", &Inlet::interval, {"s", "time between births; longer ones cost less"}, optional_key,
            "rates: as soon as a grain is owed; else 100 steps"),
      value("velocity", &Inlet::velocity, {"m/s", "velocity at birth"}),
      value("velocity_deviation", &Inlet::velocity_deviation,
            {"m/s", "standard deviation of each component of the velocity around it"}),
      value("angular_velocity", &Inlet::angular_velocity, {"rad/s", "angular velocity at birth"}),
      value("seed", &Inlet::seed, {"-", "seed of everything that is random about the inlet"}),
  }};
  static const KeyTable<InletDraft> keys = inside(
      &InletDraft::inlet, inlet,
      {{diameter_key<InletDraft>(),
        table("region", &InletDraft::region, region_keys(), "none", "grains are born wholly inside a region"),
        face(&InletDraft::face, "grains are born against a face of the domain"),
        table("part", &InletDraft::part, box_keys(), "the whole face", "with face: the part of it inside this box"),
        table("disc", &InletDraft::disc, disc_keys(), "none", "grains are born with their centres on a disc in space"),
        polygon_key(),
        table("fill", &InletDraft::fill, fill, "none",
              "the region is filled, and kept filled, to a count, mass or solid fraction"),
        value("file", &InletDraft::file,
              {"",
               "list of grains, or a snapshot or checkpoint of another run; each is born at its place as soon as that "
               "is free"})}});
  return keys;
}

/// Along which the scene has cells; in two dimensions x and y will do.
template <class T>
Key<T> cells_key(const char* meaning, Presence presence) {
  return {{"", "cells", "[x, y, z], whole numbers", "-", "none", meaning, presence == required_key},
          [](Reader& reader, const At& at, T& out) {
            const bool may_lack_z = is_flat(reader);
            const std::size_t n = at.node.kind == Node::Kind::list ? at.node.items.size() : 0;
            if (n != 3 && !(n == 2 && may_lack_z)) {
              reader.complain(at, may_lack_z ? "expected [x, y], two whole numbers, such as [15, 90]"
                                             : "expected [x, y, z], three whole numbers, such as [20, 20, 40]");
              return;
            }
            out.cells = {1, 1, 1};
            for (std::size_t i = 0; i < n; ++i)
              reader.read(At{at.node.items[i], at.node.items[i].begin, &at, {}, i}, "", out.cells[i]);
          }};
}

Key<Gas> gas_step_key() {
  return {{"", "step", "\"auto\" or number", "s", "\"auto\"",
           "longest gas step, a whole number of grain steps; divided further where the gas is fast"},
          [](Reader& reader, const At& at, Gas& out) {
            if (at.node.kind == Node::Kind::text && at.node.text == "auto") return;
            if (at.node.kind == Node::Kind::text && !in_si(at.node.text, "s"))
              reader.complain(at, "expected \"auto\" or a number [s]");
            else
              reader.read(at, "s", out.step);
          }};
}

const KeyTable<GasBoundaryDraft>& gas_boundary_keys() {
  using Boundary = GasBoundary;
  using Kind = Boundary::Kind;
  using Profile = Boundary::Profile;
  static const KeyTable<Boundary> boundary{{
      face(&Boundary::face, "the face of the domain", required_key),
      choice(
          "type", &Boundary::kind,
          {{"velocity", Kind::velocity},
           {"pressure", Kind::pressure},
           {"no_slip", Kind::no_slip},
           {"free_slip", Kind::free_slip}},
          {"",
           "velocity: gas comes in (or is drawn off) as given; pressure: it goes as it likes; no_slip: a wall that it "
           "sticks to; free_slip: a smooth wall"},
          "none", required_key),
      value(
          "velocity", &Boundary::velocity,
          {"m/s",
           "type velocity: volume of gas per time and area (superficial), along the axes; no_slip: of the wall, along "
           "itself"}),
      choice("profile", &Boundary::profile, {{"uniform", Profile::uniform}, {"parabolic", Profile::parabolic}},
             {"", "type velocity: the same everywhere, or zero at the edges of the part with the velocity as its mean"},
             "\"uniform\""),
      value("ramp", &Boundary::ramp,
            {"s", "factor on the velocity over time, linear between the times given and constant beyond"}),
      value("pressure", &Boundary::pressure, {"Pa", "type pressure: above hydrostatic"}),
  }};
  static const KeyTable<GasBoundaryDraft> keys =
      inside(&GasBoundaryDraft::boundary, boundary,
             {{table("part", &GasBoundaryDraft::part, box_keys(), "the whole face",
                     "the cells of the face whose centres lie in this box")}});
  return keys;
}

const KeyTable<GasDraft>& gas_keys() {
  using Law = std::optional<DragLaw>;
  static const KeyTable<Gas> gas{{
      cells_key<Gas>("cells of the gas along each side of the domain; in two dimensions [x, y] will do", required_key),
      value("density", &Gas::density, {"kg/m3", "density"}, required_key),
      value("viscosity", &Gas::viscosity, {"Pa s", "dynamic viscosity"}, required_key),
      gas_step_key(),
      choice("drag", &Gas::drag,
             {{"gidaspow", Law(DragLaw::gidaspow)},
              {"wen_yu", Law(DragLaw::wen_yu)},
              {"ergun", Law(DragLaw::ergun)},
              {"syamlal_obrien", Law(DragLaw::syamlal_obrien)},
              {"di_felice", Law(DragLaw::di_felice)},
              {"beetstra", Law(DragLaw::beetstra)},
              {"koch_hill", Law(DragLaw::koch_hill)},
              {"schiller_naumann", Law(DragLaw::schiller_naumann)},
              {"none", Law()}},
             {"", "drag law between gas and grains; needed where there are grains"}, "none"),
      choice("model", &Gas::model, {{"A", GasModel::a}, {"B", GasModel::b}},
             {"", "A: gas and grains share the pressure gradient; B: the gas alone has it"}, "\"A\""),
      choice("weights", &Gas::weights,
             {{"cell", GasWeights::cell}, {"trilinear", GasWeights::trilinear}, {"smoothed", GasWeights::smoothed}},
             {"",
              "how grains are spread over cells, and feel them: the cell around the centre, the eight nearest, or over "
              "`smoothing`"},
             "\"trilinear\""),
      value("smoothing", &Gas::smoothing, {"m", "weights = \"smoothed\": standard deviation of the spread"}),
      value("least_void_fraction", &Gas::least_void_fraction,
            {"-", "no cell is taken as denser than that; how often it happens is reported"}),
      choice("coupling", &Gas::moves_gas, {{"two_way", true}, {"one_way", false}},
             {"", "one_way: grains feel the gas, but the gas does not feel the grains"}, "\"two_way\""),
      value("velocity", &Gas::velocity, {"m/s", "of the gas at the start, between the grains"}),
      value("pressure_gradient", &Gas::pressure_gradient, {"Pa/m", "mean one, in periodic directions"}),
      value("tolerance", &Gas::tolerance,
            {"-", "largest mass imbalance of a cell in a gas step, as a share of the gas it holds"}),
  }};
  static const KeyTable<GasDraft> keys = inside(
      &GasDraft::gas, gas,
      {{tables("boundary", &GasDraft::boundaries, gas_boundary_keys(),
               "what the gas meets on a face, or a part of one; a wall that it sticks to where nothing is given, "
               "later entries go before earlier ones")}});
  return keys;
}

Key<Probe> points_key() {
  return {{"", "points", "list of [x, y, z]", "m", "none", "pressure: where; in two dimensions [x, y] will do"},
          [](Reader& reader, const At& at, Probe& out) {
            reader.read_points(at, out.points, std::numeric_limits<double>::quiet_NaN(), is_flat(reader));
          }};
}

const KeyTable<ProbeDraft>& probe_keys() {
  using Kind = Probe::Kind;
  static const KeyTable<Probe> probe{{
      choice("kind", &Probe::kind,
             {{"energy", Kind::energy},
              {"wall_force", Kind::wall_force},
              {"wall_pressure", Kind::wall_pressure},
              {"region", Kind::region},
              {"mass", Kind::mass},
              {"profile", Kind::profile},
              {"contacts", Kind::contacts},
              {"pressure", Kind::pressure},
              {"pressure_drop", Kind::pressure_drop},
              {"bed_height", Kind::bed_height},
              {"gas_profile", Kind::gas_profile},
              {"gas_mean", Kind::gas_mean},
              {"mixing", Kind::mixing},
              {"fields", Kind::fields}},
             {"", "what is recorded"}, "none", required_key),
      value("name", &Probe::name, {"", "name of the CSV file, without ending"}, optional_key, "the kind"),
      value("wall", &Probe::wall, {"", "wall_force, wall_pressure: name of the wall"}),
      axis("axis", &Probe::axis,
           "wall_pressure, profile, gas_profile: direction along which it is cut into slices; pressure_drop, "
           "bed_height: direction along which it is measured"),
      value("bins", &Probe::bins,
            {"-", "wall_pressure, profile: number of slices; mixing: cells along the longest side of the region"}),
      value("interval", &Probe::interval, {"s", "time between two rows; fields: between two samples"}, required_key),
      points_key(),
      value("between", &Probe::between, {"m", "pressure_drop: the two planes, by their places along the axis"},
            optional_key, "the faces of the domain"),
      value("share", &Probe::share, {"-", "bed_height: share of the grains' mass that lies below"}),
      value("material", &Probe::material, {"", "mixing: the grains whose share is looked at"}),
      value("from", &Probe::from, {"s", "gas_profile, gas_mean, fields: averages begin at this time"}),
      value("by_material", &Probe::by_material,
            {"", "region, profile, fields: of the grains of each material besides"}),
      cells_key<Probe>("fields: cells along each side of the region; 1: averaged over that side", optional_key),
      value("width", &Probe::width,
            {"-", "fields: of the weight by which a grain is spread, in cells; it ends two widths from the centre"}),
      value("margin", &Probe::margin,
            {"-", "fields: cells by which the grid goes on beyond sides of the region that are not periodic"},
            optional_key, "as many as the weight reaches"),
      value("average", &Probe::average,
            {"s", "fields: samples of that time are averaged into one file; 0: each sample is a file of its own"}),
      value("table", &Probe::has_table, {"", "fields: each file also as CSV, one row a cell"}),
  }};
  static const KeyTable<ProbeDraft> keys =
      inside(&ProbeDraft::probe, probe,
             {{table("region", &ProbeDraft::region, box_keys(), "the domain",
                     "region, profile, gas_profile, mixing, fields: the box that is looked at")}});
  return keys;
}

const KeyTable<SceneDraft>& scene_table();

Key<SceneDraft> output_key() {
  using Out = Output;
  static const KeyTable<Out> keys{{
      value("directory", &Out::directory, {"", "where the results go"}, optional_key, "runs/NAME of the scene file"),
      value("snapshots", &Out::snapshot_interval, {"s", "simulated time between snapshots; 0: the last state only"}),
      value("checkpoints", &Out::checkpoint_interval,
            {"s", "simulated time between checkpoints; 0: at the end and on signals only"}),
      value("checkpoints_kept", &Out::checkpoints_kept, {"-", "number of checkpoints kept"}),
      value("distributed", &Out::distributed,
            {"", "each rank writes a file of its own, and one in front shows all of them as one"}),
      value("fields", &Out::fields, {"", "fields of snapshots"}, optional_key, "all that describe the state"),
      value("energy", &Out::energy, {"", "keep the energy ledger; on where a probe needs it"}),
  }};
  return {{"", "output", "table", "", "none", "what is written, and when"},
          [](Reader& reader, const At& at, SceneDraft& out) {
            keys.read(reader, at, out.output);
            if (at.node.find("energy")) out.energy = out.output.energy;
          },
          [](const std::string& section, std::vector<KeyDoc>& docs) { keys.describe(section, docs); }};
}

const KeyTable<RunControl>& run_keys() {
  static const KeyTable<RunControl> keys{{
      value("layout", &RunControl::layout, {"", "\"auto\", or ranks x threads such as \"1x4\""}),
      choice(
          "balance", &RunControl::balance,
          {{"auto", Balance::automatic}, {"threads", Balance::threads}, {"cuts", Balance::cuts}, {"off", Balance::off}},
          {"",
           "what follows the grains from rank to rank: the cores of a node (threads), the cuts between ranks (cuts), "
           "both as it pays (auto), or nothing; for threads and off ranks begin with equal boxes"},
          "\"auto\""),
      choice("precision", &RunControl::precision, {{"double", Precision::double_}, {"mixed", Precision::mixed}},
             {"",
              "precision of contact forces: double, or float from differences taken in double (mixed); motion and sums "
              "are in double"},
             "\"double\""),
      value("skin", &RunControl::skin, {"m", "range beyond contact in which pairs are kept; 0: chosen"}),
      value("max_overlap", &RunControl::max_overlap, {"-", "overlap over the smaller radius at which the run stops"}),
      value("stop_on", &RunControl::stop_on,
            {"",
             "warnings that end the run instead, once their flight record is complete: \"energy\" (an open ledger), "
             "\"gas_balance\", \"void_fraction\" (many cells at their least for long)"}),
  }};
  return keys;
}

const KeyTable<ScaleDraft>& scale_keys() {
  static const Key<ScaleDraft> weak{{"", "weak", "list of keys", "", "none",
                                     "numbers that grow with the number of cores, such as \"domain.high.z\", "
                                     "\"particles[0].fill.count\"; a high grows so "
                                     "that its distance from the low beside it does"},
                                    [](Reader& reader, const At& at, ScaleDraft& out) {
                                      if (!reader.read(at, "", out.weak)) return;
                                      for (const std::string& key : out.weak)
                                        if (const std::string problem = growth_of(reader.root(), key, 2).problem;
                                            !problem.empty())
                                          reader.complain(at, problem);
                                    }};
  static const KeyTable<ScaleDraft> keys{{weak}};
  return keys;
}

/// A list of numbers that must all be at least, or above, `least`.
Key<ParetoTable> numbers_key(const char* name, std::vector<double> ParetoTable::*member, About about, double least,
                             bool may_be_least, const char* preset) {
  return {{"", name, "list of numbers", about.unit, preset, about.meaning},
          [member, unit = about.unit, least, may_be_least](Reader& reader, const At& at, ParetoTable& out) {
            if (!reader.read(at, unit, out.*member)) return;
            for (const double number : out.*member)
              if (!(number > least || (may_be_least && number == least)))
                reader.complain(at, fmt::format("expected numbers {} {:g}, found {:g}", may_be_least ? "from" : "above",
                                                least, number));
          }};
}

/// One number, checked in the same way.
template <class V>
Key<ParetoTable> number_key(const char* name, V ParetoTable::*member, About about, double least, bool may_be_least,
                            const char* preset) {
  return {{"", name, "number", about.unit, preset, about.meaning},
          [member, unit = about.unit, least, may_be_least](Reader& reader, const At& at, ParetoTable& out) {
            double number = 0.0;
            if (!reader.read(at, unit, number)) return;
            if (!(number > least || (may_be_least && number == least)))
              reader.complain(at, fmt::format("expected a number {} {:g}", may_be_least ? "from" : "above", least));
            out.*member = number;
          }};
}

constexpr double least_steps_per_contact = 2.0;  // with fewer no contact is seen at all

const KeyTable<ParetoTable>& pareto_keys() {
  using Table = ParetoTable;
  static const KeyTable<ParetoVariant> variant{{
      value("name", &ParetoVariant::name, {"", "name in tables and plots"}, required_key),
      value("set", &ParetoVariant::set, {"", "changes of the scene, each \"key=value\" as for --set"}, required_key),
  }};
  static const KeyTable<Table> keys{{
      number_key("end", &Table::end, {"s", "time to which each run goes"}, 0.0, false, "time.end"),
      number_key("from", &Table::from, {"s", "averages of the statistics begin here"}, 0.0, true, "0"),
      value("statistics", &Table::statistics,
            {"",
             "for chaotic scenes: columns of probes, each \"probe.column\", whose averages over time are compared, "
             "with confidence intervals from runs with other seeds"}),
      value("values", &Table::values,
            {"",
             "for scenes that are not chaotic: columns of probes that are compared row by row, besides the paths of "
             "all grains"}),
      numbers_key("steps_per_contact", &Table::steps_per_contact,
                  {"-", "time steps that are tried, as steps in the shortest contact"}, least_steps_per_contact, true,
                  "[10, 20, 50, 100]"),
      number_key("reference", &Table::reference,
                 {"-", "steps in the shortest contact of the run that all are compared with"}, least_steps_per_contact,
                 true, "twice the most that are tried"),
      numbers_key("skins", &Table::skins, {"m", "skins that are tried"}, 0.0, false,
                  "0.05 and 0.2 of the mean diameter"),
      numbers_key("gas_steps", &Table::gas_steps, {"s", "gas steps that are tried"}, 0.0, false,
                  "half and twice that of the scene"),
      numbers_key("gas_tolerances", &Table::gas_tolerances, {"-", "tolerances of the gas that are tried"}, 0.0, false,
                  "100 and 10 000 times that of the scene"),
      number_key("accept", &Table::accept, {"-", "error that a recommended setting may have"}, 0.0, false, "0.01"),
      tables("variant", &Table::variants, variant, "other ways to run the scene, such as another contact law"),
  }};
  return keys;
}

const KeyTable<SceneDraft>& scene_table() {
  static const KeyTable<SceneDraft> keys{{
      value("title", &SceneDraft::title, {"", "a line about the scene"}),
      table("domain", &SceneDraft::domain, domain_keys(), "none", "the space of the scene", required_key),
      table("time", &SceneDraft::time, time_keys(), "none", "how long, in which steps, and what acts on every grain",
            required_key),
      tables("material", &SceneDraft::materials, material_keys(), "materials of grains and walls"),
      table("contact", &SceneDraft::contact, contact_keys(), "none", "contact laws and their parameters"),
      tables("particles", &SceneDraft::particles, particle_keys(), "groups of grains"),
      tables("wall", &SceneDraft::walls, wall_keys(), "walls; each has exactly one shape"),
      tables("outlet", &SceneDraft::outlets, outlet_keys(), "where grains leave; each has exactly one place"),
      tables("inlet", &SceneDraft::inlets, inlet_keys(), "where grains are born while the scene runs"),
      output_key(),
      tables("probe", &SceneDraft::probes, probe_keys(), "time series, each written to a CSV file"),
      table("run", &SceneDraft::run, run_keys(), "none", "how it is run; results do not depend on it"),
      table("gas", &SceneDraft::gas, gas_keys(), "none", "gas between the grains, on a grid over the whole domain"),
      table("scale", &SceneDraft::scale, scale_keys(), "none", "how moraine scale --weak makes the scene larger"),
      table("pareto", &SceneDraft::pareto, pareto_keys(), "none", "what moraine pareto tries, and what it compares"),
  }};
  return keys;
}

}  // namespace

const std::vector<KeyDoc>& all_keys() {
  static const std::vector<KeyDoc> docs = [] {
    std::vector<KeyDoc> out;
    scene_table().describe("", out);
    return out;
  }();
  return docs;
}

SceneDraft read_draft(Reader& reader) {
  SceneDraft draft;
  const At top{reader.root(), reader.root().begin};
  scene_table().read(reader, top, draft);
  // Gas can be alone.
  for (const char* key : {"material", "particles"})
    if (!reader.root().find("gas") && !reader.root().find(key) &&
        !(std::string_view(key) == "particles" && reader.root().find("inlet")))
      reader.complain_missing(top, key, scene_table().find(key)->doc);
  return draft;
}

}  // namespace moraine::scene_toml

namespace moraine {

std::string scene_key_reference() {
  using scene_toml::KeyDoc;
  std::string out =
      "# Keys of a scene file\n\nGenerated from the table that reads them. SI units everywhere. A key is required "
      "where its default is \"required\".\n";
  const auto escaped = [](const std::string& text) {
    std::string cell;
    for (const char c : text) cell += c == '|' ? std::string("\\|") : std::string(1, c);
    return cell;
  };
  const std::string* section = nullptr;
  for (const KeyDoc& doc : scene_toml::all_keys()) {
    if (!section || *section != doc.section) {
      out += doc.section.empty() ? "\n## At the top\n" : fmt::format("\n## {}\n", doc.section);
      out += "\n| key | type | unit | default | meaning |\n|---|---|---|---|---|\n";
      section = &doc.section;
    }
    out += fmt::format("| `{}` | {} | {} | {} | {} |\n", doc.name, escaped(doc.type), doc.unit,
                       doc.is_required ? "required" : escaped(doc.preset), escaped(doc.meaning));
  }
  return out;
}

}  // namespace moraine
