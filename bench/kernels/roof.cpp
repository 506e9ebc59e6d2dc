#include "bench/kernels/roof.hpp"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <thread>
#include <type_traits>
#include <vector>

#include "bench/kernels/meter.hpp"
#include "engine/particles/aligned_array.hpp"
#include "engine/threads.hpp"

#if defined(__x86_64__)
#define MORAINE_BENCH_WIDE __attribute__((target("avx512f,prefer-vector-width=512")))
#endif

namespace moraine::bench {

namespace {

constexpr int n_rounds = 1 << 14;
/// `n_sums` independent chains of multiply-adds: enough to hide their latency, few enough to stay in registers.
template <typename Vector, int n_sums>
[[gnu::always_inline]] inline double multiply_add_rounds(double scale) {
  using Lane = std::remove_cvref_t<decltype(Vector{}[0])>;
  Vector sums[n_sums];
  for (int k = 0; k < n_sums; ++k) sums[k] = Vector{} + static_cast<Lane>(1e-3 * k);
  const Vector s = Vector{} + static_cast<Lane>(scale), t = Vector{} + static_cast<Lane>(1e-9);
  for (int round = 0; round < n_rounds; ++round)
#pragma GCC unroll 16
    for (int k = 0; k < n_sums; ++k) sums[k] = sums[k] * s + t;
  Vector total{};
  for (int k = 0; k < n_sums; ++k) total += sums[k];
  return static_cast<double>(total[0]);
}
[[gnu::always_inline]] inline void triad_loop(double* a, const double* b, const double* c, double s, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i) a[i] = b[i] + s * c[i];
}

using Narrow = double __attribute__((vector_size(32)));
using NarrowFloat = float __attribute__((vector_size(32)));
double narrow_rounds(double scale) { return multiply_add_rounds<Narrow, 12>(scale); }
double narrow_float_rounds(double scale) { return multiply_add_rounds<NarrowFloat, 12>(scale); }
void narrow_triad(double* a, const double* b, const double* c, double s, std::size_t n) { triad_loop(a, b, c, s, n); }
#if defined(MORAINE_BENCH_WIDE)
using Wide = double __attribute__((vector_size(64)));
using WideFloat = float __attribute__((vector_size(64)));
MORAINE_BENCH_WIDE double wide_rounds(double scale) { return multiply_add_rounds<Wide, 16>(scale); }
MORAINE_BENCH_WIDE double wide_float_rounds(double scale) { return multiply_add_rounds<WideFloat, 16>(scale); }
MORAINE_BENCH_WIDE void wide_triad(double* a, const double* b, const double* c, double s, std::size_t n) {
  triad_loop(a, b, c, s, n);
}
#endif

bool is_wide() {
#if defined(MORAINE_BENCH_WIDE)
  return __builtin_cpu_supports("avx512f") != 0;
#else
  return false;
#endif
}

/// Operations of one call.
double multiply_add(bool is_float) {
  double scale = 0.999999;
  benchmark::DoNotOptimize(scale);
  const double lanes = is_float ? 2.0 : 1.0;  // times as many
#if defined(MORAINE_BENCH_WIDE)
  if (is_wide()) {
    benchmark::DoNotOptimize(is_float ? wide_float_rounds(scale) : wide_rounds(scale));
    return 2.0 * 16 * 8 * lanes * n_rounds;
  }
#endif
  benchmark::DoNotOptimize(is_float ? narrow_float_rounds(scale) : narrow_rounds(scale));
  return 2.0 * 12 * 4 * lanes * n_rounds;
}

void triad(double* a, const double* b, const double* c, std::size_t n) {
  double s = 3.0;
  benchmark::DoNotOptimize(s);
#if defined(MORAINE_BENCH_WIDE)
  if (is_wide()) return wide_triad(a, b, c, s, n);
#endif
  narrow_triad(a, b, c, s, n);
}

/// Best rate of a few attempts of `time` seconds, of all threads together; pass(thread) returns what it has done.
template <typename Prepare, typename Pass>
double best_rate(int n_threads, Prepare prepare, Pass pass) {
  constexpr int n_attempts = 4;
  constexpr double time = 0.04;
  std::vector<double> done(static_cast<std::size_t>(n_threads)), taken(static_cast<std::size_t>(n_threads));
  double best = 0.0;
  parallel(n_threads, [&](int thread) {
    const auto mine = static_cast<std::size_t>(thread);
    auto data = prepare();
    pass(data);
    for (int attempt = 0; attempt < n_attempts; ++attempt) {
      barrier();
      const double start = clock_seconds(n_threads);
      done[mine] = 0.0;
      do {
        done[mine] += pass(data);
        taken[mine] = clock_seconds(n_threads) - start;
      } while (taken[mine] < time);
      barrier();
      if (thread == 0) {
        double rate = 0.0;
        for (std::size_t k = 0; k < done.size(); ++k) rate += done[k] / taken[k];
        best = std::max(best, rate);
      }
    }
  });
  return best;
}

/// Bytes/s of a[i] = b[i] + s c[i], 24 bytes an element, the arrays of each thread together so many bytes.
double triad_rate(int n_threads, std::size_t bytes) {
  const std::size_t n = bytes / 24 / 8 * 8;
  const auto prepare = [n] {
    std::array<AlignedArray<double>, 3> arrays;
    for (auto& array : arrays) {
      array.resize_discarding(n);
      std::fill(array.begin(), array.end(), 1.0);  // by the thread that will use it
    }
    return arrays;
  };
  return best_rate(n_threads, prepare, [n](auto& arrays) {
    triad(arrays[0].data(), arrays[1].data(), arrays[2].data(), n);
    benchmark::ClobberMemory();
    return 24.0 * static_cast<double>(n);
  });
}

/// Bytes of the largest data cache of a level; what sysconf says of L3 is that of all sockets' parts on some machines.
std::size_t cache_size(int level, std::size_t otherwise) {
  std::size_t size = 0;
  for (const auto& cache : benchmark::CPUInfo::Get().caches)
    if (cache.level == level && cache.type != "Instruction")
      size = std::max(size, static_cast<std::size_t>(cache.size));
  return size > 0 ? size : otherwise;
}

Roof measure() {
  Roof roof;
  roof.n_threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  roof.l2 = cache_size(2, std::size_t{1} << 20);
  roof.l3 = std::max(cache_size(3, std::size_t{16} << 20), 2 * roof.l2);
  for (const int threads : {1, roof.n_threads}) {
    const auto n = static_cast<std::size_t>(threads);
    Ceiling& ceiling = threads == 1 ? roof.one : roof.all;
    for (const bool is_float : {false, true})
      (is_float ? ceiling.float_flops : ceiling.flops) = best_rate(
          threads, [] { return 0; }, [is_float](int) { return multiply_add(is_float); });
    const std::size_t large = std::min(std::max(std::size_t{256} << 20, 4 * roof.l3), std::size_t{1} << 30);
    ceiling.bandwidth = {triad_rate(threads, roof.l2 / 2),
                         triad_rate(threads, std::max(roof.l3 / (3 * n), 2 * roof.l2)), triad_rate(threads, large / n)};
  }
  if (roof.n_threads == 1) roof.all = roof.one;
  return roof;
}

}  // namespace

Level Roof::level(double bytes, int threads) const {
  if (bytes <= static_cast<double>(l2) * threads) return Level::l2;
  return bytes <= static_cast<double>(l3) ? Level::l3 : Level::memory;
}

const Roof& roof() {
  static const Roof measured = measure();
  return measured;
}

}  // namespace moraine::bench
