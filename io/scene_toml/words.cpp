#include "io/scene_toml/words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <numbers>
#include <numeric>

namespace moraine::scene_toml {

// Optimal string alignment (Damerau 1964, Levenshtein 1966).
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> before, above(b.size() + 1), row(b.size() + 1);
  std::iota(above.begin(), above.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      row[j] = std::min({above[j] + 1, row[j - 1] + 1, above[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1)});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) row[j] = std::min(row[j], before[j - 2] + 1);
    }
    before = above;
    above = row;
  }
  return above.back();
}

std::optional<std::string> nearest_word(std::string_view word, const std::vector<std::string>& candidates) {
  std::optional<std::string> best;
  std::size_t least = std::max<std::size_t>(2, (word.size() + 1) / 3) + 1;
  for (const std::string& candidate : candidates) {
    const std::size_t distance = edit_distance(word, candidate);
    // A word of which nothing is left is not near, however short it is.
    if (distance >= least || distance >= std::max(candidate.size(), word.size()) - 1) continue;
    least = distance;
    best = candidate;
  }
  return best;
}

std::string quoted_list(const std::vector<std::string>& words, std::string_view last) {
  std::string all;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (i > 0) all += i + 1 == words.size() ? fmt::format(" {} ", last) : ", ";
    all += fmt::format("\"{}\"", words[i]);
  }
  return all;
}

std::string comma_list(const std::vector<std::string>& words) {
  std::string all;
  for (const std::string& word : words) all += (all.empty() ? "" : ", ") + word;
  return all;
}

namespace {

struct Unit {
  std::string_view name;
  std::string_view si;
  double factor;
};
constexpr Unit units[] = {
    {"nm", "m", 1e-9},
    {"um", "m", 1e-6},
    {"µm", "m", 1e-6},
    {"μm", "m", 1e-6},
    {"mm", "m", 1e-3},
    {"cm", "m", 1e-2},
    {"dm", "m", 1e-1},
    {"km", "m", 1e3},
    {"in", "m", 0.0254},
    {"ns", "s", 1e-9},
    {"us", "s", 1e-6},
    {"µs", "s", 1e-6},
    {"μs", "s", 1e-6},
    {"ms", "s", 1e-3},
    {"min", "s", 60.0},
    {"h", "s", 3600.0},
    {"mg", "kg", 1e-6},
    {"g", "kg", 1e-3},
    {"t", "kg", 1e3},
    {"kPa", "Pa", 1e3},
    {"MPa", "Pa", 1e6},
    {"GPa", "Pa", 1e9},
    {"bar", "Pa", 1e5},
    {"N/m2", "Pa", 1.0},
    {"N/m^2", "Pa", 1.0},
    {"N/mm2", "Pa", 1e6},
    {"mN/m", "N/m", 1e-3},
    {"N/mm", "N/m", 1e3},
    {"kN/m", "N/m", 1e3},
    {"MN/m", "N/m", 1e6},
    {"kN/mm", "N/m", 1e6},
    {"kg/m^3", "kg/m3", 1.0},
    {"g/cm3", "kg/m3", 1e3},
    {"g/cm^3", "kg/m3", 1e3},
    {"g/cc", "kg/m3", 1e3},
    {"t/m3", "kg/m3", 1e3},
    {"mm/s", "m/s", 1e-3},
    {"cm/s", "m/s", 1e-2},
    {"km/h", "m/s", 1.0 / 3.6},
    {"m/s^2", "m/s2", 1.0},
    {"g", "m/s2", 9.80665},
    {"cm/s2", "m/s2", 1e-2},
    {"mm/s2", "m/s2", 1e-3},
    {"1/s", "rad/s", 1.0},
    {"rpm", "rad/s", 2.0 * std::numbers::pi / 60.0},
    {"deg/s", "rad/s", std::numbers::pi / 180.0},
    {"Hz", "1/s", 1.0},
    {"1/min", "1/s", 1.0 / 60},
    {"%", "-", 1e-2},
    {"Ns/m", "N s/m", 1.0},
};

}  // namespace

std::optional<double> in_si(std::string_view text, std::string_view si_unit) {
  const auto trim = [&] {
    while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
    while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  };
  trim();
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc()) return std::nullopt;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  trim();
  if (text.size() > 2 && text.front() == '[' && text.back() == ']') text = text.substr(1, text.size() - 2);
  if (text.empty() || text == si_unit) return value;
  for (const Unit& unit : units)
    if (unit.name == text && unit.si == si_unit) return value * unit.factor;
  return std::nullopt;
}

std::string toml_number(double value) {
  if (std::isnan(value)) return "nan";
  if (std::isinf(value)) return value > 0 ? "inf" : "-inf";
  std::string text = fmt::format("{}", value);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

std::string toml_string(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\')
      out += fmt::format("\\{}", c);
    else if (c == '\n')
      out += "\\n";
    else if (c == '\t')
      out += "\\t";
    else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f)
      out += fmt::format("\\u{:04X}", static_cast<unsigned>(static_cast<unsigned char>(c)));
    else
      out += c;
  }
  return out + "\"";
}

}  // namespace moraine::scene_toml
