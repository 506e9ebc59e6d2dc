// The program moraine.
//
// Exit codes: 0 all is well; 1 a run could not go on (its checkpoints stay), a disk is full, or two files differ; 2 the
// scene, the command line or a file to be read is wrong, and nothing was done; 130 (SIGINT), 143 (SIGTERM), 129
// (SIGHUP) the run was ended by that signal and has written a checkpoint. Under a launcher every rank comes by here;
// what is said is the root's.
#include <sys/prctl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <array>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <new>
#include <sstream>

#include "engine/run/simulation.hpp"
#include "io/cli/check_command.hpp"
#include "io/cli/failure.hpp"
#include "io/cli/file_commands.hpp"
#include "io/cli/layout.hpp"
#include "io/cli/limits.hpp"
#include "io/cli/mpirun_talk.hpp"
#include "io/cli/pareto_command.hpp"
#include "io/cli/plot_command.hpp"
#include "io/cli/project_command.hpp"
#include "io/cli/report_command.hpp"
#include "io/cli/run_command.hpp"
#include "io/cli/scale_command.hpp"
#include "io/cli/submit_command.hpp"
#include "io/cli/version.hpp"
#include "io/export/export.hpp"
#include "io/export/render.hpp"
#include "io/export/view.hpp"
#include "io/scene_toml/scene_toml.hpp"

using namespace moraine;

namespace {

using Command = std::function<int()>;

void print(const std::string& text) {
  std::fwrite(text.data(), 1, text.size(), stdout);
  if (!text.empty() && text.back() != '\n') std::fputc('\n', stdout);
}

void complain(const std::string& text) { std::fprintf(stderr, "error: %s\n", text.c_str()); }

/// What an error says, and the exit code that it ends in.
struct Fault {
  std::string text;
  int code = exit_code::failed;
};

/// A wrong scene or request is found by every rank alike; the others are of the rank that they happen on.
Fault bad_input(const std::string& text) { return {"error: " + text, exit_code::bad_input}; }
Fault fault_of_rank(const World& world, const std::string& text) {
  return {(world.is_alone() ? "error: " : "error: rank " + std::to_string(world.rank()) + ": ") + text,
          exit_code::failed};
}

void add_scene_options(CLI::App& command, std::filesystem::path& scene, std::vector<std::string>& overrides,
                       std::optional<std::string>& layout) {
  command.add_option("SCENE", scene, "scene file (TOML)")->required();
  command.add_option("--set", overrides, "changes a key of the scene: KEY=VALUE, as often as wanted")
      ->type_name("KEY=VALUE")
      ->type_size(1)
      ->allow_extra_args(false)
      ->take_all();
  command.add_option("--layout", layout, "RANKSxTHREADS, or auto: all cores that this process may use");
}

/// What a whole number must be; without it CLI11 takes -1 for a very large one.
std::function<std::string(const std::string&)> at_least(std::uint64_t least) {
  return [least](const std::string& text) {
    std::uint64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    const bool is_good = error == std::errc() && end == text.data() + text.size() && value >= least;
    return is_good ? std::string() : "expected a whole number from " + std::to_string(least) + ", found " + text;
  };
}

void add_run(CLI::App& app, Command& chosen, const World& world, Log& log, std::vector<std::string> command_line) {
  auto* command = app.add_subcommand("run", "runs a scene");
  auto request = std::make_shared<RunRequest>();
  request->command_line = std::move(command_line);
  add_scene_options(*command, request->scene_file, request->overrides, request->layout);
  command->add_option("--out", request->out,
                      "directory for the results (default: runs/NAME, or the next free NAME-2 ...)");
  command->add_option(
      "--restart", request->restart,
      "goes on from a checkpoint FILE, or auto: from the latest sound one of the newest run (or --out)");
  command->add_option("--until", request->until, "stops at this time [s], with a checkpoint");
  command
      ->add_option("--steps", request->steps,
                   "ends after so many more steps (after those of --warm-up), with a checkpoint")
      ->check(at_least(1))
      ->excludes("--until");
  command
      ->add_option("--warm-up", request->warm_up,
                   "steps at the beginning that speed, phases and counts at the end leave out")
      ->check(at_least(0));
  command->add_flag(
      "!--no-output", request->has_outputs,
      "for timing: no snapshots, probes and checkpoints, also not at the end; summary.json and summary.txt only");
  command->get_option("--until")->check([](const std::string& text) {
    double value = 0.0;
    return CLI::detail::lexical_cast(text, value) && value > 0.0 ? std::string()
                                                                 : "expected a time above 0 [s], found " + text;
  });
  command->callback([&chosen, &world, &log, request] {
    chosen = [&world, &log, request] { return run_scene(*request, log, world); };
  });
}

void add_check(CLI::App& app, Command& chosen) {
  auto* command = app.add_subcommand("check", "says what a scene will be run with, without running it");
  auto request = std::make_shared<RunRequest>();
  add_scene_options(*command, request->scene_file, request->overrides, request->layout);
  command->callback([&chosen, request] {
    chosen = [request] {
      std::string refusal;
      print(check_text(request->scene_file, request->overrides, request->layout, &refusal));
      if (!refusal.empty()) throw UsageError(refusal);
      return exit_code::good;
    };
  });
}

void add_project(CLI::App& app, Command& chosen) {
  auto* command =
      app.add_subcommand("project", "what a scene would do on many ranks, counted and predicted without running it");
  auto request = std::make_shared<ProjectRequest>();
  command->add_option("SCENE", request->scene_file, "scene file (TOML)")->required();
  command->add_option("--ranks", request->ranks, "numbers of ranks, such as 256,4096")
      ->required()
      ->delimiter(',')
      ->allow_extra_args(false);
  command->add_option("--network", request->network,
                      "file with the network's latency and bandwidth (default: InfiniBand QDR, 40 Gb/s)");
  command->add_option("--layout-threads", request->threads, "threads of a rank (default: 1)");
  command->add_option("--grains", request->grains,
                      "for a bed like that of the scene with so many grains: ranks with as many each are shown");
  command->add_option("--set", request->overrides, "changes a key of the scene: KEY=VALUE, as often as wanted")
      ->type_name("KEY=VALUE")
      ->type_size(1)
      ->allow_extra_args(false)
      ->take_all();
  command->add_option("--csv", request->csv, "also writes all numbers to this file");
  command->callback([&chosen, request] {
    chosen = [request] {
      print(project_text(*request));
      return exit_code::good;
    };
  });
}

void add_scale(CLI::App& app, Command& chosen, Log& log, const std::string& program) {
  auto* command = app.add_subcommand(
      "scale", "runs a scene on one layout after the other: speed-up, efficiency, and where the rest of the time goes");
  auto request = std::make_shared<ScaleRequest>();
  request->program = program;
  command->add_option("SCENE", request->scene_file, "scene file (TOML)")->required();
  auto* kinds = command->add_option_group("kind");
  kinds->add_flag_callback(
      "--strong", [request] { request->kind = ScaleKind::strong; }, "the same scene on all layouts");
  kinds->add_flag_callback(
      "--weak", [request] { request->kind = ScaleKind::weak; },
      "the scene grows with the number of cores, by its own rule (scale.weak; moraine keys)");
  kinds->require_option(1);
  command->add_option("--layouts", request->layouts,
                      "RANKSxTHREADS, such as 1x1,1x4,2x2 (default: all on 1, 2, 4 ... cores, and on all)");
  command->add_option("--steps", request->steps, "steps that are timed (default: 300, or as many as the scene has)")
      ->check(at_least(1));
  command->add_option("--warm-up", request->warm_up, "steps before them (default: 100, or as many as the scene has)")
      ->check(at_least(0));
  command->add_option("--repeats", request->repeats, "runs of each layout (default: 3)")->check(at_least(1));
  command->add_option("--out", request->out,
                      "directory for the results (default: runs/scale-NAME, with --weak runs/scale-NAME-weak); a sweep "
                      "that was interrupted goes on in it");
  command
      ->add_option("--project", request->projected,
                   "also shows what so many ranks would do, such as 16,64,256, by the model of moraine project")
      ->delimiter(',')
      ->allow_extra_args(false);
  command->add_option("--network", request->network, "file with the network of the projection, as for moraine project")
      ->needs("--project");
  command->add_option("--set", request->overrides, "changes a key of the scene: KEY=VALUE, as often as wanted")
      ->type_name("KEY=VALUE")
      ->type_size(1)
      ->allow_extra_args(false)
      ->take_all();
  command->callback([&chosen, &log, request] { chosen = [&log, request] { return scale_scene(*request, log); }; });
}

void add_pareto(CLI::App& app, Command& chosen, Log& log, const std::string& program) {
  auto* command = app.add_subcommand(
      "pareto",
      "speed against error: runs a scene with other time steps, skins, precisions, gas steps ..., and recommends one");
  auto request = std::make_shared<ParetoRequest>();
  request->program = program;
  add_scene_options(*command, request->scene_file, request->overrides, request->layout);
  command
      ->add_option("--repeats", request->repeats,
                   "runs of each setting with other seeds (default: 3 where statistics are compared, else 1)")
      ->check(at_least(1));
  command->add_flag("--product", request->is_product,
                    "also every time step with every precision and variant, not only one change at a time");
  command->add_option("--out", request->out,
                      "directory for the results (default: runs/pareto-NAME); runs that it holds are not run again");
  command->callback([&chosen, &log, request] { chosen = [&log, request] { return pareto_scene(*request, log); }; });
}

void add_report(CLI::App& app, Command& chosen) {
  auto* command =
      app.add_subcommand("report", "a run or a sweep as one page: plots, tables, machine, version, command (HTML)");
  auto request = std::make_shared<ReportRequest>();
  command->add_option("DIR", request->directory, "directory of a run, or of moraine scale or pareto")->required();
  command->add_option("--out", request->out, "file (default: DIR/report.html)");
  command->callback([&chosen, request] {
    chosen = [request] {
      print(write_report(*request));
      return exit_code::good;
    };
  });
}

void add_submit(CLI::App& app, Command& chosen, Log& log, const std::filesystem::path& program) {
  auto* command =
      app.add_subcommand("submit", "hands a scene to a cluster's Slurm, as a job that goes on until it is done");
  auto request = std::make_shared<SubmitRequest>();
  request->program = program;
  add_scene_options(*command, request->scene_file, request->overrides, request->layout);
  command->get_option("--layout")->description("RANKSxTHREADS, ranks of all nodes together");
  command->add_option("--nodes", request->nodes, "nodes of the cluster (default: 1)");
  command->add_option(
      "--time", request->time,
      "time limit of each job: MINUTES, H:M:S, D-H ... (default: the partition's); the run goes on in the next");
  command->add_option("--partition", request->partition, "partition (default: the cluster's)");
  command->add_option("--account", request->account, "account to charge");
  command->add_option("--name", request->name, "name of the job (default: the run's)");
  command->add_option("--mem", request->memory, "memory of each node, such as 16G; 0: all (default: estimated)");
  command
      ->add_option("--margin", request->margin,
                   "seconds before the time limit at which the run writes its checkpoint (default: a quarter of it, at "
                   "most 120)")
      ->check(CLI::Range(1, 65535));
  command->add_option("--mpi", request->mpi, "srun's --mpi (default: pmix)");
  command
      ->add_option("--directive", request->directives,
                   "a further option of sbatch for the script, as often as wanted: --directive qos=long")
      ->type_name("OPTION")
      ->type_size(1)
      ->allow_extra_args(false)
      ->take_all();
  command->add_option("--out", request->out,
                      "directory for the results (default: runs/NAME, or the next free NAME-2 ...)");
  command->add_option("--restart", request->restart, "auto: goes on with the newest run (or --out)");
  command->add_flag("--dry-run", request->is_dry_run, "prints the script, and does nothing else");
  command->add_flag("--sweep", request->is_sweep, "a study over layouts: an array of jobs, one for each of --layouts");
  command->add_option("--layouts", request->layouts, "layouts of the sweep, such as 1x4,2x2,4x1")
      ->delimiter(',')
      ->allow_extra_args(false);
  command->add_option("--system", request->system, "slurm (default), or a template for pbs or lsf with --dry-run");
  command->callback([&chosen, &log, request] {
    chosen = [&log, request] {
      submit(*request, log);
      return exit_code::good;
    };
  });
}

void add_info(CLI::App& app, Command& chosen) {
  auto* command = app.add_subcommand("info", "says what a checkpoint or snapshot holds");
  auto file = std::make_shared<std::filesystem::path>();
  command->add_option("FILE", *file, "checkpoint, snapshot, or run directory")->required();
  command->callback([&chosen, file] {
    chosen = [file] {
      print(info_text(*file));
      return exit_code::good;
    };
  });
}

void add_compare(CLI::App& app, Command& chosen) {
  auto* command = app.add_subcommand(
      "compare", "compares two files bit by bit; exit code 0: equal, 1: not equal, 2: cannot be read");
  auto files = std::make_shared<std::array<std::filesystem::path, 2>>();
  command->add_option("A", (*files)[0], "checkpoint, snapshot, or run directory (its latest checkpoint)")->required();
  command->add_option("B", (*files)[1], "the other one")->required();
  command->callback([&chosen, files] {
    chosen = [files] {
      const ComparisonText result = compare_files((*files)[0], (*files)[1]);
      print(result.text);
      return result.is_equal ? exit_code::good : exit_code::failed;
    };
  });
}

void add_export(CLI::App& app, Command& chosen) {
  auto* command = app.add_subcommand("export", "writes the snapshots of a run for other tools");
  auto request = std::make_shared<ExportRequest>();
  command->add_option("RUN", request->run, "run directory, or one snapshot")->required();
  auto* kinds = command->add_option_group("format");
  kinds->add_flag_callback(
      "--vtk", [request] { request->kind = ExportKind::vtk; }, "VTK files and a .pvd series");
  kinds->add_flag_callback(
      "--csv", [request] { request->kind = ExportKind::csv; }, "a CSV table for each snapshot");
  kinds->add_flag_callback(
      "--povray", [request] { request->kind = ExportKind::povray; }, "POV-Ray scenes");
  kinds->add_flag_callback(
      "--tecplot", [request] { request->kind = ExportKind::tecplot; }, "Tecplot ASCII files of grains and gas");
  kinds->require_option(1);
  command->add_option("--frame", request->frame,
                      "only this snapshot: 0, 1, ... from the first, -1, -2, ... from the last");
  command->add_option("--field", request->field, "POV-Ray: what the grains are coloured by (default: speed)");
  command->add_option("--out", request->out, "directory (default: RUN/vtk, RUN/csv, RUN/povray, RUN/tecplot)");
  command->callback([&chosen, request] {
    chosen = [request] {
      print(export_run(*request));
      return exit_code::good;
    };
  });
}

void add_render(CLI::App& app, Command& chosen, Log& log) {
  auto* command = app.add_subcommand("render", "a picture (PNG) of a snapshot, by POV-Ray, or a movie of all");
  auto request = std::make_shared<RenderRequest>();
  command->add_option("RUN", request->run, "run directory, or one snapshot")->required();
  command->add_option("--frame", request->frame,
                      "which snapshot: 0, 1, ... from the first, -1 (default), -2, ... from the last, or all");
  command->add_option("--field", request->style.field, "what the grains are coloured by (default: speed)");
  command
      ->add_option("--range", request->style.range,
                   "least and greatest value of the colours (default: those of the snapshot)")
      ->expected(2);
  command->add_option(
      "--gas", request->style.gas,
      "also a slice of the gas in the middle, coloured by this: void_fraction, pressure, gas_speed ...");
  command->add_option("--size", request->size, "WIDTHxHEIGHT in pixels (default: 1280x960)");
  command->add_option("--view", request->style.view, "azimuth and elevation of the camera [degrees]")->expected(2);
  command->add_option("--out", request->out, "file (default: RUN/pictures/STEP.png)");
  auto* movie = command->add_option("--movie", request->movie,
                                    "a movie of all snapshots instead, by ffmpeg: FILE.mp4, FILE.webm or FILE.gif");
  command->add_option("--rate", request->rate, "frames of the movie a second (default: 10)");
  command
      ->add_option("--preview", request->preview,
                   "shows the picture in the terminal (24-bit colours), so many characters wide, and writes no file")
      ->check(CLI::Range(16, 1000))
      ->excludes(movie);
  command->callback([&chosen, &log, request] {
    chosen = [&log, request] {
      request->progress = [&log](const std::string& text) { log.progress(text); };
      print(render_run(*request));
      return exit_code::good;
    };
  });
}

void add_view(CLI::App& app, Command& chosen) {
  auto* command = app.add_subcommand("view", "a run in one HTML page that plays in a browser");
  auto request = std::make_shared<ViewRequest>();
  command->add_option("RUN", request->run, "run directory, or one snapshot")->required();
  command->add_option("--field", request->field, "what the grains are coloured by (default: speed)");
  command
      ->add_option("--range", request->range, "least and greatest value of the colours (default: those of most grains)")
      ->expected(2);
  command->add_option("--grains", request->most_grains, "of more than so many an even share is shown (default: 30000)")
      ->check(at_least(1));
  command->add_option("--frames", request->most_frames, "of more than so many an even share is shown (default: 200)")
      ->check(at_least(1));
  command->add_option("--out", request->out, "file (default: RUN/view.html)");
  command->callback([&chosen, request] {
    chosen = [request] {
      print(view_run(*request));
      return exit_code::good;
    };
  });
}

void add_plot(CLI::App& app, Command& chosen) {
  auto* command = app.add_subcommand("plot", "time series, profiles and phases of a run as pictures, by gnuplot");
  auto request = std::make_shared<PlotRequest>();
  command->add_option("RUN", request->run, "run directory")->required();
  command->add_flag_callback(
      "--svg", [request] { request->formats.push_back("svg"); }, "SVG (default: both)");
  command->add_flag_callback(
      "--png", [request] { request->formats.push_back("png"); }, "PNG");
  command->add_option("--out", request->out, "directory (default: RUN/plots)");
  command->callback([&chosen, request] {
    chosen = [request] {
      print(plot_run(*request));
      return exit_code::good;
    };
  });
}

void add_keys(CLI::App& app, Command& chosen) {
  app.add_subcommand("keys", "lists every key of a scene file")->callback([&chosen] {
    chosen = [] {
      print(scene_key_reference());
      return exit_code::good;
    };
  });
}

bool has_command(const CLI::App& app, const std::string& name) {
  const auto is_named = [&](const CLI::App* command) { return command->get_name() == name; };
  return !app.get_subcommands(is_named).empty();
}

std::string command_names(const CLI::App& app) {
  std::string names;
  for (const CLI::App* command : app.get_subcommands({})) names += (names.empty() ? "" : ", ") + command->get_name();
  return names;
}

/// Does it; of a fault it gives account.
std::optional<Fault> try_out(const Command& command, bool is_run, const World& world, int& code) {
  try {
    code = command();
    return std::nullopt;
  } catch (const SceneFileError& error) {  // each problem stands on a line of its own already
    return Fault{error.what(), exit_code::bad_input};
  } catch (const SceneError& error) {
    return Fault{error.what(), exit_code::bad_input};
  } catch (const UsageError& error) {
    return bad_input(error.what());
  } catch (const ExportError& error) {
    return bad_input(error.what());
  } catch (const StorageError& error) {
    return is_run ? fault_of_rank(world, error.what()) : bad_input(error.what());
  } catch (const std::bad_alloc&) {
    return fault_of_rank(world, "there is not enough memory");
  } catch (const std::exception& error) {
    return fault_of_rank(world, error.what());
  }
}

int carry_out(const Command& command, bool is_run, const World& world) {
  if (!is_run && !world.is_root()) return exit_code::good;  // looking at files is work for one
  int code = exit_code::good;
  const std::optional<Fault> fault = try_out(command, is_run, world, code);
  if (!fault) return code;
  const auto say = [&] { std::fprintf(stderr, "%s\n", fault->text.c_str()); };
  if (is_run && !world.is_alone()) end_job(world, fault->code, say);
  say();
  return fault->code;
}

/// Threads that wait for each other spin before they sleep. By default they spin for milliseconds, which on a machine that others
/// use too takes away the very core that is waited for: steps then cost a hundred times more. The OpenMP runtime reads its
/// settings when it is loaded, so the program starts itself anew with a short spin; whoever has chosen is left alone.
void spin_briefly(char** argv) {
  prctl(PR_SET_NAME, "moraine");  // started anew it would be listed as "exe"
  if (std::getenv("GOMP_SPINCOUNT") || std::getenv("OMP_WAIT_POLICY")) return;
  setenv("GOMP_SPINCOUNT", "10000", 1);
  take_back_cpus();               // the runtime may have bound this thread to one of them
  execv("/proc/self/exe", argv);  // returns only where it failed: then it spins
}

/// By which mpirun is to start this program again.
std::vector<std::string> own_command_line(int argc, char** argv) {
  std::error_code error;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  std::vector<std::string> words = {error ? std::string(argv[0]) : program.string()};
  words.insert(words.end(), argv + 1, argv + argc);
  return words;
}

/// What MPI would say at length, each rank on its own, is said here by one of them.
void expect_to_be_rank() {
  try {
    expect_files_for_rank();
  } catch (const UsageError& error) {
    end_job(World(), exit_code::bad_input, [&] { complain(error.what()); });
  }
}

/// The command line, read and carried out by all ranks.
int run_program(int argc, char** argv, const World& world) {
  CLI::App app("Moraine: how grains flow. One scene file, all cores, the same bits on any number of them.", "moraine");
  app.set_version_flag("--version", program_identity());
  app.require_subcommand(1);
  Command chosen;
  Log log = world.is_root() ? Log() : Log::mute();
  add_run(app, chosen, world, log, own_command_line(argc, argv));
  add_check(app, chosen);
  add_scale(app, chosen, log, own_command_line(argc, argv).front());
  add_pareto(app, chosen, log, own_command_line(argc, argv).front());
  add_project(app, chosen);
  add_report(app, chosen);
  add_submit(app, chosen, log, own_command_line(argc, argv).front());
  add_info(app, chosen);
  add_compare(app, chosen);
  add_export(app, chosen);
  add_render(app, chosen, log);
  add_view(app, chosen);
  add_plot(app, chosen);
  add_keys(app, chosen);
  if (argc < 2) {
    if (world.is_root()) std::fputs(app.help().c_str(), stderr);
    return exit_code::bad_input;
  }
  if (argv[1][0] != '-' && !has_command(app, argv[1])) {
    if (world.is_root()) complain("unknown command \"" + std::string(argv[1]) + "\"; there are " + command_names(app));
    return exit_code::bad_input;
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    std::ostringstream nowhere;
    const int code = world.is_root() ? app.exit(error) : app.exit(error, nowhere, nowhere);
    return code == 0 ? exit_code::good : exit_code::bad_input;
  }
  const bool is_run = app.got_subcommand("run") || app.got_subcommand("scale") || app.got_subcommand("pareto");
  return carry_out(chosen, is_run, world);
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGXFSZ, SIG_IGN);  // a limit on the size of files (ulimit -f) is then an error with a name
  spin_briefly(argv);
  allow_many_files();
  try {
    if (World::is_launched()) expect_to_be_rank();
    const World world = World::join();
    if (world.is_root()) give_start_sign();
    return run_program(argc, argv, world);
  } catch (const std::exception& error) {
    complain(error.what());
    return exit_code::failed;
  }
}
