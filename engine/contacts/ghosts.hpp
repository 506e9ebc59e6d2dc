// The ghosts of a rank: made with the pair list, refreshed in each step.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "comm/halo.hpp"
#include "comm/subdomains.hpp"
#include "comm/world.hpp"
#include "engine/contacts/halo_records.hpp"
#include "engine/contacts/pair_list.hpp"
#include "engine/contacts/size_classes.hpp"
#include "engine/contacts/size_grids.hpp"
#include "engine/particles/particles.hpp"

namespace moraine {

/// What one rank exchanges with others in a step.
struct HaloCounts {
  std::uint64_t n_ghosts = 0, n_sent = 0;  // grains
  std::uint64_t n_neighbours = 0;          // ranks that it sends grains to or receives grains from
  std::uint64_t n_messages = 0;            // with grains, sent a step
  std::uint64_t n_received = 0;            // with grains, received a step
  std::uint64_t n_news = 0;                // messages of nothing but HaloNews a step, sent and received
  std::uint64_t n_bytes = 0;               // of grains, sent a step
};

/// What a rank says of itself at the head of each message to another, beside its grains.
struct HaloNews {
  std::uint64_t next_look =
      std::numeric_limits<std::uint64_t>::max();  // step at which it will look at how far all have come
  double travelled = 0.0;                         // [m] of its grains, a bound of Travelled::of_pairs()
  double max_speed = 0.0;                         // [m/s] of its grains in the last step
};

class Ghosts {
 public:
  /// Finds out which grains which rank needs, and puts the ghosts that come behind the grains of this one. The grains must have
  /// their final places, and be where `subdomains` puts them. All ranks call it.
  /// `grids` has them by size, where there are several classes.
  void make(const World& world, const Subdomains& subdomains, Particles& particles, const SizeClasses& classes,
            const SizeGrids& grids, double skin);
  /// The ghosts, and those periodic images of them that this rank's grains can meet across a cut direction.
  const std::vector<GhostCopy>& copies() const { return copies_; }

  /// Sends the present state of the grains that others need, and asks for that of the ghosts.
  void start_refresh(const Particles& particles);
  /// Waits for it and puts it in place. Returns the ghosts that have been brought back by a period or have left, in order.
  std::span<const GhostEvent> finish_refresh(Particles& particles);

  /// What the next messages say of this rank.
  void tell(const HaloNews& own) { own_ = own; }
  /// What was told last, but that an earlier look that others have told of since has taken the place of its own: so it goes on
  /// from neighbour to neighbour.
  const HaloNews& own() const { return own_; }
  /// What the last messages said: the earliest look, the furthest and the fastest of all that came.
  const HaloNews& heard() const { return heard_; }
  /// True where every rank whose grains could meet this one's before the next rebuild sends it messages.
  bool hears_all_near() const { return hears_all_near_; }

  /// False where the grains have moved since the ghosts were made or refreshed.
  bool are_fresh() const { return are_fresh_; }
  void set_fresh(bool are_fresh) { are_fresh_ = are_fresh; }

  HaloCounts counts() const;
  const Halo& halo() const { return halo_; }
  std::size_t memory() const;

 private:
  struct Link {
    int rank = 0;
    std::vector<std::int32_t> sent;  // places of the grains that it needs
    std::size_t n_first = 0;         // of them, those that it needs whatever it has itself
    std::int32_t first_ghost = 0;    // places of the ghosts that it sends
    std::int32_t n_ghosts = 0;
    bool is_kept = false;  // there are messages both ways, if only with news
  };
  bool sends(const Link& link) const { return link.is_kept || !link.sent.empty(); }
  bool receives(const Link& link) const { return link.is_kept || link.n_ghosts > 0; }
  void open_messages(const World& world, const Subdomains& subdomains, std::span<const Subdomains::Near> near);
  std::vector<Parcel> send_new(const World& world, const Particles& particles, bool is_first) const;
  void receive(Particles& particles, std::span<const std::vector<Parcel>> rounds);
  void add_smaller(const Particles& particles, const SizeClasses& classes, const SizeGrids& grids, double skin);
  void find_copies(const Subdomains& subdomains, int rank, const Particles& particles, double largest_radius,
                   double skin);
  Link& link_with(int rank);

  std::vector<Link> links_;
  HaloRecords records_;
  std::vector<GhostCopy> copies_;
  std::vector<GhostEvent> events_;
  std::array<bool, 3> periodic_{};
  Vec3 period_;
  Halo halo_;
  bool are_fresh_ = true;
  bool hears_all_near_ = true;
  HaloNews own_, heard_;
};

}  // namespace moraine
