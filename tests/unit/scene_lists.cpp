#include <catch2/catch.hpp>
#include <vector>

#include "engine/particles/fill.hpp"
#include "engine/scene/lists.hpp"

using namespace moraine;

TEST_CASE("every row of a list belongs to one rank, which knows its number") {
  for (const std::uint64_t n_ranks : {1u, 2u, 3u, 7u})
    for (const std::uint64_t block : {1u, 4u, 1024u})
      for (const std::uint64_t n_rows : {1u, 9u, 5000u}) {
        std::uint64_t n_all = 0, most = 0;
        for (std::uint64_t rank = 0; rank < n_ranks; ++rank) {
          const ListShare share{rank, n_ranks, block};
          std::uint64_t n_held = 0;
          for (std::uint64_t row = 0; row < n_rows; ++row)
            if (share.has(row)) REQUIRE(share.row(n_held++) == row);
          n_all += n_held;
          most = std::max(most, n_held);
        }
        CHECK(n_all == n_rows);
        CHECK(most <= n_rows / n_ranks + block);
      }
}

TEST_CASE("a rank beyond those that share a list has none of its rows") {
  const ListShare none{2, 1, 4};
  CHECK(none.is_empty());
  for (std::uint64_t row = 0; row < 100; ++row) REQUIRE_FALSE(none.has(row));
  CHECK_FALSE(ListShare{}.is_empty());
}

TEST_CASE("the facts of a list are those of its grains, or those that its ranks agreed on") {
  ListedGrains list;
  list.has_radius = true;
  list.grains = {{{}, {3, 4, 0}, {}, 0.5, 2}, {{}, {}, {}, 0.25, 0}, {{}, {}, {}, 0.125, 2}};
  const ListFacts facts = facts_of(list);
  CHECK(facts.n_grains == 3);
  CHECK(facts.fastest == 5.0);
  CHECK(facts.sum_of_diameters == 1.75);
  REQUIRE(facts.of_material.size() == 3);
  CHECK(facts.of_material[0].n_grains == 1);
  CHECK(facts.of_material[1].n_grains == 0);
  CHECK(facts.of_material[2].n_grains == 2);
  CHECK(facts.of_material[2].smallest == 0.25);
  CHECK(facts.of_material[2].largest == 1.0);
  share_facts(World(), list);
  CHECK_FALSE(list.whole);

  list.whole = ListFacts{};
  list.whole->n_grains = 12;
  CHECK(facts_of(list).n_grains == 12);
}

TEST_CASE("the parts of a list give the grains, numbers and sizes of the whole") {
  Scene scene;
  scene.domain = {{0, 0, 0}, {1, 1, 1}};
  scene.materials = {{"glass", 2500.0}};
  for (int g = 0; g < 2; ++g) {
    ParticleGroup group;
    group.material = "glass";
    group.diameter.kind = SizeDistribution::Kind::uniform;
    group.diameter.low = 0.001;
    group.diameter.high = 0.002;
    ListedGrains list;
    for (int i = 0; i < 37 + g; ++i) list.grains.push_back({{0.1 + 0.02 * i, 0.3 * g + 0.2, 0.5}, {}, {}, 0.0, 0});
    group.fill = list;
    scene.particles.push_back(group);
  }
  const std::vector<GrainSeed> whole = make_grains(scene, 1);
  std::size_t n_seen = 0;
  for (std::uint64_t rank = 0; rank < 3; ++rank) {
    Scene part = scene;
    for (ParticleGroup& group : part.particles) {
      auto& list = std::get<ListedGrains>(group.fill);
      const std::vector<GrainSeed> all = list.grains;
      list.whole = facts_of(list);
      list.share = {rank, 3, 5};
      list.grains.clear();
      for (std::size_t row = 0; row < all.size(); ++row)
        if (list.share.has(row)) list.grains.push_back(all[row]);
    }
    CHECK(is_scattered(part));
    CHECK(count_grains(part) == 75);
    const auto [grains, gids] = deal_grains(part, 1, World());
    REQUIRE(gids.size() == grains.size());
    for (std::size_t i = 0; i < gids.size(); ++i) {
      CHECK(grains[i].position == whole.at(gids[i]).position);
      CHECK(grains[i].radius == whole.at(gids[i]).radius);
    }
    n_seen += gids.size();
  }
  CHECK(n_seen == whole.size());
}
