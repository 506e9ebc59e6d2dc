#include "io/cli/scale_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "io/checkpoint/durable_file.hpp"
#include "io/cli/report_text.hpp"
#include "io/cli/table_file.hpp"
#include "io/cli/text.hpp"

namespace moraine {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

namespace {

constexpr double worth_a_row = 0.005;           // share of a phase on some layout
constexpr std::size_t layouts_in_a_table = 10;  // of phases: those that fit beside each other

std::string whole(double value) { return count_text(static_cast<std::uint64_t>(std::llround(value))); }
std::string seconds_text(double seconds) {
  return seconds < 0.01 ? fmt::format("{:.3g}", seconds) : fmt::format("{:.3f}", seconds);
}

std::string layout_table(const ScaleResults& results) {
  std::vector<std::vector<std::string>> rows = {{"layout", "cores", "grains", "median", "least", "M p-steps/s",
                                                 "speed-up", "efficiency", "waiting", "imbalance", "ghosts", "messages",
                                                 "bytes"}};
  for (const LayoutResult& r : results.layouts)
    rows.push_back({r.layout.text(), std::to_string(r.layout.total()), whole(r.n_grains), seconds_text(r.median) + " s",
                    seconds_text(r.least) + " s", fmt::format("{:.2f}", 1e-6 * r.speed),
                    fmt::format("{:.2f}", r.speed_up), percent_text(r.efficiency), percent_text(r.waiting),
                    fmt::format("{:.3f}", r.work_imbalance), whole(r.n_ghosts), fmt::format("{:.4g}", r.n_messages),
                    bytes_text(r.n_bytes)});
  for (const ProjectedResult& p : results.projected)
    rows.push_back({"projected", std::to_string(p.ranks), count_text(static_cast<std::uint64_t>(p.n_grains)),
                    seconds_text(p.step * static_cast<double>(results.steps)) + " s", "",
                    fmt::format("{:.2f}", 1e-6 * static_cast<double>(p.n_grains) / p.step),
                    fmt::format("{:.2f}", p.speed_up), percent_text(p.efficiency), percent_text(p.waiting),
                    fmt::format("{:.3f}", p.imbalance), "", "", ""});
  return aligned_table(rows);
}

/// The phases that take some time on some layout, in the order of a step.
std::vector<std::string> phases_worth_a_row(const ScaleResults& results) {
  std::vector<std::string> names;
  for (const LayoutResult& result : results.layouts)
    for (const PhaseShare& phase : result.phases)
      if (phase.share > worth_a_row && std::find(names.begin(), names.end(), phase.name) == names.end())
        names.push_back(phase.name);
  return names;
}

double share_of(const LayoutResult& result, const std::string& name) {
  for (const PhaseShare& phase : result.phases)
    if (phase.name == name) return phase.share;
  return 0.0;
}

std::string phase_table(const ScaleResults& results) {
  std::string text;
  const std::vector<std::string> names = phases_worth_a_row(results);
  for (std::size_t from = 0; from < results.layouts.size(); from += layouts_in_a_table) {
    const std::size_t to = std::min(from + layouts_in_a_table, results.layouts.size());
    std::vector<std::vector<std::string>> rows = {{"percent of the steps"}};
    for (std::size_t i = from; i < to; ++i) rows[0].push_back(results.layouts[i].layout.text());
    for (const std::string& name : names) {
      rows.push_back({name});
      for (std::size_t i = from; i < to; ++i)
        rows.back().push_back(fmt::format("{:.1f}", 100.0 * share_of(results.layouts[i], name)));
    }
    const auto add_inside = [&](const char* name, double LayoutResult::*share) {
      const bool is_there = std::any_of(results.layouts.begin(), results.layouts.end(),
                                        [&](const LayoutResult& r) { return r.*share > worth_a_row; });
      if (!is_there) return;
      rows.push_back({name});
      for (std::size_t i = from; i < to; ++i)
        rows.back().push_back(fmt::format("{:.1f}", 100.0 * results.layouts[i].*share));
    };
    add_inside("of these: reductions", &LayoutResult::reductions);
    add_inside("of these: migration, new ghosts", &LayoutResult::parcels);
    text += '\n' + aligned_table(rows);
  }
  return text;
}

std::string pinning_text(const ScaleResults& results) {
  std::string shared, moved;
  const auto add = [](std::string& list, const LayoutResult& result, int n) {
    list += fmt::format("{}{} ({} of {})", list.empty() ? "" : ", ", result.layout.text(), n, result.pinning.n_threads);
  };
  for (const LayoutResult& result : results.layouts) {
    const Pinning& pinning = result.pinning;
    if (pinning.n_on_shared_cores > 0) add(shared, result, pinning.n_on_shared_cores);
    if (pinning.n_moved > 0) add(moved, result, pinning.n_moved);
  }
  std::string text =
      shared.empty() ? "every thread had a core of its own" : "threads that shared a core with another: " + shared;
  return text + (moved.empty() ? "; none changed its CPU" : "; changed their CPU meanwhile: " + moved) + '\n';
}

std::string best_text(const ScaleResults& results) {
  const auto line = [&](const std::string& title, const LayoutResult& r) {
    return fmt::format("{}: {}, {:.2f} M particle-steps/s, speed-up {:.2f}, efficiency {}\n", title, r.layout.text(),
                       1e-6 * r.speed, r.speed_up, percent_text(r.efficiency));
  };
  std::set<long long> counts;
  for (const LayoutResult& result : results.layouts) counts.insert(result.layout.total());
  std::string text;
  if (counts.size() > 1)
    for (const long long n : counts)
      text += line("best on " + counted(static_cast<std::uint64_t>(n), "core"),
                   results.layouts[best_layout(results.layouts, n)]);
  return text + line("best layout", results.layouts[best_layout(results.layouts)]);
}

std::string legend(const ScaleResults& results) {
  const LayoutResult& first = results.layouts[0];
  const long long fewest = first.layout.total();
  std::string text = fmt::format(
      "Times are of {} after a warm-up of {}, median and least of {}. Speed-up and efficiency are by the speed of the "
      "median,\n"
      "against layout {}. Imbalance is the largest work of a rank (pairs + 4 grains) over the mean. Ghosts, messages "
      "and "
      "bytes\n"
      "are of all ranks, the latter two of a step.",
      counted(results.steps, "step"), counted(results.warm_up, "step"),
      counted(static_cast<std::uint64_t>(first.n_runs), "run"),
      results.layouts[best_layout(results.layouts, fewest)].layout.text());
  if (results.kind == ScaleKind::weak) text += " The scene grows with the number of cores.";
  if (!results.projected.empty())
    text +=
        "\nProjected rows are not measured: ranks of one thread, against one rank, by the model of moraine project.";
  return text + '\n';
}

Json json_of(const LayoutResult& r) {
  Json json = {{"layout", r.layout.text()},
               {"ranks", r.layout.ranks},
               {"threads", r.layout.threads},
               {"cores", r.layout.total()},
               {"runs", r.n_runs},
               {"grains", r.n_grains},
               {"median_seconds", r.median},
               {"least_seconds", r.least},
               {"particle_steps_per_second", r.speed},
               {"speed_up", r.speed_up},
               {"efficiency", r.efficiency},
               {"waiting_share", r.waiting},
               {"reduction_share", r.reductions},
               {"parcel_share", r.parcels},
               {"grain_imbalance", r.grain_imbalance},
               {"work_imbalance", r.work_imbalance},
               {"ghosts", r.n_ghosts},
               {"messages_per_step", r.n_messages},
               {"bytes_per_step", r.n_bytes},
               {"migrated", r.n_migrated},
               {"rebuilds", r.n_rebuilds},
               {"cuts", r.n_cuts},
               {"peak_memory", r.peak_memory},
               {"threads_that_moved", r.pinning.n_moved},
               {"threads_on_shared_cpus", r.pinning.n_on_shared_cpus},
               {"threads_on_shared_cores", r.pinning.n_on_shared_cores},
               {"state_hashes", r.hashes}};
  for (const PhaseShare& phase : r.phases) json["phase_shares"][phase.name] = phase.share;
  return json;
}

Json json_of(const ProjectedResult& p) {
  return {{"ranks", p.ranks},
          {"grains", p.n_grains},
          {"step_seconds", p.step},
          {"speed_up", p.speed_up},
          {"efficiency", p.efficiency},
          {"work_imbalance", p.imbalance},
          {"message_share", p.messages},
          {"waiting_share", p.waiting}};
}

/// Points of one kind of layout, for gnuplot.
std::string data_block(const std::string& name, const ScaleResults& results, bool (*belongs)(const Layout&)) {
  std::string text = '$' + name + " << EOD\n";
  for (const LayoutResult& r : results.layouts)
    if (belongs(r.layout))
      text += fmt::format("{} {} {} {}\n", r.layout.total(), r.speed_up, 100.0 * r.efficiency, r.layout.text());
  return text + "EOD\n";
}

struct Series {
  const char* name;
  const char* title;
  const char* style;
  bool (*belongs)(const Layout&);
};
const Series series[] = {
    {"one", "one core", "points pt 7 ps 1.2 lc rgb '#222222'", [](const Layout& l) { return l.total() == 1; }},
    {"threads", "threads only", "linespoints pt 5 lc rgb '#1f77b4'",
     [](const Layout& l) { return l.ranks == 1 && l.threads > 1; }},
    {"ranks", "ranks only", "linespoints pt 9 lc rgb '#d62728'",
     [](const Layout& l) { return l.threads == 1 && l.ranks > 1; }},
    {"mixed", "ranks of several threads", "points pt 13 ps 1.2 lc rgb '#2ca02c'",
     [](const Layout& l) { return l.ranks > 1 && l.threads > 1; }}};

/// One `plot` of column `column` over the number of cores.
std::string plot_command(const ScaleResults& results, int column, const std::string& ideal) {
  std::string text = "plot " + ideal;
  for (const Series& one : series) {
    const bool is_there = std::any_of(results.layouts.begin(), results.layouts.end(),
                                      [&](const LayoutResult& r) { return one.belongs(r.layout); });
    if (is_there)
      text += fmt::format(", \\\n    ${} using 1:{} with {} title '{}'", one.name, column, one.style, one.title);
  }
  if (!results.projected.empty())
    text += fmt::format(
        ", \\\n    $projected using 1:{} with linespoints pt 6 dt 2 lc rgb '#7f7f7f' title 'projected, not measured'",
        column);
  return text + '\n';
}

std::string phase_plot(const ScaleResults& results) {
  const std::vector<std::string> names = phases_worth_a_row(results);
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i)
    text += fmt::format("{}$phases using {}:xtic(1) title {}", i == 0 ? "plot " : ", \\\n    ", i + 2,
                        quoted_gnuplot(names[i]));
  return text + '\n';
}

std::string phase_data(const ScaleResults& results) {
  const std::vector<std::string> names = phases_worth_a_row(results);
  std::string text = "$phases << EOD\n";
  for (const LayoutResult& result : results.layouts) {
    text += result.layout.text();
    for (const std::string& name : names) text += fmt::format(" {}", 100.0 * share_of(result, name));
    text += '\n';
  }
  return text + "EOD\n";
}

}  // namespace

std::string scale_table(const ScaleResults& results) {
  return layout_table(results) + phase_table(results) + '\n' + legend(results) + pinning_text(results) +
         best_text(results);
}

std::string scale_csv(const ScaleResults& results) {
  const std::vector<std::string> names = phases_worth_a_row(results);
  std::vector<std::string> columns = {"kind",
                                      "layout",
                                      "ranks",
                                      "threads",
                                      "cores",
                                      "runs",
                                      "grains",
                                      "median [s]",
                                      "least [s]",
                                      "particle-steps/s",
                                      "speed-up",
                                      "efficiency",
                                      "waiting share",
                                      "grain imbalance",
                                      "work imbalance",
                                      "ghosts",
                                      "messages/step",
                                      "bytes/step",
                                      "migrated",
                                      "rebuilds",
                                      "cuts",
                                      "peak memory [bytes]",
                                      "threads on shared cores",
                                      "threads that moved",
                                      "share of reductions (in phases)",
                                      "share of migration and new ghosts (in phases)"};
  for (const std::string& name : names) columns.push_back("share of " + name);
  std::string text = csv_line(columns);
  for (const LayoutResult& r : results.layouts) {
    std::vector<std::string> row = {"measured", r.layout.text()};
    for (const double value : {1.0 * r.layout.ranks,
                               1.0 * r.layout.threads,
                               1.0 * static_cast<double>(r.layout.total()),
                               1.0 * r.n_runs,
                               r.n_grains,
                               r.median,
                               r.least,
                               r.speed,
                               r.speed_up,
                               r.efficiency,
                               r.waiting,
                               r.grain_imbalance,
                               r.work_imbalance,
                               r.n_ghosts,
                               r.n_messages,
                               r.n_bytes,
                               r.n_migrated,
                               r.n_rebuilds,
                               r.n_cuts,
                               r.peak_memory,
                               1.0 * r.pinning.n_on_shared_cores,
                               1.0 * r.pinning.n_moved,
                               r.reductions,
                               r.parcels})
      row.push_back(number_text(value));
    for (const std::string& name : names) row.push_back(number_text(share_of(r, name)));
    text += csv_line(row);
  }
  for (const ProjectedResult& p : results.projected) {
    std::vector<std::string> row(columns.size());
    const auto set = [&](const std::string& column, const std::string& value) {
      row[static_cast<std::size_t>(std::find(columns.begin(), columns.end(), column) - columns.begin())] = value;
    };
    set("kind", "projected");
    set("layout", std::to_string(p.ranks) + "x1");
    set("ranks", std::to_string(p.ranks));
    set("threads", "1");
    set("cores", std::to_string(p.ranks));
    set("grains", std::to_string(p.n_grains));
    set("median [s]", number_text(p.step * static_cast<double>(results.steps)));
    set("particle-steps/s", number_text(static_cast<double>(p.n_grains) / p.step));
    set("speed-up", number_text(p.speed_up));
    set("efficiency", number_text(p.efficiency));
    set("waiting share", number_text(p.waiting));
    set("work imbalance", number_text(p.imbalance));
    text += csv_line(row);
  }
  return text;
}

std::string scale_json(const ScaleResults& results) {
  Json json = {{"kind", word_for(results.kind)},
               {"scene", {{"file", results.scene_file}, {"title", results.title}}},
               {"program", {{"version", results.version}, {"commit", results.commit}}},
               {"command", results.command},
               {"machine", results.machine},
               {"steps", results.steps},
               {"warm_up_steps", results.warm_up},
               {"best_layout", results.layouts[best_layout(results.layouts)].layout.text()},
               {"is_same_state", hash_fault(results).empty()},
               {"layouts", Json::array()},
               {"projected", Json::array()}};
  for (const LayoutResult& result : results.layouts) json["layouts"].push_back(json_of(result));
  for (const ProjectedResult& result : results.projected) json["projected"].push_back(json_of(result));
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + '\n';
}

std::string scale_gnuplot(const ScaleResults& results) {
  std::string text = "# gnuplot scale.gnuplot writes scale.svg and scale.png.\n";
  for (const Series& one : series) text += data_block(one.name, results, one.belongs);
  text += "$projected << EOD\n";
  for (const ProjectedResult& p : results.projected)
    text += fmt::format("{} {} {}\n", p.ranks, p.speed_up, 100.0 * p.efficiency);
  text += "EOD\n" + phase_data(results);
  long long most = 1;
  for (const LayoutResult& result : results.layouts) most = std::max(most, result.layout.total());
  for (const ProjectedResult& p : results.projected) most = std::max<long long>(most, p.ranks);
  const std::string heading = fmt::format("{} scaling of {}; {}", word_for(results.kind),
                                          results.title.empty() ? results.scene_file : results.title, results.machine);
  text += "do for [format in 'svg png'] {\n";
  text +=
      "if (format eq 'svg') { set terminal svg size 1200,1000 dynamic font 'Sans,13' background rgb 'white' } "
      "else { set terminal pngcairo size 1200,1000 font 'Sans,11' }\n";
  text += "set output 'scale.'.format\n";
  text += fmt::format("set multiplot layout 2,2 title {} noenhanced\n", quoted_gnuplot(heading));
  text += fmt::format(
      "set grid; set key left top Left reverse; set logscale x 2; set xrange [0.8:{}]; set xlabel 'cores'\n",
      1.25 * static_cast<double>(most));
  text +=
      fmt::format("set logscale y 2; set yrange [0.5:{}]; set ylabel 'speed-up'\n", 1.25 * static_cast<double>(most));
  text += plot_command(results, 2, "x with lines lc rgb '#cccccc' title 'ideal'");
  text += "unset logscale y; set yrange [0:*]; set ylabel 'efficiency [%]'; unset key\n";
  text += plot_command(results, 3, "100 with lines lc rgb '#cccccc' title 'ideal'");
  text += "set size 1,0.5; set origin 0,0; unset logscale x; set xrange [*:*]; set yrange [0:100]\n";
  text += "set style data histograms; set style histogram rowstacked; set style fill solid 0.8 border -1\n";
  text +=
      "set boxwidth 0.7; set key outside right top noenhanced; set xlabel 'layout'; set ylabel 'share of the steps "
      "[%]'\n";
  text += phase_plot(results);
  return text + "unset multiplot\nset output\nreset\n}\n";
}

std::string write_scale_report(const ScaleResults& results, const fs::path& directory) {
  write_file(directory / "scale.csv", scale_csv(results));
  write_file(directory / "scale.json", scale_json(results));
  write_file(directory / "scale.gnuplot", scale_gnuplot(results));
  const std::string tables = (directory / "scale.csv").string() + ", scale.json";
  return fmt::format("results: {}; {}", tables, draw_plot(directory, "scale"));
}

}  // namespace moraine
