// Stencils of the pressure solver, a row along x at a time. The operator is
//   (M z)_c = sum over faces f of  w_f (z_c - z_beyond)
// with face weights w >= 0 at the low face of each cell. Rows are split by parity (split_rows.hpp); all that a kernel adds up it adds
// in an order that depends on nothing but the length of the row.
#pragma once

#include <array>
#include <cstdint>

#include "kernels/gas/split_rows.hpp"

namespace moraine {

/// The weights at the low faces of cells, by axis, of all rows of a block.
template <typename T>
using FaceWeights = std::array<const T*, 3>;

/// A row's place: where it starts in all arrays, and the parity of the cells of colour 0 in it.
struct Row {
  std::int64_t start = 0;
  int parity = 0;  // of the sum of its indices along y and z, in the whole grid
};

/// z = r / diagonal for the cells of a colour: the first sweep from z = 0. `inverse` is that of the diagonal, zero where there is no cell.
void relax_from_zero(const SplitRows& rows, Row row, int colour, const float* r, const float* inverse, float* z);

/// Gauss-Seidel on the cells of a colour: z = (r + sum w z_beyond) / diagonal. `wraps`: x is periodic, so that what lies behind the cells of
/// other rows are ghosts, which other threads may be writing; it is not read then.
void relax(const SplitRows& rows, Row row, int colour, bool wraps, FaceWeights<float> w, const float* r,
           const float* inverse, float* z);

/// r - M z on the cells of a colour; out_row is a row.
void residual(const SplitRows& rows, Row row, int colour, FaceWeights<float> w, const float* r, const float* z,
              float* out_row);

/// sum += row, for all values of a row.
void add_row(const SplitRows& rows, const float* row, float* sum);
/// A row of a coarse grid from the sum of the fine rows in it. `is_halved`: two fine cells along x are one coarse one.
void fold_row(const SplitRows& coarse, bool is_halved, const SplitRows& fine, const float* fine_row, float* coarse_row);
/// What the fine cells of a row get from their coarse cells, added to those of a colour. `spread` has room for coarse.row() values.
void prolong(const SplitRows& fine, Row row, int colour, bool is_halved, const SplitRows& coarse,
             const float* coarse_row, float* spread, float* z);

/// The values of one colour of a row become zero.
void clear_colour(const SplitRows& rows, Row row, int colour, float* values_row);

/// One over the diagonal of M for a row of cells; zero where all weights of a cell are.
void invert_diagonal(const SplitRows& rows, std::int64_t row, FaceWeights<float> w, float* inverse);

/// Weights of the faces along x of a coarse row, from the sum of the fine rows in it: those of the fine faces that coincide with a coarse
/// one, times the factor of each of the n + 1 coarse faces.
void pick_row(const SplitRows& coarse, bool is_halved, const SplitRows& fine, const float* fine_row,
              const float* factors, float* coarse_row);
/// values *= factor over a row.
void multiply_row(const SplitRows& rows, float factor, float* values);

/// q = M z, and zero where there is no cell.
template <typename T>
void apply_operator(const SplitRows& rows, std::int64_t row, FaceWeights<double> w, const T* z, double* q);

/// Sum of a z over a row; values that are no cells' must be zero in a.
template <typename T>
double dot_row(const SplitRows& rows, const T* a_row, const float* z_row);

/// x += alpha d, r -= alpha q over a row, `scaled` = scale r in float; the largest |r|.
double step_row(const SplitRows& rows, double alpha, double scale, const float* d, const double* q, double* x,
                double* r, float* scaled);
/// The largest |r| of a row.
double largest(const SplitRows& rows, const double* r);
/// d = scale z + beta d over a row.
void turn_row(const SplitRows& rows, float scale, float beta, const float* z, float* d);
/// r * scale in float over a row.
void scale_row(const SplitRows& rows, double scale, const double* r, float* scaled);
/// A row of plain values, x from 0 to n - 1, to a split one and back.
void split_row(const SplitRows& rows, const double* plain, double factor, double* row);
void join_row(const SplitRows& rows, const double* row, double* plain);
/// Weights in double as they are used in float: small ones do not vanish.
void round_weights(const SplitRows& rows, const double* row, float* rounded);
/// values += addend where `inverse` is not zero, = 0 where it is.
void shift_row(const SplitRows& rows, double addend, const float* inverse_row, double* row);
/// r -= q over a row.
void subtract_row(const SplitRows& rows, const double* q, double* r);
/// Sum of a row.
double sum_row(const SplitRows& rows, const double* row);
/// Copies the ghosts at both ends of a row from the cells at its other end.
template <typename T>
void wrap_row(const SplitRows& rows, T* row) {
  const int n = rows.n(0);
  row[rows.in_row(-1)] = row[rows.in_row(n - 1)];
  row[rows.in_row(n)] = row[rows.in_row(0)];
}

}  // namespace moraine
