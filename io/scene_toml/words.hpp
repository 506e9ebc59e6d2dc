// Names and quantities as people write them. Private to io/scene_toml.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace moraine::scene_toml {

/// Edits that turn one word into the other: insertions, deletions, replacements, swaps of neighbours.
std::size_t edit_distance(std::string_view a, std::string_view b);

/// The candidate nearest to `word`, if it is near enough to be what was meant.
std::optional<std::string> nearest_word(std::string_view word, const std::vector<std::string>& candidates);

/// "a", "b" and "c"
std::string quoted_list(const std::vector<std::string>& words, std::string_view last = "and");

/// a, b, c
std::string comma_list(const std::vector<std::string>& words);

/// A quantity given as text, such as "4 mm", in the SI unit asked for; none where it is not of that unit's kind.
std::optional<double> in_si(std::string_view text, std::string_view si_unit);

/// Shortest text that reads back to the same number, as TOML wants it (1.0, not 1).
std::string toml_number(double value);
/// In quotes, escaped.
std::string toml_string(std::string_view text);

}  // namespace moraine::scene_toml
