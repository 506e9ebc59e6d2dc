#include "comm/totals.hpp"

#include <algorithm>
#include <array>
#include <vector>

namespace moraine {

void total(const World& world, std::span<ExactSum> sums) {
  if (world.is_alone()) return;
  std::vector<std::int64_t> words;
  words.reserve(sums.size() * ExactSum::n_words);
  for (const ExactSum& sum : sums) {
    const auto own = sum.words();
    words.insert(words.end(), own.begin(), own.end());
  }
  world.sum(words);
  for (std::size_t k = 0; k < sums.size(); ++k) {
    std::array<std::int64_t, ExactSum::n_words> own;
    std::copy_n(words.begin() + static_cast<std::ptrdiff_t>(k * ExactSum::n_words), ExactSum::n_words, own.begin());
    sums[k] = ExactSum::from_words(own);
  }
}

}  // namespace moraine
