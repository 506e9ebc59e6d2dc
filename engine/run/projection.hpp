// A run on many ranks, foretold: what each rank would hold and send, counted on the real grains without running them, and how long a step
// would take. README.md has the model of the time.
#pragma once

#include <compare>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "comm/subdomains.hpp"
#include "engine/contacts/size_classes.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

/// One rank at the start of a run. Sums over ranks count a border pair twice, as both owners compute it.
struct RankCounts {
  std::int64_t n_grains = 0;
  std::int64_t n_border_grains = 0;  // of these, that have a pair with a ghost
  std::int64_t n_pairs = 0;          // closer than their radii and the skin, at least one of them an own grain
  std::int64_t n_border_pairs = 0;   // of these, with a ghost
  std::int64_t n_contacts = 0;       // of the pairs, that touch
  std::int64_t n_ghosts = 0;         // copies of grains of other ranks
  std::int64_t n_sent = 0;           // copies of own grains that other ranks hold
  int n_neighbours = 0;              // ranks that grains are sent to, or received from
  int n_messages = 0;                // sent in a step
  std::int64_t bytes = 0;            // sent in a step

  bool operator==(const RankCounts&) const = default;
};

/// Work of a rank in a step, in units of a pair.
inline double work_of(const RankCounts& rank) {
  return static_cast<double>(rank.n_pairs) + 4.0 * static_cast<double>(rank.n_grains);
}

class Projection {
 public:
  /// Finds the pairs of these grains. Throws SceneError where the scene cannot be run.
  Projection(const Scene& scene, std::span<const GrainSeed> grains, int n_threads);

  /// Space shared out over so many ranks, and the rank of each grain.
  struct Division {
    Subdomains parts;
    std::vector<std::int32_t> owners;
  };
  Division divide(int n_parts) const;
  /// The ranks of a run on so many. Cuts and ghosts are by the functions that the run itself uses.
  std::vector<RankCounts> count(const Division& division) const;
  std::vector<RankCounts> count(int n_parts) const { return count(divide(n_parts)); }
  std::span<const Vec3> positions() const { return positions_; }  // [m]

  std::int64_t n_grains() const { return static_cast<std::int64_t>(positions_.size()); }
  double skin() const { return skin_; }  // [m] at the start of a run
  /// What a ghost is told in each step.
  std::int64_t bytes_per_ghost() const;

 private:
  struct Pair {
    std::int32_t a, b;
    bool touches;
  };
  struct Sent {  // from a part
    int to;
    std::int64_t n;
  };
  void find_pairs(std::span<const GrainSeed> grains);
  void count_pairs(std::span<const std::int32_t> owners, std::vector<RankCounts>& ranks) const;
  void count_ghosts(const Subdomains& parts, std::span<const std::int32_t> owners,
                    std::vector<RankCounts>& ranks) const;
  /// A grain that another part needs for a larger one of its own.
  struct Smaller {
    std::int32_t grain;
    int to;
    auto operator<=>(const Smaller&) const = default;
  };
  std::vector<Smaller> smaller_ones(std::span<const std::int32_t> owners) const;
  std::vector<Sent> sent_from(const Subdomains& parts, int part, std::span<const std::int32_t> own,
                              std::span<const Smaller> smaller) const;

  Scene scene_;  // without its lists of grains
  int n_threads_;
  double skin_ = 0.0, widest_skin_ = 0.0, largest_radius_ = 0.0;  // [m]
  SizeClasses sizes_;
  std::vector<Vec3> positions_;
  std::vector<double> radii_;
  std::vector<Pair> pairs_;
};

/// As Projection(scene, grains, 1).count(n_parts).
std::vector<RankCounts> count_ranks(const Scene& scene, std::span<const GrainSeed> grains, int n_parts);

/// What this machine takes for a step of a scene.
struct Rates {
  double fixed = 0.0;            // [s] of a step without grains
  double unit = 0.0;             // [s] of a unit of work
  double copy = 0.0;             // [s] of a byte put into a message, or taken out of one
  double bytes_per_grain = 0.0;  // [bytes] that a rank holds
  std::int64_t n_grains = 0;     // of the block that was run
  std::int64_t n_steps = 0;      // that it was run for
  double per_grain = 0.0;        // [s] of one of its grains and steps
};
/// Runs a block of the scene (at most `most_grains` of it, the fullest part of a cut) for about `seconds`, then a small one.
Rates measure_rates(const Scene& scene, std::span<const GrainSeed> grains, int n_threads,
                    std::int64_t most_grains = 100000, double seconds = 2.0);

/// How long a message takes between two ranks: latency + bytes / bandwidth.
struct Network {
  std::string name;
  double latency = 0.0;    // [s]
  double bandwidth = 0.0;  // [bytes/s] of each rank, in each direction
};

/// A step of a run. The shares are of the step's time and the mean over the ranks; with the rest, fixed cost, they add up to one.
struct Prediction {
  double step = 0.0;        // [s] of the slowest rank
  double one_rank = 0.0;    // [s] of one rank with all the grains
  double efficiency = 0.0;  // [-] one_rank / (step * n_ranks)
  double imbalance = 0.0;   // [-] largest work over mean work
  double work = 0.0;        // [-] contacts and motion
  double messages = 0.0;    // [-] packing, and waiting for messages that interior work does not hide
  double waiting = 0.0;     // [-] for the slowest rank
};
/// `one_rank_work`: of one rank with all the grains, in units.
Prediction predict(std::span<const RankCounts> ranks, double one_rank_work, std::int64_t bytes_per_ghost,
                   const Rates& rates, const Network& network);

}  // namespace moraine
