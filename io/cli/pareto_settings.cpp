#include "io/cli/pareto_settings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "engine/run/plan.hpp"
#include "engine/run/probes.hpp"
#include "io/cli/launch.hpp"
#include "io/cli/layout.hpp"
#include "io/cli/table_file.hpp"
#include "io/scene_toml/scene_toml.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

constexpr int n_looks = 20;  // at the paths of a run

std::string assign(const std::string& key, double value) { return fmt::format("{}={}", key, value); }

/// The largest step that is at most `wanted` and fits a whole number of times into `span`.
double fitting(double wanted, double span) { return span / std::ceil(span / wanted * (1.0 - 1e-9)); }

class Planner {
 public:
  Planner(const fs::path& file, const std::vector<std::string>& overrides) : file_(file), overrides_(overrides) {
    plan_.scene = read_scene(file, overrides);
    refuse_scripted_walls(plan_.scene);
    plan_.table = read_pareto(file, overrides);
    look_at_request();
  }

  ParetoPlan make(bool is_product) {
    const ParetoTable& table = plan_.table;
    const double most = *std::max_element(table.steps_per_contact.begin(), table.steps_per_contact.end());
    const StepChoice own = choose_time_step(plan_.scene);
    add(ParetoKind::reference, "reference", {}, std::max(table.reference.value_or(2.0 * most), 1.0), finest_gas());
    add(ParetoKind::scene, "scene", {}, own.steps_per_contact);
    for (const double steps : table.steps_per_contact) add(ParetoKind::time_step, steps_name(steps), {}, steps);
    add_skins(own.steps_per_contact);
    const bool has_mixed = add_mixed(own.steps_per_contact);
    if (plan_.scene.gas) add_gas(own.steps_per_contact);
    for (const ParetoVariant& variant : table.variants)
      add(ParetoKind::variant, variant.name, variant.set, own.steps_per_contact);
    if (is_product) add_product(has_mixed);
    return std::move(plan_);
  }

 private:
  struct GasSetting {
    std::optional<double> step, tolerance;
  };

  [[noreturn]] void fail(const std::string& key, const std::string& message) const {
    throw UsageError(fmt::format("{}: pareto.{}: {}", file_.string(), key, message));
  }

  void look_at_request() {
    const ParetoTable& table = plan_.table;
    plan_.end = table.end.value_or(plan_.scene.time.end);
    if (plan_.end > plan_.scene.time.end)
      fail("end", fmt::format("{:g} s is after time.end = {:g} s", plan_.end, plan_.scene.time.end));
    if (!table.statistics.empty() && !table.values.empty())
      fail("values", "cannot be given together with statistics: a scene is compared by the one or the other");
    plan_.measure = table.statistics.empty() ? ParetoMeasure::paths : ParetoMeasure::statistics;
    if (!(table.from < plan_.end))
      fail("from", fmt::format("{:g} s is not before the end of the runs, {:g} s", table.from, plan_.end));
    if (table.from > 0.0 && plan_.measure == ParetoMeasure::paths) fail("from", "is for statistics; there are none");
    if (table.steps_per_contact.empty()) fail("steps_per_contact", "expected at least one number");
    std::set<std::string> names;
    for (const ParetoVariant& variant : table.variants)
      if (variant.name.empty() || !names.insert(variant.name).second)
        fail("variant", fmt::format("expected a name that no other variant has, found \"{}\"", variant.name));
    for (const std::string& text : table.statistics) find_column(plan_.scene, text, "statistics");
    for (const std::string& text : table.values) find_column(plan_.scene, text, "values");
    if (plan_.measure == ParetoMeasure::paths) plan_.sample = plan_.end / n_looks;
  }

  static std::string steps_name(double steps) { return fmt::format("{:g} steps a contact", steps); }

  double own_gas_step() const { return choose_gas_step(plan_.scene); }

  GasSetting finest_gas() const {
    GasSetting finest;
    if (!plan_.scene.gas) return finest;
    finest.step = 0.5 * own_gas_step();
    for (const double step : plan_.table.gas_steps) finest.step = std::min(*finest.step, step);
    finest.tolerance = 0.1 * plan_.scene.gas->tolerance;
    for (const double tolerance : plan_.table.gas_tolerances) finest.tolerance = std::min(*finest.tolerance, tolerance);
    return finest;
  }

  /// A setting with so many steps in its shortest contact, whose steps fit into the times at which runs are compared and
  /// into the gas steps.
  void add(ParetoKind kind, const std::string& name, std::vector<std::string> changes, double steps,
           const GasSetting& gas = {}) {
    std::vector<std::string> all = overrides_;
    all.insert(all.end(), changes.begin(), changes.end());
    Scene scene;
    try {
      scene = read_scene(file_, all);
    } catch (const SceneFileError& error) {
      throw UsageError(fmt::format("the setting \"{}\" of the sweep cannot be run:\n{}", name, error.what()));
    }
    ParetoSetting setting;
    setting.kind = kind;
    setting.name = name;
    setting.id = id_of(name);
    const double contact_time = choose_time_step(scene).contact_time;
    double dt = contact_time / steps;
    if (plan_.sample > 0.0 && !scene.gas) dt = fitting(dt, plan_.sample);
    if (scene.gas) {
      double gas_step = gas.step.value_or(choose_gas_step(scene));
      if (plan_.sample > 0.0) gas_step = fitting(gas_step, plan_.sample);
      dt = fitting(dt, gas_step);
      changes.push_back(assign("gas.step", gas_step));
      if (gas.tolerance) changes.push_back(assign("gas.tolerance", *gas.tolerance));
    }
    setting.time_step = dt;
    setting.steps_per_contact = contact_time / dt;
    changes.push_back(assign("time.step", dt));
    setting.overrides = std::move(changes);
    plan_.settings.push_back(std::move(setting));
  }

  /// Letters and digits of the name; a number at the end where another has them, too.
  std::string id_of(const std::string& name) const {
    std::string id;
    for (const char c : name) id += std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '.' ? c : '_';
    const auto is_taken = [&](const std::string& wanted) {
      return std::any_of(plan_.settings.begin(), plan_.settings.end(),
                         [&](const ParetoSetting& other) { return other.id == wanted; });
    };
    std::string unique = id;
    for (int n = 2; is_taken(unique); ++n) unique = id + '_' + std::to_string(n);
    return unique;
  }

  void add_skins(double steps) {
    std::vector<double> skins = plan_.table.skins;
    if (skins.empty()) {
      const double diameter = mean_diameter(plan_.scene);
      if (diameter > 0.0) skins = {0.05 * diameter, 0.2 * diameter};
    }
    for (const double skin : skins)
      add(ParetoKind::skin, fmt::format("skin {:.3g} m", skin), {assign("run.skin", skin)}, steps);
  }

  /// False where this program, or the scene, has no mixed precision.
  bool add_mixed(double steps) {
    std::vector<std::string> all = overrides_;
    all.emplace_back("run.precision=mixed");
    try {
      read_scene(file_, all);
    } catch (const SceneFileError& error) {
      plan_.remarks.push_back(std::string("precision \"mixed\" is not tried: ") + error.problems.front().message);
      return false;
    }
    add(ParetoKind::precision, "mixed precision", {"run.precision=mixed"}, steps);
    return true;
  }

  void add_gas(double steps) {
    const double own = own_gas_step(), tolerance = plan_.scene.gas->tolerance;
    std::vector<double> gas_steps = plan_.table.gas_steps, tolerances = plan_.table.gas_tolerances;
    if (gas_steps.empty()) gas_steps = {0.5 * own, 2.0 * own};
    if (tolerances.empty()) tolerances = {1e2 * tolerance, 1e4 * tolerance};
    for (const double step : gas_steps)
      add(ParetoKind::gas_step, fmt::format("gas step {:.3g} s", step), {}, steps, {step, {}});
    for (const double wanted : tolerances)
      add(ParetoKind::gas_tolerance, fmt::format("gas tolerance {:.1e}", wanted), {}, steps, {{}, wanted});
  }

  void add_product(bool has_mixed) {
    std::vector<ParetoVariant> ways = plan_.table.variants;
    if (has_mixed) {
      ways.push_back({"mixed precision", {"run.precision=mixed"}});
      for (ParetoVariant variant : plan_.table.variants) {
        variant.name += ", mixed precision";
        variant.set.emplace_back("run.precision=mixed");
        ways.push_back(std::move(variant));
      }
    }
    for (const ParetoVariant& way : ways)
      for (const double steps : plan_.table.steps_per_contact)
        add(ParetoKind::product, way.name + ", " + steps_name(steps), way.set, steps);
  }

  const fs::path& file_;
  const std::vector<std::string>& overrides_;
  ParetoPlan plan_;
};

std::string without_unit(const std::string& column) { return column.substr(0, column.find(" [")); }

}  // namespace

const char* word_for(ParetoKind kind) {
  static constexpr const char* words[] = {"reference", "scene",         "time step", "skin",   "precision",
                                          "gas step",  "gas tolerance", "variant",   "product"};
  return words[static_cast<std::size_t>(kind)];
}

ParetoPlan plan_pareto(const fs::path& scene_file, const std::vector<std::string>& overrides, bool is_product) {
  return Planner(scene_file, overrides).make(is_product);
}

std::vector<std::string> repeat_overrides(const Scene& scene, int repeat) {
  std::vector<std::string> changes;
  if (repeat <= 1) return changes;
  const double nudge = 1e-3 * std::sqrt(std::max(length(scene.time.gravity), 1.0) * mean_diameter(scene));
  for (std::size_t i = 0; i < scene.particles.size(); ++i) {
    const ParticleGroup& group = scene.particles[i];
    changes.push_back(
        fmt::format("particles[{}].seed={}", i, group.seed + 1000ULL * static_cast<unsigned>(repeat - 1)));
    if (!(group.velocity_deviation > 0.0))
      changes.push_back(assign(fmt::format("particles[{}].velocity_deviation", i), nudge));
  }
  return changes;
}

ProbeColumn find_column(const Scene& scene, const std::string& text, const std::string& key) {
  const auto fail = [&](const std::string& message) {
    throw UsageError(fmt::format("pareto.{}: \"{}\": {}", key, text, message));
  };
  const auto listed = [](const std::vector<std::string>& names) {
    std::string list;
    for (const std::string& name : names) list += (list.empty() ? "\"" : ", \"") + name + '"';
    return list;
  };
  std::vector<std::string> names;
  for (const Probe& probe : scene.output.probes) {
    names.push_back(probe.name);
    if (!text.starts_with(probe.name + '.')) continue;
    const std::string wanted = text.substr(probe.name.size() + 1);
    std::vector<std::string> columns;
    for (const std::string& column : probe_columns(scene, probe)) {
      if (column == wanted || without_unit(column) == wanted)
        return {text, probe.name, without_unit(column), csv_cell(column)};
      columns.push_back(without_unit(column));
    }
    fail(fmt::format("the probe has no such column; it has {}", listed(columns)));
  }
  fail(names.empty() ? std::string("the scene has no probes; expected \"probe.column\"")
                     : fmt::format("expected \"probe.column\" of one of the probes {}", listed(names)));
  return {};
}

}  // namespace moraine
