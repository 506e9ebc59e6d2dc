#include "io/export/colour_map.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace moraine {

namespace {

// Every sixteenth entry of matplotlib's table of 256; linear in between, which is closer than an eye can tell.
constexpr std::array<Colour, 17> table = {{
    {0.267004, 0.004874, 0.329415},
    {0.282327, 0.094955, 0.417331},
    {0.278826, 0.175490, 0.483397},
    {0.258965, 0.251537, 0.524736},
    {0.229739, 0.322361, 0.545706},
    {0.199430, 0.387607, 0.554642},
    {0.172719, 0.448791, 0.557885},
    {0.149039, 0.508051, 0.557250},
    {0.127568, 0.566949, 0.550556},
    {0.120638, 0.625828, 0.533488},
    {0.157851, 0.683765, 0.501686},
    {0.246070, 0.738910, 0.452024},
    {0.369214, 0.788888, 0.382914},
    {0.515992, 0.831158, 0.294279},
    {0.678489, 0.863742, 0.189503},
    {0.845561, 0.887322, 0.099702},
    {0.993248, 0.906157, 0.143936},
}};

// ColorBrewer's sequential scheme Blues (Harrower & Brewer 2003), five classes.
constexpr std::array<Colour, 5> blues = {{
    {0.937, 0.953, 1.0},
    {0.741, 0.843, 0.906},
    {0.420, 0.682, 0.839},
    {0.192, 0.510, 0.741},
    {0.031, 0.318, 0.612},
}};

template <std::size_t n>
Colour between(const std::array<Colour, n>& colours, double value) {
  const double at = std::clamp(std::isnan(value) ? 0.0 : value, 0.0, 1.0) * (n - 1);
  const auto low = std::min(static_cast<std::size_t>(at), n - 2);
  const double share = at - static_cast<double>(low);
  const auto mix = [&](double a, double b) { return a + share * (b - a); };
  return {mix(colours[low].red, colours[low + 1].red), mix(colours[low].green, colours[low + 1].green),
          mix(colours[low].blue, colours[low + 1].blue)};
}

}  // namespace

Colour viridis(double value) { return between(table, value); }
Colour pale_to_blue(double value) { return between(blues, value); }

}  // namespace moraine
