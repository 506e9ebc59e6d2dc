#include "kernels/gas/pressure.hpp"

#include <algorithm>
#include <cmath>

namespace moraine {

namespace {

// Loops over a row never read what they write elsewhere in it ("ivdep"): what they read is of other rows, or of the other parity.
constexpr int lanes = SplitRows::lanes;
// Rows have whole ones.
constexpr int half_lanes = lanes / 2;
using Lanes [[gnu::vector_size(half_lanes * sizeof(double)), gnu::aligned(alignof(double)), gnu::may_alias]] = double;

/// Where the cells of one parity of a row, their neighbours and faces begin in the arrays.
struct Half {
  std::int64_t at;      // the cells, and their low faces in all directions
  std::int64_t x_low;   // neighbours along x
  std::int64_t x_high;  // also: their low faces, the cells' high ones
  std::int64_t y_stride, z_stride;
  int n;       // cells
  int n_room;  // up to whole vectors
};

Half half_of(const SplitRows& rows, std::int64_t start, bool is_odd) {
  const std::int64_t even = start, odd = start + rows.odd();
  if (is_odd) return {odd, even, even + 1, rows.row(), rows.plane(), rows.n_odd(), rows.half()};
  return {even, odd - 1, odd, rows.row(), rows.plane(), rows.n_even(), rows.half()};
}

double sum_of(const double (&s)[lanes]) { return ((s[0] + s[4]) + (s[1] + s[5])) + ((s[2] + s[6]) + (s[3] + s[7])); }

bool is_odd(Row row, int colour) { return ((row.parity + colour) & 1) != 0; }

}  // namespace

void relax_from_zero(const SplitRows& rows, Row row, int colour, const float* r, const float* inverse, float* z) {
  const Half h = half_of(rows, row.start, is_odd(row, colour));
  const float* __restrict__ from = r + h.at;
  const float* __restrict__ inv = inverse + h.at;
  float* __restrict__ to = z + h.at;
#pragma GCC ivdep
  for (int m = 0; m < h.n_room; ++m) to[m] = from[m] * inv[m];
}

void relax(const SplitRows& rows, Row row, int colour, bool wraps, FaceWeights<float> w, const float* r,
           const float* inverse, float* z) {
  const Half h = half_of(rows, row.start, is_odd(row, colour));
  const int n = wraps ? h.n : h.n_room;
  const float* __restrict__ rhs = r + h.at;
  const float* __restrict__ inv = inverse + h.at;
  const float* __restrict__ xl = z + h.x_low, * __restrict__ xh = z + h.x_high;
  const float* __restrict__ yl = z + h.at - h.y_stride, * __restrict__ yh = z + h.at + h.y_stride;
  const float* __restrict__ zl = z + h.at - h.z_stride, * __restrict__ zh = z + h.at + h.z_stride;
  const float* __restrict__ wxl = w[0] + h.at, * __restrict__ wxh = w[0] + h.x_high;
  const float* __restrict__ wyl = w[1] + h.at, * __restrict__ wyh = w[1] + h.at + h.y_stride;
  const float* __restrict__ wzl = w[2] + h.at, * __restrict__ wzh = w[2] + h.at + h.z_stride;
  float* __restrict__ to = z + h.at;
#pragma GCC ivdep
  for (int m = 0; m < n; ++m) {
    const float x = wxl[m] * xl[m] + wxh[m] * xh[m], y = wyl[m] * yl[m] + wyh[m] * yh[m];
    to[m] = (rhs[m] + (x + (y + (wzl[m] * zl[m] + wzh[m] * zh[m])))) * inv[m];
  }
  std::fill(to + n, to + h.n_room, 0.0F);
}

void residual(const SplitRows& rows, Row row, int colour, FaceWeights<float> w, const float* r, const float* z,
              float* out_row) {
  const bool odd = is_odd(row, colour);
  const Half h = half_of(rows, row.start, odd);
  const float* __restrict__ rhs = r + h.at;
  const float* __restrict__ own = z + h.at;
  const float* __restrict__ xl = z + h.x_low, * __restrict__ xh = z + h.x_high;
  const float* __restrict__ yl = own - h.y_stride, * __restrict__ yh = own + h.y_stride;
  const float* __restrict__ zl = own - h.z_stride, * __restrict__ zh = own + h.z_stride;
  const float* __restrict__ wxl = w[0] + h.at, * __restrict__ wxh = w[0] + h.x_high;
  const float* __restrict__ wyl = w[1] + h.at, * __restrict__ wyh = w[1] + h.at + h.y_stride;
  const float* __restrict__ wzl = w[2] + h.at, * __restrict__ wzh = w[2] + h.at + h.z_stride;
  float* __restrict__ to = out_row + (odd ? rows.odd() : 0);
#pragma GCC ivdep
  for (int m = 0; m < h.n_room; ++m) {
    const float c = own[m];
    const float x = wxl[m] * (xl[m] - c) + wxh[m] * (xh[m] - c), y = wyl[m] * (yl[m] - c) + wyh[m] * (yh[m] - c);
    to[m] = rhs[m] + (x + (y + (wzl[m] * (zl[m] - c) + wzh[m] * (zh[m] - c))));
  }
  std::fill(to + h.n, to + h.n_room, 0.0F);
}

void clear_colour(const SplitRows& rows, Row row, int colour, float* values_row) {
  float* const from = values_row + (is_odd(row, colour) ? rows.odd() : 0);
  std::fill(from, from + rows.half(), 0.0F);
}

void invert_diagonal(const SplitRows& rows, std::int64_t row, FaceWeights<float> w, float* inverse) {
  constexpr float most = 1e30F;  // where weights nearly vanish
  for (const bool odd : {false, true}) {
    const Half h = half_of(rows, row, odd);
#pragma GCC ivdep
    for (int m = 0; m < h.n; ++m) {
      const std::int64_t at = h.at + m;
      const float x = w[0][at] + w[0][h.x_high + m], y = w[1][at] + w[1][at + h.y_stride];
      const float diagonal = x + (y + (w[2][at] + w[2][at + h.z_stride]));
      inverse[at] = diagonal > 0.0F ? std::min(1.0F / diagonal, most) : 0.0F;
    }
  }
}

void pick_row(const SplitRows& coarse, bool is_halved, const SplitRows& fine, const float* fine_row,
              const float* factors, float* coarse_row) {
  const int n = coarse.n(0);
  for (int i = 0; i <= n; ++i) {
    const int from = is_halved ? std::min(2 * i, fine.n(0)) : i;
    coarse_row[coarse.in_row(i)] = factors[i] * fine_row[fine.in_row(from)];
  }
}

void multiply_row(const SplitRows& rows, float factor, float* values) {
#pragma GCC ivdep
  for (int m = 0; m < rows.row(); ++m) values[m] *= factor;
}

void add_row(const SplitRows& rows, const float* row, float* sum) {
  const float* __restrict__ from = row;
  float* __restrict__ to = sum;
#pragma GCC ivdep
  for (int m = 0; m < rows.row(); ++m) to[m] += from[m];
}

void fold_row(const SplitRows& coarse, bool is_halved, const SplitRows& fine, const float* fine_row,
              float* coarse_row) {
  if (!is_halved) {
    std::copy(fine_row, fine_row + fine.row(), coarse_row);
    return;
  }
  const float* __restrict__ even = fine_row, * __restrict__ odd = fine_row + fine.odd();
  float* __restrict__ to_even = coarse_row, * __restrict__ to_odd = coarse_row + coarse.odd();
  const int n_pairs = coarse.n_odd();
#pragma GCC ivdep
  for (int m = 0; m < n_pairs; ++m) {
    to_even[m] = even[2 * m] + odd[2 * m];
    to_odd[m] = even[2 * m + 1] + odd[2 * m + 1];
  }
  if (coarse.n_even() > n_pairs) to_even[n_pairs] = even[2 * n_pairs] + odd[2 * n_pairs];
}

void prolong(const SplitRows& fine, Row row, int colour, bool is_halved, const SplitRows& coarse,
             const float* coarse_row, float* spread, float* z) {
  const bool odd = is_odd(row, colour);
  const Half h = half_of(fine, row.start, odd);
  const float* from = coarse_row + (odd ? coarse.odd() : 0);
  if (is_halved) {  // fine cells of both parities have the coarse cells in order
    const float* __restrict__ even = coarse_row, * __restrict__ high = coarse_row + coarse.odd();
    float* __restrict__ in_order = spread;
#pragma GCC ivdep
    for (int m = 0; m < coarse.n_even(); ++m) {
      in_order[2 * m] = even[m];
      in_order[2 * m + 1] = high[m];
    }
    from = spread;
  }
  const float* __restrict__ add = from;
  float* __restrict__ to = z + h.at;
#pragma GCC ivdep
  for (int m = 0; m < h.n; ++m) to[m] += add[m];
}

template <typename T>
void apply_operator(const SplitRows& rows, std::int64_t row, FaceWeights<double> w, const T* z, double* q) {
  for (const bool odd : {false, true}) {
    const Half h = half_of(rows, row, odd);
    const T* __restrict__ own = z + h.at;
    const T* __restrict__ xl = z + h.x_low, * __restrict__ xh = z + h.x_high;
    const T* __restrict__ yl = own - h.y_stride, * __restrict__ yh = own + h.y_stride;
    const T* __restrict__ zl = own - h.z_stride, * __restrict__ zh = own + h.z_stride;
    const double* __restrict__ wxl = w[0] + h.at, * __restrict__ wxh = w[0] + h.x_high;
    const double* __restrict__ wyl = w[1] + h.at, * __restrict__ wyh = w[1] + h.at + h.y_stride;
    const double* __restrict__ wzl = w[2] + h.at, * __restrict__ wzh = w[2] + h.at + h.z_stride;
    double* __restrict__ to = q + h.at;
#pragma GCC ivdep
    for (int m = 0; m < h.n_room; ++m) {
      const double c = static_cast<double>(own[m]);
      const double x = wxl[m] * (c - static_cast<double>(xl[m])) + wxh[m] * (c - static_cast<double>(xh[m]));
      const double y = wyl[m] * (c - static_cast<double>(yl[m])) + wyh[m] * (c - static_cast<double>(yh[m]));
      to[m] = x + (y + (wzl[m] * (c - static_cast<double>(zl[m])) + wzh[m] * (c - static_cast<double>(zh[m]))));
    }
    std::fill(to + h.n, to + h.n_room, 0.0);
  }
}
template void apply_operator(const SplitRows&, std::int64_t, FaceWeights<double>, const float*, double*);
template void apply_operator(const SplitRows&, std::int64_t, FaceWeights<double>, const double*, double*);

template <typename T>
double dot_row(const SplitRows& rows, const T* a_row, const float* z_row) {
  double sums[lanes] = {};
  for (int m = 0; m < rows.row(); m += lanes)
    for (int l = 0; l < lanes; ++l) sums[l] += static_cast<double>(a_row[m + l]) * static_cast<double>(z_row[m + l]);
  return sum_of(sums);
}
template double dot_row(const SplitRows&, const float*, const float*);
template double dot_row(const SplitRows&, const double*, const float*);

double largest(const SplitRows& rows, const double* r) {
  Lanes most{}, bad{};
  for (int m = 0; m < rows.row(); m += half_lanes) {
    const Lanes value = *reinterpret_cast<const Lanes*>(r + m);
    const Lanes size = value < 0.0 ? -value : value;
    most = most < size ? size : most;
    bad += 0.0 * value;  // not zero where anything is not finite
  }
  double largest_lane = 0.0, sum = 0.0;
  for (int l = 0; l < half_lanes; ++l) {
    largest_lane = std::max(largest_lane, most[l]);
    sum += bad[l];
  }
  return largest_lane + sum;
}

double step_row(const SplitRows& rows, double alpha, double scale, const float* d, const double* q, double* x,
                double* r, float* scaled) {
#pragma GCC ivdep
  for (int m = 0; m < rows.row(); ++m) {
    x[m] += alpha * static_cast<double>(d[m]);
    const double left = r[m] - alpha * q[m];
    r[m] = left;
    scaled[m] = static_cast<float>(scale * left);
  }
  return largest(rows, r);
}

void turn_row(const SplitRows& rows, float scale, float beta, const float* z, float* d) {
  const float* __restrict__ new_part = z;
  float* __restrict__ to = d;
#pragma GCC ivdep
  for (int m = 0; m < rows.row(); ++m) to[m] = scale * new_part[m] + beta * to[m];
}

void scale_row(const SplitRows& rows, double scale, const double* r, float* scaled) {
  const double* __restrict__ from = r;
  float* __restrict__ to = scaled;
#pragma GCC ivdep
  for (int m = 0; m < rows.row(); ++m) to[m] = static_cast<float>(from[m] * scale);
}

void split_row(const SplitRows& rows, const double* plain, double factor, double* row) {
  double* __restrict__ even = row, * __restrict__ odd = row + rows.odd();
#pragma GCC ivdep
  for (int m = 0; m < rows.n_odd(); ++m) {
    even[m] = factor * plain[2 * m];
    odd[m] = factor * plain[2 * m + 1];
  }
  if (rows.n_even() > rows.n_odd()) even[rows.n_odd()] = factor * plain[2 * rows.n_odd()];
}

void join_row(const SplitRows& rows, const double* row, double* plain) {
  const double* __restrict__ even = row, * __restrict__ odd = row + rows.odd();
#pragma GCC ivdep
  for (int m = 0; m < rows.n_odd(); ++m) {
    plain[2 * m] = even[m];
    plain[2 * m + 1] = odd[m];
  }
  if (rows.n_even() > rows.n_odd()) plain[2 * rows.n_odd()] = even[rows.n_odd()];
}

void round_weights(const SplitRows& rows, const double* row, float* rounded) {
  constexpr double least = 1e-30;
#pragma GCC ivdep
  for (int m = 0; m < rows.row(); ++m)
    rounded[m] = row[m] > 0.0 ? static_cast<float>(row[m] > least ? row[m] : least) : 0.0F;
}

void shift_row(const SplitRows& rows, double addend, const float* inverse_row, double* row) {
#pragma GCC ivdep
  for (int m = 0; m < rows.row(); ++m) row[m] = inverse_row[m] > 0.0F ? row[m] + addend : 0.0;
}

void subtract_row(const SplitRows& rows, const double* q, double* r) {
#pragma GCC ivdep
  for (int m = 0; m < rows.row(); ++m) r[m] -= q[m];
}

double sum_row(const SplitRows& rows, const double* row) {
  double sums[lanes] = {};
  for (int m = 0; m < rows.row(); m += lanes)
    for (int l = 0; l < lanes; ++l) sums[l] += row[m + l];
  return sum_of(sums);
}

}  // namespace moraine
