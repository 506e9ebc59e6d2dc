// The ranks of a run, and all that they say to each other beside the halo.
//
// A World alone (one rank) never calls MPI, so that programs that are not started by a launcher pay nothing for it.
// What is named "all ranks call it" is collective. Sums are of integers and maxima are maxima, so that no result depends on
// the number of ranks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace moraine {

/// Bytes for a rank, or from one.
struct Parcel {
  int rank = 0;
  std::vector<std::byte> bytes;
};

/// Time that a rank has spent in its World [s], waiting for others included.
struct WorldTimes {
  double reductions = 0.0;  // maxima, sums, broadcasts, barriers
  double parcels = 0.0;     // exchange()
};

class World {
 public:
  /// One rank, without MPI.
  World() = default;
  /// True where a launcher (mpirun, srun) has started this process as one of several, or as the only one of a job of one.
  static bool is_launched();
  /// All ranks of the job, where a launcher has started it; else alone. MPI is started here unless it runs already, and then ended when the
  /// last World of the process goes. Once in a process.
  static World join();

  int rank() const;
  int size() const;
  bool is_alone() const { return size() == 1; }
  bool is_root() const { return rank() == 0; }

  /// The first n ranks as a world of their own; nothing for the others. All ranks call it.
  std::optional<World> first(int n) const;

  /// The largest, or the sum, of each value over all ranks, in the place of what was there. All ranks call it, with as many values.
  void max(std::span<double> values) const;
  void max(std::span<std::uint64_t> values) const;
  void sum(std::span<std::int64_t> values) const;   // wraps around
  void sum(std::span<std::uint64_t> values) const;  // modulo 2^64
  /// The sum over the ranks before this one. All ranks call it.
  std::uint64_t sum_before(std::uint64_t value) const;
  /// The value of each rank. All ranks call it.
  std::vector<std::uint64_t> gather(std::uint64_t value) const;
  std::vector<double> gather(double value) const;
  /// The values of each rank, one rank after the other. All ranks call it, with as many values.
  std::vector<double> gather(std::span<const double> values) const;
  /// The text of each rank at the root, in order of rank; empty elsewhere. All ranks call it.
  std::vector<std::string> gather_at_root(const std::string& text) const;
  /// What the root holds, at all ranks. All ranks call it.
  void broadcast(std::vector<std::byte>& bytes, int root = 0) const;
  void broadcast(std::string& text, int root = 0) const;
  /// Delivers parcels to any ranks (also to this one); what arrives is in order of the sending rank, and of sending. The time grows with the
  /// parcels, not with the number of ranks (non-blocking consensus: Hoefler, Siebert & Lumsdaine 2010, PPoPP). All ranks call it.
  std::vector<Parcel> exchange(std::vector<Parcel> parcels) const;
  /// Until all ranks have come here. All ranks call it.
  void wait_for_all() const;

  /// Since the start of this World; zero where alone.
  WorldTimes times() const;

  /// Ends the whole job at once with this exit code. Any rank may call it.
  [[noreturn]] void abort(int code) const;

  /// The communicator, for comm and for the one handle header of parallel HDF5: a pointer to an MPI_Comm, or nullptr where alone.
  const void* communicator() const;

 private:
  struct Group;
  explicit World(std::shared_ptr<Group> group) : group_(std::move(group)) {}
  std::shared_ptr<Group> group_;
};

}  // namespace moraine
