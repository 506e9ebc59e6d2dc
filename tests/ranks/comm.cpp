// World and Halo between real ranks.
#include <algorithm>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <cstring>
#include <thread>

#include "comm/first_text.hpp"
#include "comm/halo.hpp"
#include "comm/subdomains.hpp"
#include "kernels/base/random.hpp"
#include "tests/ranks/ranks.hpp"

using namespace moraine;

namespace {

/// How many parcels rank `from` sends to rank `to` in a round: mostly none.
int parcels_between(int from, int to, int round) {
  const auto key = static_cast<std::uint64_t>(((round * 64) + from) * 64 + to);
  const double u = random_uniform(7, key, RandomPurpose::choice);
  return u < 0.6 ? 0 : u < 0.8 ? 1 : 3;
}

/// What parcel k between them says; some are empty.
std::vector<std::byte> words(int from, int to, int round, int k) {
  const std::string text =
      std::to_string(from) + '>' + std::to_string(to) + '#' + std::to_string(round) + '.' + std::to_string(k);
  std::vector<std::byte> bytes;
  const int repeats = (round + k) % 3 == 2 ? 0 : (round % 10 == 9 ? 5000 : 1);
  for (int i = 0; i < repeats; ++i)
    for (const char c : text) bytes.push_back(static_cast<std::byte>(c));
  return bytes;
}

/// Doubles that rank `from` sends to rank `to`: none for some, and of different numbers.
std::size_t halo_size(int from, int to, int n_ranks) {
  const int distance = (to - from + n_ranks) % n_ranks;
  return distance == 0 || distance == 2 ? 0 : static_cast<std::size_t>(17 * (from + 1) + 1000 * distance);
}

std::vector<Halo::Link> links_of(const World& world, int odd_bytes) {
  std::vector<Halo::Link> links;
  for (int other = 0; other < world.size(); ++other) {
    const std::size_t to = halo_size(world.rank(), other, world.size()),
                      from = halo_size(other, world.rank(), world.size());
    const auto bytes = [&](std::size_t n) {
      return n == 0 ? 0 : n * sizeof(double) + static_cast<std::size_t>(odd_bytes);
    };
    if (other != world.rank()) links.push_back({other, bytes(to), bytes(from)});
  }
  return links;
}

/// Byte b of the message of a round.
std::byte halo_byte(int from, int to, int round, std::size_t b) {
  return static_cast<std::byte>((static_cast<std::size_t>(from * 31 + to * 17 + round * 7) + b) % 251);
}

void exchange_rounds(const World& world, Halo& halo, const std::vector<Halo::Link>& links, int n_rounds) {
  for (int round = 0; round < n_rounds; ++round) {
    for (std::size_t k = 0; k < halo.size(); ++k) {
      const auto out = halo.outgoing(k);
      REQUIRE(out.size() == links[k].send_bytes);
      for (std::size_t b = 0; b < out.size(); ++b) out[b] = halo_byte(world.rank(), links[k].rank, round, b);
    }
    halo.start();
    halo.finish();
    std::size_t n_wrong = 0;
    for (std::size_t k = 0; k < halo.size(); ++k) {
      const auto in = halo.incoming(k);
      REQUIRE(in.size() == links[k].receive_bytes);
      for (std::size_t b = 0; b < in.size(); ++b) n_wrong += in[b] != halo_byte(links[k].rank, world.rank(), round, b);
    }
    REQUIRE(n_wrong == 0);
  }
}

}  // namespace

TEST_CASE("the job has the ranks that it was started with") {
  const World& world = ranks::world();
  CHECK(World::is_launched());
  CHECK(world.size() == 4);
  CHECK_FALSE(world.is_alone());
  CHECK(world.communicator() != nullptr);
  const std::vector<std::uint64_t> ranks = world.gather(static_cast<std::uint64_t>(world.rank()));
  CHECK(ranks == std::vector<std::uint64_t>{0, 1, 2, 3});
}

TEST_CASE("maxima and sums are over all ranks, value by value, and known to all") {
  const World& world = ranks::world();
  const int rank = world.rank(), n = world.size();
  std::vector<double> reals = {static_cast<double>(rank), -1.0 - rank, rank == 1 ? 1e300 : -1e300};
  world.max(reals);
  CHECK(reals == std::vector<double>{n - 1.0, -1.0, 1e300});
  std::vector<std::uint64_t> large = {static_cast<std::uint64_t>(rank),
                                      ~std::uint64_t{0} - static_cast<std::uint64_t>(rank)};
  world.max(large);
  CHECK(large == std::vector<std::uint64_t>{static_cast<std::uint64_t>(n - 1), ~std::uint64_t{0}});
  std::vector<std::int64_t> sums = {rank, -rank, 1};
  world.sum(sums);
  CHECK(sums == std::vector<std::int64_t>{n * (n - 1) / 2, -n * (n - 1) / 2, n});
  std::vector<std::uint64_t> modulo = {std::uint64_t{1} << 63};
  world.sum(modulo);
  CHECK(modulo[0] == 0);  // four times half of 2^64
  std::vector<double> none;
  world.max(none);
}

TEST_CASE("the time that ranks wait for one of them is counted, in reductions and in exchanges apart") {
  const World& world = ranks::world();
  const auto come_late = [&] {
    world.wait_for_all();
    if (world.is_root()) std::this_thread::sleep_for(std::chrono::milliseconds(100));
    return world.times();
  };
  WorldTimes before = come_late();
  world.gather(1.0);
  WorldTimes after = world.times();
  CHECK(after.parcels == before.parcels);
  if (!world.is_root()) CHECK(after.reductions - before.reductions > 0.05);
  before = come_late();
  world.exchange({});
  after = world.times();
  CHECK(after.reductions == before.reductions);
  if (!world.is_root()) CHECK(after.parcels - before.parcels > 0.05);
}

TEST_CASE("the sum before a rank counts lower ranks only") {
  const World& world = ranks::world();
  std::uint64_t expected = 0;
  for (int r = 0; r < world.rank(); ++r) expected += static_cast<std::uint64_t>(10 + r);
  CHECK(world.sum_before(static_cast<std::uint64_t>(10 + world.rank())) == expected);
}

TEST_CASE("gathered values and texts are in order of rank, and what the root says all hear") {
  const World& world = ranks::world();
  CHECK(world.gather(0.5 * world.rank()) == std::vector<double>{0.0, 0.5, 1.0, 1.5});
  const std::string text = world.rank() == 2 ? "" : std::string(static_cast<std::size_t>(world.rank() + 1), 'x');
  const auto texts = world.gather_at_root(text);
  if (world.is_root())
    CHECK(texts == std::vector<std::string>{"x", "xx", "", "xxxx"});
  else
    CHECK(texts.empty());
  std::string said = world.rank() == 3 ? "from the last" : "something longer that is to be forgotten";
  world.broadcast(said, 3);
  CHECK(said == "from the last");
  std::vector<std::byte> bytes(world.is_root() ? 0 : 5);
  world.broadcast(bytes);
  CHECK(bytes.empty());
}

TEST_CASE("of what several ranks have to say all hear the first, and nothing where none has") {
  const World& world = ranks::world();
  CHECK(first_text(world, "").empty());
  const int last = world.size() - 1;
  CHECK(first_text(world, world.rank() == last ? "the last" : "") == "the last");
  CHECK(first_text(world, world.rank() > 0 ? "rank " + std::to_string(world.rank()) : "") == "rank 1");
}

TEST_CASE("parcels arrive whole, once, in order of rank and of sending, round after round without a pause") {
  const World& world = ranks::world();
  std::size_t n_arrived = 0, n_empty = 0;
  for (int round = 0; round < 300; ++round) {
    std::vector<Parcel> sent;
    for (int to = world.size() - 1; to >= 0; --to)
      for (int k = 0; k < parcels_between(world.rank(), to, round); ++k)
        sent.push_back({to, words(world.rank(), to, round, k)});
    const std::vector<Parcel> arrived = world.exchange(std::move(sent));
    std::size_t at = 0;
    for (int from = 0; from < world.size(); ++from)
      for (int k = 0; k < parcels_between(from, world.rank(), round); ++k, ++at) {
        REQUIRE(at < arrived.size());
        REQUIRE(arrived[at].rank == from);
        REQUIRE(arrived[at].bytes == words(from, world.rank(), round, k));
        n_empty += arrived[at].bytes.empty();
      }
    REQUIRE(at == arrived.size());
    n_arrived += at;
  }
  CHECK(n_arrived > 100);
  CHECK(n_empty > 10);
}

TEST_CASE("the first ranks are a world of their own, and the others have none") {
  const World& world = ranks::world();
  for (const int n : {1, 2, 3, 4}) {
    const std::optional<World> part = world.first(n);
    REQUIRE(part.has_value() == (world.rank() < n));
    if (!part) continue;
    CHECK(part->size() == n);
    CHECK(part->rank() == world.rank());
    std::vector<std::int64_t> count = {1};
    part->sum(count);
    CHECK(count[0] == n);
    const auto arrived = part->exchange({{(part->rank() + 1) % n, {std::byte{5}}}});
    REQUIRE(arrived.size() == 1);
    CHECK(arrived[0].rank == (n == 1 ? 0 : (part->rank() + n - 1) % n));
  }
}

TEST_CASE("a halo carries messages of unequal sizes for a hundred rounds, and again after it was opened anew") {
  const World& world = ranks::world();
  Halo halo;
  CHECK(halo.size() == 0);
  halo.start();  // nothing
  halo.finish();
  std::uint64_t n_messages = 0, n_bytes = 0;
  for (const int odd_bytes : {0, 3}) {
    const std::vector<Halo::Link> links = links_of(world, odd_bytes);
    halo.open(world, links);
    REQUIRE(halo.size() == links.size());
    exchange_rounds(world, halo, links, 100);
    for (const Halo::Link& link : links) {
      n_messages += link.send_bytes > 0 ? 100 : 0;
      n_bytes += 100 * link.send_bytes;
    }
    CHECK(halo.n_messages() == n_messages);
    CHECK(halo.n_bytes() == n_bytes);
    CHECK(halo.waited() > 0.0);
  }
  halo.open(world, {});
  halo.start();
  halo.finish();
  CHECK(halo.n_messages() == n_messages);
}

TEST_CASE("a halo may be moved, and its buffers are aligned for doubles") {
  const World& world = ranks::world();
  const int other = world.rank() ^ 1;
  Halo first;
  first.open(world, {{other, 8, 8}});
  Halo second = std::move(first);
  second.outgoing(0)[0] = static_cast<std::byte>(world.rank());
  second.start();
  second.finish();
  CHECK(second.incoming(0)[0] == static_cast<std::byte>(other));
  CHECK(reinterpret_cast<std::uintptr_t>(second.outgoing(0).data()) % alignof(double) == 0);
}

TEST_CASE("the cuts are the same however the points lie on the ranks") {
  const World& world = ranks::world();
  CutSpace space;
  space.domain = {{0, 0, 0}, {1, 2, 3}};
  space.periodic = {true, false, false};
  space.cell_width = 0.05;
  std::vector<WeightedPoint> all, mine, scattered;
  for (std::uint64_t i = 0; i < 4000; ++i) {
    const auto u = [&](std::uint64_t draw) { return random_uniform(9, i, RandomPurpose::position, draw); };
    all.push_back({{u(0), 2.0 * u(1), 3.0 * u(2) * u(2)}, static_cast<float>(0.1 + u(3))});
    if (static_cast<int>(i % 4) == world.rank()) mine.push_back(all.back());
    if (world.rank() > 0 && static_cast<int>(i / 3000) + 1 == world.rank())
      scattered.push_back(all.back());  // none at 0 and 3
  }
  for (const int n_parts : {2, 4, 7, 64}) {
    const Subdomains alone = Subdomains::cut(World(), n_parts, all, space);
    CHECK(Subdomains::cut(world, n_parts, mine, space) == alone);
    CHECK(Subdomains::cut(world, n_parts, scattered, space) == alone);
  }
}
