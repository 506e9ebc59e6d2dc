// A run as a script drives it: steps without Python's lock, callbacks, arrays, interrupts.
#pragma once

#include <pybind11/numpy.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/run/simulation.hpp"
#include "io/cli/outputs.hpp"
#include "io/python/script_scene.hpp"

namespace moraine {

/// The ranks of this process's job: joined when the module is loaded.
const World& world_of_script();
/// Ends all runs that are left, then MPI where it was started by us. Nothing can be run afterwards.
void close_all_runs();

class ScriptedRun {
 public:
  ScriptedRun(const ScriptScene& scene, std::optional<int> threads, const std::optional<std::filesystem::path>& out,
              const std::optional<std::filesystem::path>& restart);
  ~ScriptedRun();
  ScriptedRun(const ScriptedRun&) = delete;
  ScriptedRun& operator=(const ScriptedRun&) = delete;

  /// Takes n steps; Python's lock is free meanwhile, but for callbacks and body forces. Throws what they throw, RunError, StorageError, and
  /// KeyboardInterrupt (as pybind11 has it) after a whole step.
  void step(std::uint64_t n);
  /// Steps until that time, none: to the end of the scene, and writes what is due at the end of a run.
  void run(std::optional<double> until);
  /// Asked by a callback: ends step() or run() when all callbacks of the step are through.
  void stop() { is_stopping_ = true; }

  void add_callback(std::uint64_t interval, pybind11::function function);
  void remove_callback(const pybind11::function& function);
  void set_body_force(const pybind11::object& function);
  void set_wall_motion(const std::string& wall, pybind11::function function, std::uint64_t every);

  /// Throws KeyError where the scene has no such field.
  pybind11::array array(const std::string& name);
  pybind11::array writable(const std::string& name);
  void grains_changed();
  /// The whole field in order of gid, on the first rank; None on the others.
  pybind11::object gather(const std::string& name) const;
  pybind11::dict fields() const;
  pybind11::dict snapshot(const std::vector<std::string>& names) const;
  pybind11::dict probe(const std::string& name);
  pybind11::dict energy() const;

  void write_snapshot(const std::filesystem::path& path) const;
  void write_checkpoint(const std::filesystem::path& path) const;

  /// Throws std::runtime_error where all runs have been closed.
  const Simulation& simulation() const;
  /// The same for what must not be asked in the middle of a step, that is by a body force.
  Simulation& whole() const;
  int threads() const { return threads_; }
  void close();

 private:
  struct Callback {
    std::uint64_t interval;
    pybind11::function function;
  };
  void start(const ScriptScene& scene, const std::optional<std::filesystem::path>& out,
             const std::optional<std::filesystem::path>& restart);
  void advance_to(std::uint64_t last);
  void step_until(std::uint64_t last);
  void step_once();
  void look_for_signals();
  void call_back();
  std::uint64_t next_callback() const;
  std::size_t probe_number(const std::string& name) const;
  FieldView view(const std::string& name);

  RunRecord record_;
  int threads_ = 1;
  std::unique_ptr<Simulation> simulation_;
  Log log_;
  std::optional<Outputs> outputs_;
  std::vector<Callback> callbacks_;
  std::chrono::steady_clock::time_point next_look_;
  bool is_stopping_ = false, is_advancing_ = false;
  bool is_in_body_force_ = false;  // or in the motion of a wall: the grains must stay where they are
  std::string
      why_over_;  // it cannot be stepped any more, or not before the grains have been put in order; empty: it can
  bool is_spoiled_ = false;  // by edited grains
};

}  // namespace moraine
