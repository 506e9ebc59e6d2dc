#include "io/cli/summary.hpp"

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numeric>
#include <type_traits>

#include "io/checkpoint/durable_file.hpp"
#include "io/cli/layout.hpp"
#include "io/cli/text.hpp"
#include "io/cli/version.hpp"

namespace moraine {

using Json = nlohmann::ordered_json;

namespace {

constexpr double worth_a_row = 0.0005;  // of the whole
constexpr int json_format = 1;          // of summary.json

/// The phases of the steps of this rank, since counting began.
std::vector<PhaseTime> phases_of_steps(const Simulation& simulation, const RunTimes& times, const RunMark& mark) {
  std::vector<PhaseTime> rows = simulation.phases();
  for (std::size_t i = 0; i < std::min(rows.size(), mark.phases.size()); ++i) rows[i].seconds -= mark.phases[i].seconds;
  // What the simulation sees as the time between its steps is start and output, which have rows of their own.
  std::erase_if(rows, [](const PhaseTime& row) { return row.name == "outside the step"; });
  double in_phases = 0.0;
  for (const PhaseTime& row : rows) in_phases += row.seconds;
  // What the steps took beyond their phases is shown, not hidden.
  rows.push_back({"other", std::max(times.stepping - in_phases, 0.0)});
  return rows;
}

/// What the threads of this rank did in the steps, since counting began.
std::vector<NamedWork> work_of_steps(const Simulation& simulation, const RunMark& mark) {
  std::vector<NamedWork> rows = simulation.work();
  for (std::size_t i = 0; i < std::min(rows.size(), mark.work.size()); ++i) {
    PhaseWork& now = rows[i].work;
    const PhaseWork& before = mark.work[i].work;
    now.seconds -= before.seconds;
    now.waited -= before.waited;
    now.working -= before.working;
    now.held -= before.held;
    for (std::size_t t = 0; t < before.threads.size(); ++t) now.threads[t] -= before.threads[t];
    for (std::size_t t = 0; t < before.barriers.size(); ++t) now.barriers[t] -= before.barriers[t];
  }
  return rows;
}

template <typename Row, typename Struct>
concept IsMaybeConst = std::is_same_v<std::remove_const_t<Row>, Struct>;

/// What summary.json calls the members of a struct: f(name, member) for each, to write them and to read them back.
template <IsMaybeConst<NamedWork> Row, typename Function>
void each_member(Row& row, Function f) {
  f("phase", row.phase);
  f("seconds", row.work.seconds);
  f("waited", row.work.waited);
  f("working", row.work.working);
  f("held", row.work.held);
  f("threads", row.work.threads);
  f("barriers", row.work.barriers);
}

template <IsMaybeConst<BalanceTotals> Row, typename Function>
void each_member(Row& balance, Function f) {
  f("looks", balance.n_looks);
  f("core_moves", balance.n_core_moves);
  f("cut_moves", balance.n_cut_moves);
  f("imbalance", balance.imbalance);
  f("imbalance_at_home", balance.imbalance_at_home);
  f("last_imbalance", balance.last_imbalance);
  f("node_imbalance", balance.node_imbalance);
  f("threads", balance.n_threads);
}

template <IsMaybeConst<RankSummary> Row, typename Function>
void each_member(Row& rank, Function f) {  // all but the work
  f("node", rank.places.node);
  f("grains", rank.n_grains);
  f("pairs", rank.n_pairs);
  f("ghosts", rank.n_ghosts);
  f("neighbours", rank.n_neighbours);
  f("messages_per_step", rank.n_messages);
  f("bytes_per_step", rank.n_bytes);
  f("migrated", rank.n_migrated);
  f("stepping_seconds", rank.stepping);
  f("start_seconds", rank.start);
  f("output_seconds", rank.outputs);
  f("reduction_seconds", rank.reductions);
  f("parcel_seconds", rank.parcels);
  f("phase_seconds", rank.phases);
  f("memory", rank.memory);
  f("peak_memory", rank.peak_memory);
  f("cpus_allowed", rank.places.n_allowed);
  f("cpus_before", rank.places.cpus_before);
  f("cpus", rank.places.cpus);
  f("cores", rank.places.cores);
}

template <IsMaybeConst<GasTotals> Row, typename Function>
void each_member(Row& gas, Function f) {
  f("steps", gas.n_steps);
  f("parts", gas.n_parts);
  f("iterations", gas.n_iterations);
  f("mass_imbalance", gas.imbalance);
  f("cells_floored", gas.n_floored);
  f("least_void_fraction", gas.least_void_fraction);
  f("momentum_error", gas.momentum_error);
}

template <typename Row>
Json json_of(const Row& row) {
  Json json;
  each_member(row, [&](const char* name, const auto& member) { json[name] = member; });
  return json;
}

template <typename Row>
Row read(const Json& json) {
  Row row;
  each_member(row, [&](const char* name, auto& member) { json.at(name).get_to(member); });
  return row;
}

Json balance_json(const RunSummary& run) {
  Json json = {{"mode", run.balance_mode}};
  json.update(json_of(run.balance));
  return json;
}

Json rank_json(const RankSummary& rank) {
  Json json = json_of(rank);
  json["work"] = Json::array();
  for (const NamedWork& row : rank.work) json["work"].push_back(json_of(row));
  return json;
}

RankSummary rank_of(const Json& json) {
  RankSummary rank = read<RankSummary>(json);
  if (const auto work = json.find("work"); work != json.end())  // older ones have none
    for (const Json& row : *work) rank.work.push_back(read<NamedWork>(row));
  return rank;
}

const char* word_for(Balance balance) {
  constexpr const char* words[] = {"auto", "threads", "cuts", "off"};
  return words[static_cast<std::size_t>(balance)];
}

RankSummary this_rank(const Simulation& simulation, const RunTimes& times, const RunMark& mark,
                      const std::vector<PhaseTime>& phases) {
  const HaloCounts halo = simulation.halo_counts();
  RankSummary rank;
  for (const PhaseTime& phase : phases) rank.phases.push_back(phase.seconds);
  rank.stepping = times.stepping;
  rank.start = times.start;
  rank.outputs = times.outputs;
  rank.reductions = times.world.reductions;
  rank.parcels = times.world.parcels;
  rank.n_grains = simulation.n_own_grains();
  rank.n_pairs = static_cast<std::uint64_t>(simulation.n_own_pairs());
  rank.n_ghosts = halo.n_ghosts;
  rank.n_neighbours = halo.n_neighbours;
  rank.n_messages = halo.n_messages;
  rank.n_bytes = halo.n_bytes;
  rank.n_migrated = simulation.n_migrated() - mark.n_migrated;
  rank.memory = simulation.memory();
  rank.peak_memory = peak_memory();
  rank.places = {node_name(), mark.cpus, times.cpus, {}, available_cores()};
  for (const int cpu : rank.places.cpus) rank.places.cores.push_back(core_of(cpu));
  rank.work = work_of_steps(simulation, mark);
  return rank;
}

Json json_of(const OverRanks& value) { return {{"mean", value.mean}, {"largest", value.largest}}; }

Json phases_json(const RunSummary& run) {
  Json phases = Json::array();
  for (std::size_t i = 0; i < run.phases.size(); ++i) {
    Json phase = {{"name", run.phases[i]}};
    phase.update(json_of(run.phase(i)));
    for (const RankSummary& rank : run.ranks) phase["ranks"].push_back(rank.phases[i]);
    phases.push_back(phase);
  }
  return phases;
}

/// Numbers over the ranks that can be worked out from theirs: for whoever reads the file; not read back.
Json derived_json(const RunSummary& run) {
  const Pinning pinning = run.pinning();
  const ThreadUse use = run.thread_use();
  const auto sum = [&](auto member) { return run.over_ranks([&](const RankSummary& r) { return r.*member; }).sum; };
  return {{"seconds", run.seconds()},
          {"particle_steps_per_second", run.speed()},
          {"waiting", json_of(run.waiting())},
          {"reductions", json_of(run.over_ranks([](const RankSummary& r) { return r.reductions; }))},
          {"parcels", json_of(run.over_ranks([](const RankSummary& r) { return r.parcels; }))},
          {"grain_imbalance", run.grain_imbalance()},
          {"work_imbalance", run.work_imbalance()},
          {"ghosts", sum(&RankSummary::n_ghosts)},
          {"messages_per_step", sum(&RankSummary::n_messages)},
          {"bytes_per_step", sum(&RankSummary::n_bytes)},
          {"migrated", sum(&RankSummary::n_migrated)},
          {"peak_memory", sum(&RankSummary::peak_memory)},
          {"threads", pinning.n_threads},
          {"threads_that_moved", pinning.n_moved},
          {"threads_on_shared_cpus", pinning.n_on_shared_cpus},
          {"threads_on_shared_cores", pinning.n_on_shared_cores},
          {"thread_seconds",
           {{"held", use.held},
            {"working", use.working},
            {"waiting_for_ranks", use.waiting_ranks},
            {"waiting_for_threads", use.waiting_threads}}}};
}

RunSummary summary_of(const Json& json) {
  RunSummary run;
  json.at("scene").at("file").get_to(run.scene_file);
  json.at("scene").at("title").get_to(run.title);
  json.at("program").at("version").get_to(run.version);
  json.at("program").at("commit").get_to(run.commit);
  json.at("machine").at("processor").get_to(run.processor);
  json.at("machine").at("cpus").get_to(run.n_cpus);
  json.at("layout").get_to(run.layout);
  json.at("directory").get_to(run.directory);
  json.at("ended_by_signal").get_to(run.signal);
  json.at("time_step").get_to(run.time_step);
  json.at("time").get_to(run.time);
  json.at("steps").get_to(run.n_steps);
  json.at("warm_up_steps").get_to(run.n_warm_up);
  json.at("particle_steps").get_to(run.particle_steps);
  json.at("grains").at("born").get_to(run.n_born);
  json.at("grains").at("inside").get_to(run.n_grains);
  json.at("grains").at("left").get_to(run.n_left);
  json.at("rebuilds").get_to(run.n_rebuilds);
  json.at("looks").get_to(run.n_looks);
  json.at("cuts").get_to(run.n_cuts);
  json.at("state_hash").get_to(run.hash);
  if (const auto warnings = json.find("warnings"); warnings != json.end()) warnings->get_to(run.warnings);
  if (const auto gas = json.find("gas"); gas != json.end()) run.gas = read<GasTotals>(*gas);
  if (const auto balance = json.find("balance"); balance != json.end()) {
    balance->at("mode").get_to(run.balance_mode);
    run.balance = read<BalanceTotals>(*balance);
  }
  for (const Json& phase : json.at("phases")) run.phases.push_back(phase.at("name"));
  for (const Json& rank : json.at("ranks")) {
    run.ranks.push_back(rank_of(rank));
    if (run.ranks.back().phases.size() != run.phases.size())
      throw std::runtime_error("a rank lacks some of the phases");
  }
  if (run.ranks.empty()) throw std::runtime_error("it has no ranks");
  return run;
}

std::string gas_text(const GasTotals& gas) {
  const auto per_step = [&](std::uint64_t n) {
    return static_cast<double>(n) / static_cast<double>(std::max<std::uint64_t>(gas.n_steps, 1));
  };
  std::string text = fmt::format(
      "gas: {} in {:.3g} parts each, {:.3g} iterations a part; mass imbalance at most {:.1e} of a cell's gas, momentum "
      "to and from grains equal to {:.1e}\n",
      counted(gas.n_steps, "step"), per_step(gas.n_parts),
      static_cast<double>(gas.n_iterations) / static_cast<double>(std::max<std::uint64_t>(gas.n_parts, 1)),
      gas.imbalance, gas.momentum_error);
  text += fmt::format("void fraction: at least {:.3f}", gas.least_void_fraction);
  if (gas.n_floored > 0)
    text += fmt::format("; taken as gas.least_void_fraction in {:.3g} cells a step", per_step(gas.n_floored));
  return text + '\n';
}

std::string thread_text(const ThreadUse& use) {
  if (!(use.held > 0.0)) return {};
  const auto percent = [&](double seconds) { return 100.0 * seconds / use.held; };
  return fmt::format(
      "threads: {:.1f} % of their time at work, {:.1f} % waiting for other ranks, {:.1f} % for each other\n",
      percent(use.working), percent(use.waiting_ranks), percent(use.waiting_threads));
}

std::string balance_text(const RunSummary& run) {
  const BalanceTotals& balance = run.balance;
  if (balance.n_looks == 0) return fmt::format("balance: {}\n", run.balance_mode);
  std::string text = fmt::format(
      "balance: {}; in {} cores changed hands {} and cuts moved {} times; the busiest core had {:.2f} times the mean "
      "work",
      run.balance_mode, counted(balance.n_looks, "look"), balance.n_core_moves, balance.n_cut_moves, balance.imbalance);
  if (balance.n_core_moves > 0)
    text += fmt::format(", with the cores of the start it would have been {:.2f}", balance.imbalance_at_home);
  return text + '\n';
}

/// What the threads of all ranks worked in a phase, of what they could have, while their rank did not wait for others; 0: no such phase.
double share_at_work(const RunSummary& run, const std::string& phase) {
  double working = 0.0, held = 0.0;
  for (const RankSummary& rank : run.ranks)
    for (const NamedWork& row : rank.work) {
      if (row.phase != phase || !(row.work.seconds > 0.0)) continue;
      working += row.work.working;
      held += row.work.held * (1.0 - row.work.waited / row.work.seconds);
    }
  return held > 0.0 ? std::min(1.0, working / held) : 0.0;
}

std::string phase_table(const RunSummary& run) {
  const bool is_alone = run.ranks.size() == 1;
  std::vector<std::pair<std::string, OverRanks>> rows;
  for (std::size_t i = 0; i < run.phases.size(); ++i) rows.emplace_back(run.phases[i], run.phase(i));
  rows.emplace_back("output", run.over_ranks([](const RankSummary& r) { return r.outputs; }));
  rows.emplace_back("start", run.over_ranks([](const RankSummary& r) { return r.start; }));
  double whole = 0.0;
  for (const auto& [name, seconds] : rows) whole += seconds.mean;
  const auto line = [&](const std::string& name, double seconds) {
    return fmt::format("{:<34}{:>12.3f}{:>10.1f}", name, seconds, 100.0 * seconds / whole);
  };
  const bool has_threads = run.pinning().n_threads > static_cast<int>(run.ranks.size());
  std::string text = fmt::format("{:<34}{:>12}{:>10}", "phase", "seconds", "percent");
  text += is_alone ? "" : fmt::format("{:>12}", "largest");
  text += has_threads ? fmt::format("{:>18}\n", "threads at work %") : "\n";
  for (const auto& [name, seconds] : rows) {
    if (seconds.largest <= worth_a_row * whole) continue;
    text += line(name, seconds.mean);
    if (!is_alone) text += fmt::format("{:>12.3f}", seconds.largest);
    const double at_work = has_threads ? share_at_work(run, name) : 0.0;
    text += at_work > 0.0 ? fmt::format("{:>18.1f}\n", 100.0 * at_work) : "\n";
  }
  return text + line("total", whole) + '\n';
}

double imbalance(const OverRanks& value) { return value.mean > 0.0 ? value.largest / value.mean : 1.0; }

}  // namespace

double peak_memory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1024.0 * static_cast<double>(usage.ru_maxrss);
}

RunMark mark_of(const Simulation& simulation, int n_threads) {
  return {simulation.phases(),     simulation.n_rebuilds(),    simulation.n_looks(), simulation.n_cuts(),
          simulation.n_migrated(), cpus_of_threads(n_threads), simulation.work()};
}

OverRanks RunSummary::phase(std::size_t i) const {
  return over_ranks([i](const RankSummary& rank) { return rank.phases[i]; });
}

OverRanks RunSummary::waiting() const {
  return over_ranks([this](const RankSummary& rank) {
    double seconds = 0.0;
    for (std::size_t i = 0; i < phases.size(); ++i)
      if (phases[i].starts_with("waiting")) seconds += rank.phases[i];
    return seconds;
  });
}

double RunSummary::seconds() const {
  return over_ranks([](const RankSummary& rank) { return rank.stepping; }).largest;
}

double RunSummary::speed() const { return seconds() > 0.0 ? particle_steps / seconds() : 0.0; }

double RunSummary::grain_imbalance() const {
  return imbalance(over_ranks([](const RankSummary& rank) { return rank.n_grains; }));
}

double RunSummary::work_imbalance() const {
  return imbalance(over_ranks([](const RankSummary& rank) { return rank.n_pairs + 4 * rank.n_grains; }));
}

Pinning RunSummary::pinning() const {
  std::vector<ThreadPlaces> places;
  for (const RankSummary& rank : ranks) places.push_back(rank.places);
  return pinning_of(places);
}

ThreadUse RunSummary::thread_use() const {
  ThreadUse use;
  for (const RankSummary& rank : ranks)
    for (const NamedWork& row : rank.work) {
      const PhaseWork& work = row.work;
      use.held += work.held;
      use.working += work.working;
      if (work.seconds > 0.0) use.waiting_ranks += work.waited * work.held / work.seconds;
    }
  use.waiting_threads = std::max(use.held - use.working - use.waiting_ranks, 0.0);
  return use;
}

RunSummary summarize(const Simulation& simulation, const RunTimes& times, const RunMark& mark) {
  RunSummary run;
  run.hash = simulation.state_hash().text();  // first: it wants the pair list, which a checkpoint sets aside
  const std::vector<PhaseTime> phases = phases_of_steps(simulation, times, mark);
  const std::string own = rank_json(this_rank(simulation, times, mark, phases)).dump();
  for (const std::string& text : simulation.world().gather_at_root(own))
    run.ranks.push_back(rank_of(Json::parse(text)));
  for (const PhaseTime& phase : phases) run.phases.push_back(phase.name);
  run.title = simulation.scene().title;
  run.version = program_version();
  run.commit = program_commit();
  run.processor = processor_name();
  run.n_cpus = static_cast<int>(sysconf(_SC_NPROCESSORS_ONLN));
  run.time_step = simulation.time_step();
  run.time = simulation.time();
  run.n_steps = times.n_steps;
  run.n_warm_up = times.n_warm_up;
  run.particle_steps = times.particle_steps;
  run.n_born = simulation.n_born();
  run.n_grains = simulation.n_grains();
  run.n_left = simulation.n_left();
  run.balance_mode = word_for(simulation.scene().run.balance);
  run.balance = simulation.balance();
  run.warnings = simulation.step_warnings();
  run.gas = simulation.gas_totals();
  run.n_rebuilds = simulation.n_rebuilds() - mark.n_rebuilds;
  run.n_looks = simulation.n_looks() - mark.n_looks;
  run.n_cuts = simulation.n_cuts() - mark.n_cuts;
  return run;
}

std::string summary_text(const RunSummary& run) {
  std::string text = phase_table(run);
  text += fmt::format("{} of {:.6g} s to {:.6g} s simulated, layout {}, {}\n", counted(run.n_steps, "step"),
                      run.time_step, run.time, run.layout, counted(run.n_rebuilds, "rebuild"));
  if (run.n_warm_up > 0) text += fmt::format("warm-up: {} before them, not counted\n", counted(run.n_warm_up, "step"));
  if (run.speed() > 0.0) text += fmt::format("speed: {:.2f} M particle-steps/s\n", 1e-6 * run.speed());
  text += fmt::format("grains: {} born, {} inside, {} left\n", run.n_born, run.n_grains, run.n_left);
  if (run.gas) text += gas_text(*run.gas);
  text += thread_text(run.thread_use());
  if (run.ranks.size() > 1) text += balance_text(run);
  for (const std::string& warning : run.warnings) text += "warning: " + warning + '\n';
  const double held = run.over_ranks([](const RankSummary& rank) { return rank.memory; }).sum;
  const double peak = run.over_ranks([](const RankSummary& rank) { return rank.peak_memory; }).sum;
  text += fmt::format("memory: {} in grains, pairs and contacts{}; peak memory: {}", bytes_text(held),
                      run.gas ? ", gas" : "", bytes_text(peak));
  if (run.n_born > 0) text += fmt::format(" ({:.0f} bytes a grain)", peak / static_cast<double>(run.n_born));
  text += '\n';
  text += fmt::format("results: {}\n", run.directory);
  return text + "state hash: " + run.hash;
}

std::string summary_json(const RunSummary& run) {
  Json json = {{"format", json_format},
               {"scene", {{"file", run.scene_file}, {"title", run.title}}},
               {"program", {{"version", run.version}, {"commit", run.commit}}},
               {"machine", {{"processor", run.processor}, {"cpus", run.n_cpus}}},
               {"layout", run.layout},
               {"directory", run.directory},
               {"ended_by_signal", run.signal},
               {"time_step", run.time_step},
               {"time", run.time},
               {"steps", run.n_steps},
               {"warm_up_steps", run.n_warm_up},
               {"particle_steps", run.particle_steps}};
  json.update(derived_json(run));
  json.update({{"grains", {{"born", run.n_born}, {"inside", run.n_grains}, {"left", run.n_left}}},
               {"rebuilds", run.n_rebuilds},
               {"looks", run.n_looks},
               {"cuts", run.n_cuts},
               {"balance", balance_json(run)},
               {"phases", phases_json(run)},
               {"state_hash", run.hash}});
  if (!run.warnings.empty()) json["warnings"] = run.warnings;
  if (run.gas) json["gas"] = json_of(*run.gas);
  for (const RankSummary& rank : run.ranks) json["ranks"].push_back(rank_json(rank));
  // Names of files need not be UTF-8.
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + '\n';
}

RunSummary read_summary(const std::filesystem::path& file) {
  const std::string text = read_file(file);
  try {
    const Json json = Json::parse(text);
    if (json.at("format") != json_format) throw std::runtime_error("it is of another version of this program");
    return summary_of(json);
  } catch (const std::exception& error) {
    throw StorageError(file, std::string("is not the summary of a run: ") + error.what());
  }
}

}  // namespace moraine
