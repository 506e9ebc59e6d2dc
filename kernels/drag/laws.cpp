#include "kernels/drag/laws.hpp"

#include <cmath>

#include "kernels/drag/elementary.hpp"

namespace moraine {

namespace {

// Symbols: eps void fraction, phi = 1 - eps, re = Re. Everything is computed on both sides of every case and then chosen, so that
// loops run in lanes; least_re keeps powers of Re finite without a trace in F.
constexpr double least_re = 1e-12, least_phi = 1e-12;

/// Cd Re/24 of a lone sphere (Schiller & Naumann 1935).
inline double lone_sphere(double re) {
  const double low = 1.0 + 0.15 * elementary::pow(std::max(re, least_re), 0.687);
  const double high = (0.44 / 24.0) * re;
  return re <= 1000.0 ? low : high;
}

struct SchillerNaumann {
  static double factor(double eps, double re) { return lone_sphere(re / eps) / eps; }
};

struct WenYu {
  static double factor(double eps, double re) { return lone_sphere(re) * elementary::pow(eps, -3.65); }
};

struct Ergun {
  static double factor(double eps, double re) { return (150.0 * (1.0 - eps) + 1.75 * re) / (18.0 * eps * eps); }
};

struct Gidaspow {
  static double factor(double eps, double re) {
    const double dense = Ergun::factor(eps, re), dilute = WenYu::factor(eps, re);
    return eps < 0.8 ? dense : dilute;
  }
};

struct DiFelice {
  static double factor(double eps, double re) {
    constexpr double log_10 = 2.302585092994045684;
    const double root = 0.63 * std::sqrt(re) + 4.8;  // sqrt(Cd Re)
    const double x = 1.5 - elementary::log(std::max(re, least_re)) / log_10;
    const double xi = 3.7 - 0.65 * elementary::exp(-0.5 * x * x);
    return root * root / 24.0 * elementary::exp(-xi * elementary::log(eps));
  }
};

struct SyamlalOBrien {
  static double factor(double eps, double re) {
    const double re_s = re / eps, x = 0.06 * re_s, log_eps = elementary::log(eps);
    const double a = elementary::exp(4.14 * log_eps);
    const double dense = 0.8 * elementary::exp(1.28 * log_eps), dilute = elementary::exp(2.65 * log_eps);
    const double b = eps <= 0.85 ? dense : dilute;
    const double v = 0.5 * (a - x + std::sqrt(x * x + 2.0 * x * (2.0 * b - a) + a * a));
    const double root = 0.63 * std::sqrt(re_s) + 4.8 * std::sqrt(v);  // sqrt(Cd Re_s)
    return root * root / (24.0 * v * v);
  }
};

struct Beetstra {
  static double factor(double eps, double re) {
    constexpr double log_1000 = 6.907755278982137052;
    const double phi = 1.0 - eps, e2 = eps * eps, log_re = elementary::log(std::max(re, least_re));
    const double bracket = 1.0 / eps + 3.0 * eps * phi + 8.4 * elementary::exp(-0.343 * log_re);
    const double below = 1.0 + elementary::exp(log_1000 * phi - (0.5 + 2.0 * phi) * log_re);
    return 10.0 * phi / e2 + e2 * (1.0 + 1.5 * std::sqrt(phi)) + 0.413 * re / (24.0 * e2) * bracket / below;
  }
};

/// F0 to F3 as functions of phi, then by Re of the radius; F = eps (the paper's), as its Stokes drag has eps^2.
struct KochHill {
  static double factor(double eps, double re) {
    const double phi = std::max(1.0 - eps, least_phi), r = 0.5 * re;
    const double packed = 10.0 * phi / (eps * eps * eps);
    const double w = elementary::exp(-10.0 * (0.4 - phi) / phi);
    const double top = 1.0 + 3.0 * std::sqrt(0.5 * phi) + 135.0 / 64.0 * phi * elementary::log(phi);
    const double dilute_0 = (top + 17.14 * phi) / (1.0 + phi * (0.681 + phi * (-8.48 + 8.16 * phi)));
    const double dilute_2 = (top + 17.89 * phi) / (1.0 + phi * (0.681 + phi * (-11.03 + 15.41 * phi)));
    const double f0 = phi < 0.4 ? (1.0 - w) * dilute_0 + w * packed : packed;
    const double f2 = phi < 0.4 ? (1.0 - w) * dilute_2 + w * packed : packed;
    const double thin_1 = std::sqrt(2.0 / phi) / 40.0, thick_1 = 0.11 + 0.00051 * elementary::exp(11.6 * phi);
    const double f1 = phi <= 0.1 ? thin_1 : thick_1;
    const double thin_3 = 0.9351 * phi + 0.03667;
    const double thick_3 = 0.0673 + 0.212 * phi + 0.0232 / (eps * eps * eps * eps * eps);
    const double f3 = phi < 0.0953 ? thin_3 : thick_3;
    const double lone_change = (f2 - 1.0) / (0.375 - f3);
    const double change = (f3 + std::sqrt(std::max(f3 * f3 - 4.0 * f1 * (f0 - f2), 0.0))) / (2.0 * f1);
    const double lone = r <= lone_change ? 1.0 + 0.375 * r : f2 + f3 * r;
    const double among = r <= change ? f0 + f1 * r * r : f2 + f3 * r;
    return eps * (phi <= 0.01 ? lone : among);
  }
};

template <typename Law>
void coefficients(bool is_b, const GasProperties& gas, std::int64_t n, const double* __restrict__ void_fraction,
                  const double* __restrict__ slip, const double* __restrict__ radius,
                  double* __restrict__ coefficient) {
  constexpr double six_pi = 18.849555921538759;
  const double stokes = six_pi * gas.viscosity, re_factor = 2.0 * gas.density / gas.viscosity;
  for (std::int64_t i = 0; i < n; ++i) {
    const double eps = void_fraction[i];
    const double f = Law::factor(eps, re_factor * eps * slip[i] * radius[i]);
    coefficient[i] = stokes * radius[i] * (is_b ? 1.0 : eps) * f;
  }
}

/// Calls f(law) with the law's type.
template <typename Function>
auto with_law(DragLaw law, Function f) {
  switch (law) {
    case DragLaw::schiller_naumann: return f(SchillerNaumann{});
    case DragLaw::wen_yu: return f(WenYu{});
    case DragLaw::ergun: return f(Ergun{});
    case DragLaw::gidaspow: return f(Gidaspow{});
    case DragLaw::di_felice: return f(DiFelice{});
    case DragLaw::syamlal_obrien: return f(SyamlalOBrien{});
    case DragLaw::beetstra: return f(Beetstra{});
    case DragLaw::koch_hill: break;
  }
  return f(KochHill{});
}

}  // namespace

double drag_factor(DragLaw law, double void_fraction, double reynolds) {
  return with_law(law, [&](auto kind) { return decltype(kind)::factor(void_fraction, reynolds); });
}

void drag_coefficients(DragLaw law, GasModel model, const GasProperties& gas, std::int64_t n,
                       const double* void_fraction, const double* slip, const double* radius, double* coefficient) {
  with_law(law, [&](auto kind) {
    coefficients<decltype(kind)>(model == GasModel::b, gas, n, void_fraction, slip, radius, coefficient);
  });
}

}  // namespace moraine
