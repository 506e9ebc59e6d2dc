#include "io/cli/pareto_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "io/checkpoint/durable_file.hpp"
#include "io/cli/report_text.hpp"
#include "io/cli/table_file.hpp"
#include "io/cli/text.hpp"

namespace moraine {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

namespace {

std::string percentage(double share) { return fmt::format("{:.3g} %", 100.0 * share); }

std::string seconds_text(double seconds) {
  return seconds < 100.0 ? fmt::format("{:.3g} s", seconds) : duration_text(seconds);
}

std::string mark_of(const ParetoResults& results, std::size_t i) {
  if (results.recommended == i) return "recommended";
  const ParetoStanding standing = results.results[i].standing;
  return standing == ParetoStanding::front ? "front" : standing == ParetoStanding::open ? "front?" : "";
}

std::vector<std::string> row_of(const ParetoResults& results, std::size_t i) {
  const ParetoResult& r = results.results[i];
  std::vector<std::string> row = {r.setting.name, fmt::format("{:.4g} s", r.setting.time_step),
                                  fmt::format("{:.1f}", r.setting.steps_per_contact)};
  if (!r.is_good()) {
    row.insert(row.end(), {"", "", "stopped", "", "", ""});
    return row;
  }
  row.insert(row.end(), {fmt::format("{:.3g}", 1e-6 * r.speed), seconds_text(r.seconds)});
  if (r.setting.kind == ParetoKind::reference) {
    row.insert(row.end(), {"reference", "", "", ""});
    return row;
  }
  const ParetoError& worst = r.worst();
  row.insert(row.end(), {percentage(std::abs(worst.value)), worst.half_width ? percentage(*worst.half_width) : "",
                         worst.quantity, mark_of(results, i)});
  return row;
}

std::string legend(const ParetoResults& results) {
  std::string text = fmt::format("Times are those of stepping to the scene's end, {:g} s, on layout {}",
                                 results.scene_end, results.layout);
  if (results.end < results.scene_end) text += fmt::format(", worked out from runs to {:g} s", results.end);
  if (results.repeats > 1) text += fmt::format(", medians of up to {} runs", results.repeats);
  text += ".\n";
  if (results.measure == ParetoMeasure::statistics)
    text += fmt::format(
        "Errors are those of averages over time from {:g} s on against the reference, relative to its mean (or its "
        "deviation over time\nwhere that is larger), the largest of the statistics; +- is a 95 % confidence interval "
        "from runs with other seeds.\n",
        results.from);
  else
    text +=
        "Errors are root mean squares over all grains and the run: distance from the reference's paths in mean "
        "diameters, or difference\nof a probe's rows over their size; the largest of them.\n";
  if (results.repeats > 1)
    text +=
        "front: all that may be as fast are less accurate; front?: may be on it, as intervals of errors or times "
        "overlap; no mark: another is\nknown to be at least as fast and as accurate.\n";
  return text;
}

std::string failures(const ParetoResults& results) {
  std::string text;
  for (const ParetoResult& result : results.results)
    if (!result.is_good()) text += fmt::format("stopped: {}: {}\n", result.setting.name, result.failure);
  return text;
}

Json json_of(const ParetoResults& results, std::size_t i) {
  const ParetoResult& r = results.results[i];
  Json json = {{"name", r.setting.name},
               {"kind", word_for(r.setting.kind)},
               {"overrides", r.setting.overrides},
               {"time_step", r.setting.time_step},
               {"steps_per_contact", r.setting.steps_per_contact},
               {"runs", r.n_runs},
               {"state_hashes", r.hashes}};
  if (!r.is_good()) {
    json["failure"] = r.failure;
    return json;
  }
  json["particle_steps_per_second"] = r.speed;
  json["seconds_to_end"] = r.seconds;
  json["standing"] = word_for(r.standing);
  json["is_recommended"] = results.recommended == i;
  json["errors"] = Json::array();
  for (const ParetoError& error : r.errors) {
    Json one = {{"quantity", error.quantity}, {"error", error.value}, {"relative_to", error.reference}};
    if (error.half_width) one["half_width"] = *error.half_width;
    json["errors"].push_back(one);
  }
  return json;
}

/// What a logarithmic axis can show.
double shown(double error) { return std::max(std::abs(error), 1e-16); }

/// A text as one entry of a line of data.
std::string label_of(std::string name) {
  std::replace(name.begin(), name.end(), '"', '\'');
  return '"' + name + '"';
}

std::string point(const ParetoResult& r, double half_width) {
  const double error = shown(r.worst().value);
  return fmt::format("{} {} {} {} {}\n", r.seconds, error, std::max(error - half_width, 0.1 * error),
                     error + half_width, label_of(r.setting.name));
}

struct Series {
  ParetoKind kind;
  const char* name;
  const char* style;
};
constexpr Series series[] = {{ParetoKind::time_step, "time_step", "pt 7 ps 1.1 lc rgb '#1f77b4'"},
                             {ParetoKind::scene, "as_it_is", "pt 13 ps 1.7 lc rgb '#222222'"},
                             {ParetoKind::skin, "skin", "pt 5 ps 1 lc rgb '#8c564b'"},
                             {ParetoKind::precision, "precision", "pt 9 ps 1.3 lc rgb '#d62728'"},
                             {ParetoKind::gas_step, "gas_step", "pt 11 ps 1.2 lc rgb '#2ca02c'"},
                             {ParetoKind::gas_tolerance, "gas_tolerance", "pt 4 ps 1.1 lc rgb '#17becf'"},
                             {ParetoKind::variant, "variant", "pt 3 ps 1.3 lc rgb '#9467bd'"},
                             {ParetoKind::product, "combined", "pt 6 ps 1 lc rgb '#7f7f7f'"}};

std::string data_of(const ParetoResults& results, const Series& one) {
  std::string text;
  for (const ParetoResult& r : results.results)
    if (r.is_good() && r.setting.kind == one.kind && !r.errors.empty())
      text += point(r, r.worst().half_width.value_or(0.0));
  return text;
}

/// The corner points of the front, from the fastest to the most accurate: what is known to be within the error for the time.
std::string front_data(const ParetoResults& results) {
  std::vector<const ParetoResult*> by_time;
  for (const ParetoResult& r : results.results)
    if (r.is_good() && r.setting.kind != ParetoKind::reference && !r.errors.empty()) by_time.push_back(&r);
  std::sort(by_time.begin(), by_time.end(), [](const auto* a, const auto* b) { return a->seconds < b->seconds; });
  std::string text;
  double least = std::numeric_limits<double>::infinity();
  for (const ParetoResult* r : by_time) {
    if (!(r->worst().bound() < least)) continue;
    least = r->worst().bound();
    text += fmt::format("{} {}\n", r->seconds, shown(least));
  }
  return text;
}

std::string heading(const ParetoResults& results) {
  return fmt::format("Speed against error: {}; layout {}, {}",
                     results.title.empty() ? results.scene_file : results.title, results.layout, results.machine);
}

}  // namespace

std::string pareto_table(const ParetoResults& results) {
  std::vector<std::vector<std::string>> rows = {
      {"setting", "time step", "steps/contact", "M p-steps/s", "time to end", "error", "+-", "of", ""}};
  for (std::size_t i = 0; i < results.results.size(); ++i) rows.push_back(row_of(results, i));
  std::string text = aligned_table(rows) + '\n' + failures(results) + legend(results);
  for (const std::string& remark : results.remarks) text += remark + '\n';
  return text + "recommended: " + results.advice + '\n';
}

std::string pareto_csv(const ParetoResults& results) {
  std::vector<std::string> head = {
      "setting",         "kind",  "time step [s]", "steps per contact", "runs",     "particle-steps/s",
      "time to end [s]", "error", "half width",    "quantity",          "on front", "recommended",
      "failure"};
  const auto with_errors = std::find_if(results.results.begin(), results.results.end(),
                                        [](const ParetoResult& r) { return !r.errors.empty(); });
  std::size_t n_quantities = 0;
  if (with_errors != results.results.end())
    for (const ParetoError& error : with_errors->errors) {
      head.push_back("error of " + error.quantity);
      head.push_back("half width of " + error.quantity);
      ++n_quantities;
    }
  std::string text = csv_line(head);
  for (std::size_t i = 0; i < results.results.size(); ++i) {
    const ParetoResult& r = results.results[i];
    std::vector<std::string> row = {r.setting.name,
                                    word_for(r.setting.kind),
                                    number_text(r.setting.time_step),
                                    number_text(r.setting.steps_per_contact),
                                    std::to_string(r.n_runs),
                                    r.is_good() ? number_text(r.speed) : "",
                                    r.is_good() ? number_text(r.seconds) : ""};
    const bool has_errors = !r.errors.empty();
    const auto width = [](const ParetoError& error) { return error.half_width ? number_text(*error.half_width) : ""; };
    row.push_back(has_errors ? number_text(r.worst().value) : "");
    row.push_back(has_errors ? width(r.worst()) : "");
    row.push_back(has_errors ? r.worst().quantity : "");
    row.push_back(r.standing == ParetoStanding::beaten ? "no" : r.standing == ParetoStanding::open ? "open" : "yes");
    row.push_back(results.recommended == i ? "yes" : "no");
    row.push_back(r.failure);
    for (std::size_t k = 0; k < n_quantities; ++k) {
      row.push_back(has_errors ? number_text(r.errors[k].value) : "");
      row.push_back(has_errors ? width(r.errors[k]) : "");
    }
    text += csv_line(row);
  }
  return text;
}

std::string pareto_json(const ParetoResults& results) {
  Json json = {{"kind", "pareto"},
               {"scene", {{"file", results.scene_file}, {"title", results.title}}},
               {"program", {{"version", results.version}, {"commit", results.commit}}},
               {"command", results.command},
               {"machine", results.machine},
               {"layout", results.layout},
               {"compared_by", results.measure == ParetoMeasure::statistics ? "statistics" : "paths"},
               {"end", results.end},
               {"from", results.from},
               {"scene_end", results.scene_end},
               {"repeats", results.repeats},
               {"accept", results.accept},
               {"is_chaotic", results.is_chaotic},
               {"advice", results.advice},
               {"remarks", results.remarks},
               {"settings", Json::array()}};
  for (std::size_t i = 0; i < results.results.size(); ++i) json["settings"].push_back(json_of(results, i));
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + '\n';
}

std::string pareto_gnuplot(const ParetoResults& results) {
  std::string text = "# gnuplot pareto.gnuplot writes pareto.svg and pareto.png.\n";
  std::string plots;
  const auto add = [&](const std::string& plot) { plots += (plots.empty() ? "plot " : ", \\\n    ") + plot; };
  if (const std::string data = front_data(results); !data.empty()) {
    text += "$front << EOD\n" + data + "EOD\n";
    add("$front using 1:2 with steps lw 2 lc rgb '#ff7f0e' title 'efficient front, intervals included'");
  }
  for (const Series& one : series) {
    const std::string data = data_of(results, one);
    if (data.empty()) continue;
    text += fmt::format("${} << EOD\n{}EOD\n", one.name, data);
    std::string title = one.name;
    std::replace(title.begin(), title.end(), '_', ' ');
    if (results.measure == ParetoMeasure::statistics)
      add(fmt::format("${} using 1:2:3:4 with yerrorbars {} notitle", one.name, one.style));
    add(fmt::format("${} using 1:2 with points {} title '{}'", one.name, one.style, title));
    add(fmt::format("${} using 1:2:5 with labels left offset 0.8,0.5 font ',9' noenhanced notitle", one.name));
  }
  if (results.recommended) {
    const ParetoResult& best = results.results[*results.recommended];
    text += fmt::format("$recommended << EOD\n{} {}\nEOD\n", best.seconds, shown(best.worst().value));
    add("$recommended using 1:2 with points pt 6 ps 3 lw 2.5 lc rgb '#ff7f0e' title 'recommended'");
  }
  text += fmt::format("accept = {}\n", results.accept);
  if (!plots.empty()) add("accept with lines dt 2 lc rgb '#999999' title 'acceptable'");
  text += "do for [format in 'svg png'] {\n";
  text +=
      "if (format eq 'svg') { set terminal svg size 1000,700 dynamic font 'Sans,13' background rgb 'white' } "
      "else { set terminal pngcairo size 1000,700 font 'Sans,11' }\n";
  text += "set output 'pareto.'.format\n";
  text += fmt::format("set title {} noenhanced\n", quoted_gnuplot(heading(results)));
  text +=
      "set logscale xy; set grid; set offsets graph 0.05, graph 0.25, graph 0.05, graph 0.05; set format y '%.0e'\n"
      "set key outside bottom center horizontal; set bmargin 7; set xlabel 'time to the end of the scene [s]'; "
      "set ylabel 'error [-]'\n";
  text += plots + '\n';
  return text + "set output\nreset\n}\n";
}

std::string write_pareto_report(const ParetoResults& results, const fs::path& directory) {
  write_file(directory / "pareto.csv", pareto_csv(results));
  write_file(directory / "pareto.json", pareto_json(results));
  write_file(directory / "pareto.gnuplot", pareto_gnuplot(results));
  std::string text = fmt::format("results: {}, pareto.json", (directory / "pareto.csv").string());
  const bool has_points = std::any_of(results.results.begin(), results.results.end(), [](const ParetoResult& r) {
    return r.setting.kind != ParetoKind::reference && !r.errors.empty();
  });
  return has_points ? text + "; " + draw_plot(directory, "pareto") : text;
}

}  // namespace moraine
