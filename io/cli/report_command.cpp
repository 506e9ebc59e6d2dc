#include "io/cli/report_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "io/checkpoint/durable_file.hpp"
#include "io/cli/child.hpp"
#include "io/cli/html.hpp"
#include "io/cli/layout.hpp"
#include "io/cli/programs.hpp"
#include "io/cli/report_text.hpp"
#include "io/cli/summary.hpp"
#include "io/cli/text.hpp"

namespace moraine {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

namespace {

Json read_json(const fs::path& file) {
  try {
    return Json::parse(read_file(file));
  } catch (const Json::exception& error) {
    throw StorageError(file, std::string("cannot be read: ") + error.what());
  }
}

std::string text_if_there(const fs::path& file) { return fs::exists(file) ? read_file(file) : std::string(); }

/// When a file was written, as the machine's clock has it.
std::string date_of(const fs::path& file) {
  const auto since = fs::last_write_time(file) - fs::file_time_type::clock::now() + std::chrono::system_clock::now();
  const std::time_t time =
      std::chrono::system_clock::to_time_t(std::chrono::time_point_cast<std::chrono::system_clock::duration>(since));
  char text[32];
  std::tm parts{};
  localtime_r(&time, &parts);
  return std::strftime(text, sizeof text, "%Y-%m-%d %H:%M", &parts) > 0 ? text : "";
}

std::string percentage(double share) { return fmt::format("{:.3g} %", 100.0 * share); }
std::string whole(double number) { return count_text(static_cast<std::uint64_t>(std::llround(number))); }

void add_plot(HtmlPage& page, const fs::path& svg, const std::string& caption) {
  if (fs::exists(svg))
    page.drawing(read_file(svg), caption);
  else
    page.paragraph("There is no plot: gnuplot was not installed when this was written.");
}

std::string title_of(const Json& json) {
  const std::string title = json.at("scene").at("title");
  return title.empty() ? json.at("scene").at("file").get<std::string>() : title;
}

std::string program_of(const Json& json) {
  return fmt::format("moraine {}, commit {}", json.at("program").at("version").get<std::string>(),
                     json.at("program").at("commit").get<std::string>());
}

// ---- speed against error

HtmlPage pareto_page(const fs::path& directory) {
  const Json json = read_json(directory / "pareto.json");
  HtmlPage page("Speed against error: " + title_of(json));
  page.facts({{"scene", json.at("scene").at("file")},
              {"command", json.at("command")},
              {"program", program_of(json)},
              {"machine", json.at("machine")},
              {"layout", json.at("layout")},
              {"date", date_of(directory / "pareto.json")}});
  page.heading("Result");
  page.paragraph("Recommended: " + json.at("advice").get<std::string>());
  const bool by_statistics = json.at("compared_by") == "statistics";
  add_plot(
      page, directory / "pareto.svg",
      fmt::format("Error against the time to the scene's end ({:g} s). The line joins the efficient settings: none "
                  "is both faster and more accurate.{}",
                  json.at("scene_end").get<double>(),
                  by_statistics ? " Bars are 95 % confidence intervals from repeats with other seeds." : ""));
  HtmlPage::Table table;
  table.caption = "Each setting: its cost, its largest error, and what has it. ";
  table.caption += by_statistics
                       ? fmt::format("Errors of averages over time from {:g} to {:g} s, relative to the reference.",
                                     json.at("from").get<double>(), json.at("end").get<double>())
                       : fmt::format("Errors are root mean squares over the run, to {:g} s, against the reference's.",
                                     json.at("end").get<double>());
  table.rows = {
      {"setting", "step [s]", "steps/contact", "runs", "M p-steps/s", "time to end [s]", "error", "95 %", "of", ""}};
  HtmlPage::Table errors;
  errors.caption = "Errors of each quantity, with the half width of their intervals where there are repeats.";
  for (const Json& s : json.at("settings")) {
    std::vector<std::string> row = {s.at("name"), fmt::format("{:.4g}", s.at("time_step").get<double>()),
                                    fmt::format("{:.1f}", s.at("steps_per_contact").get<double>()),
                                    std::to_string(s.at("runs").get<int>())};
    if (s.contains("failure")) {
      row.insert(row.end(), {"", "", "stopped", "", "", s.at("failure").get<std::string>()});
      table.rows.push_back(row);
      continue;
    }
    row.push_back(fmt::format("{:.3g}", 1e-6 * s.at("particle_steps_per_second").get<double>()));
    row.push_back(fmt::format("{:.3g}", s.at("seconds_to_end").get<double>()));
    const auto size = [](const Json& error) { return std::abs(error.at("error").get<double>()); };
    const auto bound = [&](const Json& error) { return size(error) + error.value("half_width", 0.0); };
    const Json& all = s.at("errors");
    if (all.empty()) {
      row.insert(row.end(), {"reference", "", "", ""});
      table.rows.push_back(row);
      continue;
    }
    const Json& worst =
        *std::max_element(all.begin(), all.end(), [&](const Json& a, const Json& b) { return bound(a) < bound(b); });
    const auto width = [](const Json& error) {
      return error.contains("half_width") ? percentage(error.at("half_width").get<double>()) : std::string();
    };
    if (s.at("is_recommended").get<bool>()) table.marked.push_back(table.rows.size());
    row.insert(row.end(), {percentage(size(worst)), width(worst), worst.at("quantity").get<std::string>(),
                           s.at("is_recommended").get<bool>() ? "recommended"
                           : s.at("standing") == "front"      ? "front"
                           : s.at("standing") == "open"       ? "front?"
                                                              : ""});
    table.rows.push_back(row);
    if (errors.rows.empty()) {
      errors.rows.push_back({"setting"});
      for (const Json& error : all) errors.rows[0].push_back(error.at("quantity"));
    }
    errors.rows.push_back({s.at("name")});
    for (const Json& error : all) {
      const std::string interval = width(error);
      errors.rows.back().push_back(percentage(error.at("error").get<double>()) +
                                   (interval.empty() ? "" : " +- " + interval));
    }
  }
  page.table(table);
  page.heading("Errors");
  page.table(errors);
  for (const Json& remark : json.at("remarks")) page.paragraph(remark.get<std::string>());
  return page;
}

// ---- scaling

HtmlPage scale_page(const fs::path& directory) {
  const Json json = read_json(directory / "scale.json");
  HtmlPage page(fmt::format("{} scaling: {}", json.at("kind") == "weak" ? "Weak" : "Strong", title_of(json)));
  page.facts({{"scene", json.at("scene").at("file")},
              {"command", json.value("command", "")},
              {"program", program_of(json)},
              {"machine", json.at("machine")},
              {"timed", fmt::format("{} steps after {} of warm-up", json.at("steps").get<std::uint64_t>(),
                                    json.at("warm_up_steps").get<std::uint64_t>())},
              {"states", json.at("is_same_state").get<bool>() ? "all runs of the same grains ended in the same state"
                                                              : "RUNS ENDED IN DIFFERENT STATES"},
              {"date", date_of(directory / "scale.json")}});
  page.heading("Result");
  add_plot(page, directory / "scale.svg", "Speed-up, efficiency, and where the time of a step goes.");
  HtmlPage::Table table, phases;
  table.caption = "Layouts (ranks x threads), medians of the runs; speed-up and efficiency against the fewest cores.";
  table.rows = {{"layout", "cores", "runs", "grains", "median [s]", "M p-steps/s", "speed-up", "efficiency", "waiting",
                 "imbalance", "ghosts", "messages/step", "bytes/step"}};
  const std::string best = json.at("best_layout");
  std::vector<std::string> names;
  for (const Json& l : json.at("layouts")) {
    const auto number = [&](const char* key) { return l.at(key).get<double>(); };
    if (l.at("layout") == best) table.marked.push_back(table.rows.size());
    table.rows.push_back(
        {l.at("layout"), std::to_string(l.at("cores").get<int>()), std::to_string(l.at("runs").get<int>()),
         whole(number("grains")), fmt::format("{:.4g}", number("median_seconds")),
         fmt::format("{:.2f}", 1e-6 * number("particle_steps_per_second")), fmt::format("{:.2f}", number("speed_up")),
         percentage(number("efficiency")), percentage(number("waiting_share")),
         fmt::format("{:.3f}", number("work_imbalance")), whole(number("ghosts")),
         fmt::format("{:.4g}", number("messages_per_step")), bytes_text(number("bytes_per_step"))});
    for (const auto& [name, share] : l.at("phase_shares").items())
      if (share.get<double>() > 0.005 && std::find(names.begin(), names.end(), name) == names.end())
        names.push_back(name);
  }
  page.table(table);
  phases.caption = "Shares of the phases of a step.";
  phases.rows = {{"layout"}};
  phases.rows[0].insert(phases.rows[0].end(), names.begin(), names.end());
  for (const Json& l : json.at("layouts")) {
    phases.rows.push_back({l.at("layout")});
    for (const std::string& name : names)
      phases.rows.back().push_back(percentage(l.at("phase_shares").value(name, 0.0)));
  }
  page.table(phases);
  if (!json.at("projected").empty()) {
    HtmlPage::Table projected;
    projected.caption = "Projected by the model of moraine project, not measured.";
    projected.rows = {{"ranks", "grains", "step [s]", "speed-up", "efficiency"}};
    for (const Json& p : json.at("projected"))
      projected.rows.push_back({std::to_string(p.at("ranks").get<int>()), whole(p.at("grains").get<double>()),
                                fmt::format("{:.3g}", p.at("step_seconds").get<double>()),
                                fmt::format("{:.2f}", p.at("speed_up").get<double>()),
                                percentage(p.at("efficiency").get<double>())});
    page.table(projected);
  }
  return page;
}

// ---- a run

std::vector<std::string> head_of(const fs::path& csv) {
  std::istringstream in(read_file(csv));
  std::string line, cell;
  std::getline(in, line);
  std::vector<std::string> columns;
  for (std::istringstream cells(line); std::getline(cells, cell, ',');) columns.push_back(cell);
  return columns;
}

std::string unit_of(const std::string& column) {
  const std::size_t begin = column.rfind('['), end = column.rfind(']');
  return begin == std::string::npos || end == std::string::npos ? "-" : column.substr(begin + 1, end - begin - 1);
}

/// A script that draws the columns of a time series, those of one unit in one picture.
std::string plot_script(const fs::path& csv, std::vector<std::string>& files) {
  constexpr std::size_t most_lines = 12;
  const std::vector<std::string> columns = head_of(csv);
  const auto time = std::find(columns.begin(), columns.end(), "time [s]");
  if (time == columns.end()) return {};
  std::map<std::string, std::vector<std::size_t>> by_unit;
  for (std::size_t i = 0; i < columns.size(); ++i)
    if (columns[i] != "step" && columns[i] != "time [s]" && columns[i] != "state_hash")
      by_unit[unit_of(columns[i])].push_back(i);
  std::string script =
      "set datafile separator ','\nset grid\nset xlabel 'time [s]'\nset key outside right top noenhanced\n";
  for (const auto& [unit, which] : by_unit) {
    const std::string file = fmt::format("report-{}-{}.svg", csv.stem().string(), files.size());
    files.push_back(file);
    script += fmt::format(
        "set terminal svg size 1000,340 dynamic font 'Sans,12' background rgb 'white'\nset output {}\nset ylabel {} "
        "noenhanced\nplot ",
        quoted_gnuplot(file), quoted_gnuplot('[' + unit + ']'));
    for (std::size_t k = 0; k < std::min(which.size(), most_lines); ++k)
      script += fmt::format("{}{} using {}:{} with lines title {}", k == 0 ? "" : ", ",
                            quoted_gnuplot(csv.filename().string()), time - columns.begin() + 1, which[k] + 1,
                            quoted_gnuplot(columns[which[k]].substr(0, columns[which[k]].find(" ["))));
    script += '\n';
  }
  return script;
}

/// Draws every time series of the run; what it draws is taken into the page and removed.
void add_series(HtmlPage& page, const fs::path& directory) {
  std::vector<fs::path> tables;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory))
    if (entry.path().extension() == ".csv" && entry.path().stem() != "hashes") tables.push_back(entry.path());
  std::sort(tables.begin(), tables.end());
  if (tables.empty()) return;
  page.heading("Time series");
  const std::optional<fs::path> gnuplot = find_program({"gnuplot"});
  if (!gnuplot) {
    page.paragraph("There are no plots: gnuplot is not installed (apt-get install gnuplot-nox).");
    return;
  }
  for (const fs::path& csv : tables) {
    std::vector<std::string> files;
    const std::string script = plot_script(csv, files);
    if (script.empty()) continue;
    const fs::path script_file = directory / "report.gnuplot", talk = directory / "report-gnuplot.txt";
    write_file(script_file, script);
    run_child({fs::absolute(*gnuplot).string(), "report.gnuplot"}, directory, talk);
    std::error_code ignored;
    for (const std::string& file : files) {
      const std::string svg = text_if_there(directory / file);
      if (svg.find("</svg>") != std::string::npos) page.drawing(svg, csv.stem().string());
      fs::remove(directory / file, ignored);
    }
    fs::remove(script_file, ignored);
    fs::remove(talk, ignored);
  }
}

HtmlPage run_page(const fs::path& directory) {
  const RunSummary run = read_summary(directory / "summary.json");
  HtmlPage page(run.title.empty() ? run.scene_file : run.title);
  page.facts({{"scene", run.scene_file},
              {"command", fmt::format("moraine run {} --layout {}", shell_quoted((directory / "scene.toml").string()),
                                      run.layout)},
              {"program", fmt::format("moraine {}, commit {}", run.version, run.commit)},
              {"machine", fmt::format("{}, {} CPUs", run.processor, run.n_cpus)},
              {"layout", run.layout},
              {"grains", fmt::format("{} born, {} inside, {} left", count_text(run.n_born), count_text(run.n_grains),
                                     count_text(run.n_left))},
              {"simulated", fmt::format("to {:.6g} s in steps of {:.6g} s", run.time, run.time_step)},
              {"speed", fmt::format("{:.2f} M particle-steps/s over {} in {}", 1e-6 * run.speed(),
                                    counted(run.n_steps, "step"), duration_text(run.seconds()))},
              {"state hash", run.hash},
              {"ended by signal", run.signal != 0 ? std::to_string(run.signal) : ""},
              {"date", date_of(directory / "summary.json")}});
  for (const std::string& warning : run.warnings) page.paragraph("Warning: " + warning);
  HtmlPage::Table phases;
  phases.caption = "Time of the phases; means over the ranks.";
  phases.rows = {{"phase", "seconds", "share", "largest of a rank [s]"}};
  for (std::size_t i = 0; i < run.phases.size(); ++i) {
    const OverRanks phase = run.phase(i);
    if (phase.mean < 5e-4 * run.seconds()) continue;
    phases.rows.push_back({run.phases[i], fmt::format("{:.3f}", phase.mean), percentage(phase.mean / run.seconds()),
                           fmt::format("{:.3f}", phase.largest)});
  }
  page.table(phases);
  if (run.gas)
    page.facts({{"gas steps", count_text(run.gas->n_steps)},
                {"mass imbalance of a cell, at most", fmt::format("{:.1e}", run.gas->imbalance)},
                {"momentum error", fmt::format("{:.1e}", run.gas->momentum_error)},
                {"least void fraction", fmt::format("{:.3f}", run.gas->least_void_fraction)}});
  add_series(page, directory);
  page.heading("Scene and log");
  if (const std::string scene = text_if_there(directory / "scene.toml"); !scene.empty())
    page.listing("scene.toml, as run", scene);
  if (const std::string log = text_if_there(directory / "log.txt"); !log.empty()) page.listing("log", log);
  return page;
}

/// The text of the scene that a sweep is of.
void add_scene(HtmlPage& page, const fs::path& directory) {
  const fs::path file = directory / "sweep.json";
  if (!fs::exists(file)) return;
  const Json json = read_json(file);
  if (const std::string scene = json.value("scene", ""); !scene.empty()) page.listing("scene", scene);
}

HtmlPage page_of(const fs::path& directory) {
  try {
    if (fs::exists(directory / "pareto.json")) {
      HtmlPage page = pareto_page(directory);
      add_scene(page, directory);
      return page;
    }
    if (fs::exists(directory / "scale.json")) {
      HtmlPage page = scale_page(directory);
      add_scene(page, directory);
      return page;
    }
    if (fs::exists(directory / "summary.json")) return run_page(directory);
  } catch (const Json::exception& error) {
    throw StorageError(directory, std::string("holds results that cannot be read: ") + error.what());
  }
  const bool is_unfinished = fs::exists(directory / "sweep.json") || fs::exists(directory / "scene.toml");
  throw UsageError(directory.string() + (is_unfinished
                                             ? ": the run or sweep in it has not come to its end yet"
                                             : ": expected the directory of a run (summary.json) or of a sweep "
                                               "(scale.json, pareto.json)"));
}

}  // namespace

std::string write_report(const ReportRequest& request) {
  if (!fs::is_directory(request.directory)) throw UsageError(request.directory.string() + " is not a directory");
  const fs::path out = request.out.value_or(request.directory / "report.html");
  write_file(out, page_of(request.directory).text());
  return "report: " + out.string();
}

}  // namespace moraine
