// The particle halo: messages of the same size between the same ranks, step after step, as persistent requests.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "comm/world.hpp"

namespace moraine {

class Halo {
 public:
  /// What goes to and comes from one rank in each step [bytes]; a direction with nothing to say has no message.
  struct Link {
    int rank = 0;
    std::size_t send_bytes = 0;
    std::size_t receive_bytes = 0;
  };

  Halo();
  ~Halo();
  Halo(Halo&&) noexcept;
  Halo& operator=(Halo&&) noexcept;

  /// Sets the messages up anew; none may be under way. Each rank's links must answer the others'.
  void open(const World& world, std::vector<Link> links);
  std::size_t size() const;
  /// Where link k's message is to be put before start(). Aligned for doubles.
  std::span<std::byte> outgoing(std::size_t k);
  /// What link k has received when finish() has returned.
  std::span<const std::byte> incoming(std::size_t k) const;

  /// Posts all messages.
  void start();
  /// Waits for all of them.
  void finish();

  /// Since the start of the run.
  std::uint64_t n_messages() const;  // sent
  std::uint64_t n_bytes() const;     // sent
  double waited() const;             // [s] in finish()

 private:
  struct Requests;
  std::unique_ptr<Requests> requests_;
};

}  // namespace moraine
