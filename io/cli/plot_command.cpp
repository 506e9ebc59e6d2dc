#include "io/cli/plot_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>

#include "io/checkpoint/durable_file.hpp"
#include "io/cli/child.hpp"
#include "io/cli/layout.hpp"
#include "io/cli/programs.hpp"
#include "io/cli/summary.hpp"
#include "io/cli/text.hpp"
#include "io/export/colour_map.hpp"
#include "io/export/spectrum.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t most_lines = 10;  // in one picture; of more columns an even share is drawn
constexpr std::size_t n_instants = 6;   // of a profile

std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("''") : std::string(1, c == '\n' ? ' ' : c);
  return out + '\'';
}

std::string file_name(const std::string& text) {
  std::string name;
  for (const char c : text) {
    const bool is_plain = std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-';
    if (is_plain || (!name.empty() && name.back() != '_')) name += is_plain ? c : '_';
  }
  return name;
}

std::string number(double value) { return std::isfinite(value) ? fmt::format("{}", value) : "NaN"; }

std::string with_unit(const std::string& name, const std::string& unit) {
  return unit.empty() ? name : fmt::format("{} [{}]", name, unit);
}

std::string colour(double share) {
  const Colour c = viridis(0.92 * share);  // the lightest yellow cannot be seen on white
  const auto byte = [](double part) { return std::lround(255.0 * part); };
  return fmt::format("'#{:02x}{:02x}{:02x}'", byte(c.red), byte(c.green), byte(c.blue));
}

template <typename T>
std::vector<T> even_share(const std::vector<T>& all, std::size_t most) {
  if (all.size() <= most) return all;
  std::vector<T> some;
  for (std::size_t k = 0; k < most; ++k) some.push_back(all[k * (all.size() - 1) / (most - 1)]);
  return some;
}

Plot lines_over_time(const RunTable& table, const ColumnGroup& group) {
  const std::vector<std::size_t> columns = even_share(group.columns, most_lines);
  Plot plot{file_name(table.name + (group.unit.empty() ? "" : " " + (group.unit == "-" ? "ratios" : group.unit))), {}};
  plot.script = "$data << EOD\n";
  for (std::size_t row = 0; row < table.time.size(); ++row) {
    plot.script += number(table.time[row]);
    for (const std::size_t k : columns) plot.script += ' ' + number(table.columns[k].values[row]);
    plot.script += '\n';
  }
  plot.script += fmt::format("EOD\nset title {}\nset xlabel 'time [s]'\nset ylabel {}\nplot", quoted(table.name),
                             quoted(group.unit.empty() ? "" : "[" + group.unit + "]"));
  for (std::size_t k = 0; k < columns.size(); ++k)
    plot.script += fmt::format("{} $data using 1:{} with lines lw 1.6 lc {} title {}", k == 0 ? "" : ",", k + 2, k + 1,
                               quoted(table.columns[columns[k]].name));
  plot.script += '\n';
  return plot;
}

/// Mean of a column over the second half of its time.
double late_mean(const RunTable& table, const TableColumn& column) {
  const double middle = 0.5 * (table.time.front() + table.time.back());
  double sum = 0.0, n = 0.0;
  for (std::size_t row = 0; row < table.time.size(); ++row)
    if (table.time[row] >= middle && std::isfinite(column.values[row])) sum += column.values[row], n += 1.0;
  return sum / n;
}

/// Places along z stand upright, as in the scene.
Plot profile(const RunTable& table, const ColumnGroup& group) {
  Plot plot{file_name(table.name + " " + group.quantity), {}};
  std::vector<std::size_t> rows(table.time.size());
  for (std::size_t row = 0; row < rows.size(); ++row) rows[row] = row;
  rows = even_share(rows, n_instants);
  plot.script = "$data << EOD\n";
  for (const std::size_t k : group.columns) {
    const TableColumn& column = table.columns[k];
    plot.script += number(*column.place);
    for (const std::size_t row : rows) plot.script += ' ' + number(column.values[row]);
    plot.script += ' ' + number(late_mean(table, column)) + '\n';
  }
  const std::string axis = table.columns[group.columns[0]].axis;
  const bool is_upright = axis == "z";
  const std::string place = axis + " [m]", value = with_unit(group.quantity, group.unit);
  plot.script += fmt::format("EOD\nset title {}\nset xlabel {}\nset ylabel {}\nplot", quoted(table.name),
                             quoted(is_upright ? value : place), quoted(is_upright ? place : value));
  const auto columns = [&](std::size_t k) { return is_upright ? fmt::format("{}:1", k) : fmt::format("1:{}", k); };
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const double share = rows.size() > 1 ? static_cast<double>(k) / static_cast<double>(rows.size() - 1) : 0.0;
    plot.script += fmt::format("{} $data using {} with linespoints pt 7 ps 0.5 lc rgb {} title '{:.4g} s'",
                               k == 0 ? "" : ",", columns(k + 2), colour(share), table.time[rows[k]]);
  }
  plot.script += fmt::format(", $data using {} with lines lw 3 lc rgb '#d62728' title 'mean of the second half'\n",
                             columns(rows.size() + 2));
  return plot;
}

/// Of pressures, over the second half of the time; a column of frequencies, then one for each column of pressure.
struct PressureSpectra {
  std::vector<std::string> names;
  std::vector<Spectrum> spectra;
};
PressureSpectra spectra_of(const RunTable& table, const ColumnGroup& group) {
  PressureSpectra found;
  if (group.unit != "Pa" || group.is_profile()) return found;
  const std::size_t n = table.time.size() / 2, first = table.time.size() - n;
  for (const std::size_t k : even_share(group.columns, most_lines)) {
    const TableColumn& column = table.columns[k];
    const auto spectrum =
        spectrum_of(std::span(table.time).subspan(first, n), std::span(column.values).subspan(first, n));
    if (!spectrum) return {};
    found.names.push_back(column.name);
    found.spectra.push_back(*spectrum);
  }
  return found;
}

std::optional<Plot> spectrum_plot(const RunTable& table, const ColumnGroup& group) {
  const PressureSpectra found = spectra_of(table, group);
  if (found.spectra.empty()) return std::nullopt;
  Plot plot{file_name(table.name + " spectrum"), "$data << EOD\n"};
  for (std::size_t f = 0; f < found.spectra[0].frequency.size(); ++f) {
    plot.script += number(found.spectra[0].frequency[f]);
    for (const Spectrum& spectrum : found.spectra) plot.script += ' ' + number(spectrum.density[f]);
    plot.script += '\n';
  }
  plot.script += fmt::format(
      "EOD\nset title {}\nset xlabel 'frequency [Hz]'\nset ylabel '[Pa^2/Hz]'\nset logscale xy\nplot",
      quoted(fmt::format("{}: power of the second half, mean of {} pieces", table.name, found.spectra[0].n_pieces)));
  for (std::size_t k = 0; k < found.spectra.size(); ++k)
    plot.script += fmt::format("{} $data using 1:{} with lines lw 1.6 lc {} title {}", k == 0 ? "" : ",", k + 2, k + 1,
                               quoted(found.names[k]));
  plot.script += '\n';
  return plot;
}

std::vector<PhaseShareRow> phases_of(const RunSummary& summary) {
  double all = 0.0;
  for (std::size_t i = 0; i < summary.phases.size(); ++i) all += summary.phase(i).mean;
  std::vector<PhaseShareRow> rows;
  for (std::size_t i = 0; i < summary.phases.size(); ++i)
    if (const double percent = 100.0 * summary.phase(i).mean / all; percent >= 0.05)
      rows.push_back({summary.phases[i], percent});
  return rows;
}

std::string terminal(const std::string& format, const std::string& name) {
  const std::string kind = format == "svg" ? "svg size 900,560 dynamic font 'Sans,14' background rgb 'white'"
                                           : "pngcairo size 1350,840 font 'Sans,15'";
  return fmt::format("set terminal {}\nset output '{}.{}'\n", kind, name, format);
}

std::string script_of(const std::vector<Plot>& plots, const std::vector<std::string>& formats) {
  std::string text = "# gnuplot plots.gnuplot draws the pictures beside it.\n";
  for (const Plot& plot : plots)
    for (const std::string& format : formats)
      text += fmt::format(
          "\nreset\nset grid lc rgb '#dddddd'\nset border 3\nset tics nomirror\nset key outside below noenhanced\n"
          "set title noenhanced\nset xlabel noenhanced\nset ylabel noenhanced\n{}{}set output\n",
          terminal(format, plot.name), plot.script);
  return text;
}

/// Names that two plots would share get numbers.
void make_names_unique(std::vector<Plot>& plots) {
  for (std::size_t i = 0; i < plots.size(); ++i)
    for (std::size_t j = i + 1, n = 2; j < plots.size(); ++j)
      if (plots[j].name == plots[i].name) plots[j].name += fmt::format("_{}", n++);
}

void draw(const fs::path& directory) {
  const std::optional<fs::path> gnuplot = find_program({"gnuplot"});
  if (!gnuplot)
    throw UsageError("gnuplot is not installed (Debian and Ubuntu: apt-get install gnuplot-nox); its script is " +
                     (directory / "plots.gnuplot").string());
  const fs::path talk = directory / "gnuplot.txt";
  const ChildEnd end = run_child({fs::absolute(*gnuplot).string(), "plots.gnuplot"}, directory, talk);
  if (!end.is_good()) throw UsageError("gnuplot failed, and says why in " + talk.string());
  std::error_code ignored;
  fs::remove(talk, ignored);
}

}  // namespace

std::vector<Plot> plots_of(const std::vector<RunTable>& tables) {
  std::vector<Plot> plots;
  for (const RunTable& table : tables)
    for (const ColumnGroup& group : column_groups(table)) {
      plots.push_back(group.is_profile() ? profile(table, group) : lines_over_time(table, group));
      if (const auto spectrum = spectrum_plot(table, group)) plots.push_back(*spectrum);
    }
  make_names_unique(plots);
  return plots;
}

std::optional<Plot> plot_of_phases(const std::vector<PhaseShareRow>& phases, const std::string& heading) {
  if (phases.empty()) return std::nullopt;
  Plot plot{"phases", "$data << EOD\n"};
  for (std::size_t i = 0; i < phases.size(); ++i)
    plot.script += fmt::format("{} {} \"{}\"\n", phases.size() - i, phases[i].percent, phases[i].name);
  plot.script += fmt::format(
      "EOD\nset title {}\nunset key\nset xlabel 'share of the time of the steps [%]'\nset xrange [0:*]\n"
      "set yrange [0.4:{}.6]\nset ytics scale 0 noenhanced\nset style fill solid 0.85\n"
      "plot $data using (0.5*$2):1:(0.5*$2):(0.36):ytic(3) with boxxyerror lc rgb '#3b5b92', "
      "$data using 2:1:(sprintf(' %.1f', $2)) with labels left\n",
      quoted(heading), phases.size());
  return plot;
}

std::string plot_run(const PlotRequest& request) {
  if (!fs::is_directory(request.run)) throw StorageError(request.run, "is not a directory; expected that of a run");
  std::vector<std::string> formats = request.formats.empty() ? std::vector<std::string>{"svg", "png"} : request.formats;
  std::vector<Plot> plots = plots_of(read_run_tables(request.run));
  if (fs::exists(request.run / "summary.json")) {
    const RunSummary summary = read_summary(request.run / "summary.json");
    const std::string heading = fmt::format("{}: {} on {}", summary.title, summary.layout, summary.processor);
    if (const auto phases = plot_of_phases(phases_of(summary), heading)) plots.push_back(*phases);
  }
  if (plots.empty())
    throw UsageError(request.run.string() +
                     " holds nothing to plot: the scene needs a [[probe]], or the run its end (summary.json)");
  const fs::path out = request.out ? *request.out : request.run / "plots";
  make_directory(out);
  write_file(out / "plots.gnuplot", script_of(plots, formats));
  draw(out);
  std::string text = fmt::format("{} in {}:", counted(plots.size(), "plot"), out.string());
  for (const Plot& plot : plots) text += ' ' + plot.name;
  return text;
}

}  // namespace moraine
