// The same pressure equation by HYPRE: conjugate gradients preconditioned by PFMG (Ashby & Falgout 1996), symmetric red-black.
#include <HYPRE_struct_ls.h>

#include "bench/gas/pressure.hpp"

namespace moraine::bench {

namespace {

/// The blocks that ranks get: whole along x, cut along z.
CellBlock block_of(const PressureProblem& problem, int rank, int n_ranks) {
  const int low = problem.n[2] * rank / n_ranks, high = problem.n[2] * (rank + 1) / n_ranks;
  return {{0, 0, low}, {problem.n[0], problem.n[1], high}};
}

}  // namespace

HypreTiming time_hypre(const PressureProblem& problem, double tolerance, int n_repeats) {
  int rank = 0, n_ranks = 1;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  MPI_Comm_size(MPI_COMM_WORLD, &n_ranks);
  HYPRE_Init();
  const CellBlock block = block_of(problem, rank, n_ranks);
  HYPRE_Int low[3], high[3];
  for (std::size_t a = 0; a < 3; ++a) {
    low[a] = block.low[a];
    high[a] = block.high[a] - 1;
  }
  HYPRE_StructGrid grid;
  HYPRE_StructGridCreate(MPI_COMM_WORLD, 3, &grid);
  HYPRE_StructGridSetExtents(grid, low, high);
  HYPRE_StructGridAssemble(grid);
  HYPRE_Int offsets[4][3] = {{0, 0, 0}, {-1, 0, 0}, {0, -1, 0}, {0, 0, -1}};
  HYPRE_StructStencil stencil;
  HYPRE_StructStencilCreate(3, 4, &stencil);
  for (HYPRE_Int s = 0; s < 4; ++s) HYPRE_StructStencilSetElement(stencil, s, offsets[s]);
  HYPRE_StructMatrix matrix;
  HYPRE_StructMatrixCreate(MPI_COMM_WORLD, grid, stencil, &matrix);
  HYPRE_StructMatrixSetSymmetric(matrix, 1);
  HYPRE_StructMatrixInitialize(matrix);
  std::vector<double> entries, rhs, zeros;
  for (int k = block.low[2]; k < block.high[2]; ++k)
    for (int j = block.low[1]; j < block.high[1]; ++j)
      for (int i = 0; i < problem.n[0]; ++i) {
        const std::array<int, 3> at{i, j, k};
        double diagonal = 0.0;
        std::array<double, 3> to_low{};
        for (std::size_t a = 0; a < 3; ++a) {
          std::array<int, 3> above = at;
          ++above[a];
          const double low_face = problem.coefficient(a, at);
          diagonal += low_face + problem.coefficient(a, above);
          to_low[a] = at[a] > 0 ? -low_face : 0.0;
        }
        entries.insert(entries.end(), {diagonal, to_low[0], to_low[1], to_low[2]});
        rhs.push_back(-problem.source(i, j, k));
      }
  zeros.assign(rhs.size(), 0.0);
  HYPRE_Int elements[4] = {0, 1, 2, 3};
  HYPRE_StructMatrixSetBoxValues(matrix, low, high, 4, elements, entries.data());
  HYPRE_StructMatrixAssemble(matrix);
  HYPRE_StructVector b, x;
  for (HYPRE_StructVector* v : {&b, &x}) {
    HYPRE_StructVectorCreate(MPI_COMM_WORLD, grid, v);
    HYPRE_StructVectorInitialize(*v);
  }
  HYPRE_StructVectorSetBoxValues(b, low, high, rhs.data());
  HYPRE_StructVectorAssemble(b);

  HypreTiming timing;
  for (int repeat = 0; repeat < n_repeats; ++repeat) {
    HYPRE_StructVectorSetBoxValues(x, low, high, zeros.data());
    HYPRE_StructVectorAssemble(x);
    HYPRE_StructSolver solver, preconditioner;
    HYPRE_StructPCGCreate(MPI_COMM_WORLD, &solver);
    HYPRE_StructPCGSetTol(solver, tolerance);
    HYPRE_StructPCGSetMaxIter(solver, 200);
    HYPRE_StructPCGSetTwoNorm(solver, 1);
    HYPRE_StructPFMGCreate(MPI_COMM_WORLD, &preconditioner);
    HYPRE_StructPFMGSetMaxIter(preconditioner, 1);
    HYPRE_StructPFMGSetTol(preconditioner, 0.0);
    HYPRE_StructPFMGSetZeroGuess(preconditioner);
    HYPRE_StructPFMGSetRelaxType(preconditioner, 2);  // red-black, symmetric
    HYPRE_StructPFMGSetNumPreRelax(preconditioner, 1);
    HYPRE_StructPFMGSetNumPostRelax(preconditioner, 1);
    HYPRE_StructPCGSetPrecond(solver, HYPRE_StructPFMGSolve, HYPRE_StructPFMGSetup, preconditioner);
    const double start = MPI_Wtime();
    HYPRE_StructPCGSetup(solver, matrix, b, x);
    const double between = MPI_Wtime();
    HYPRE_StructPCGSolve(solver, matrix, b, x);
    const double end = MPI_Wtime();
    double times[2] = {between - start, end - between};
    MPI_Allreduce(MPI_IN_PLACE, times, 2, MPI_DOUBLE, MPI_MAX, MPI_COMM_WORLD);
    HYPRE_Int iterations = 0;
    HYPRE_StructPCGGetNumIterations(solver, &iterations);
    timing.iterations = iterations;
    timing.set = repeat == 0 ? times[0] : std::min(timing.set, times[0]);
    timing.solve = repeat == 0 ? times[1] : std::min(timing.solve, times[1]);
    HYPRE_StructPCGDestroy(solver);
    HYPRE_StructPFMGDestroy(preconditioner);
  }
  HYPRE_StructVectorDestroy(x);
  HYPRE_StructVectorDestroy(b);
  HYPRE_StructMatrixDestroy(matrix);
  HYPRE_StructStencilDestroy(stencil);
  HYPRE_StructGridDestroy(grid);
  HYPRE_Finalize();
  return timing;
}

}  // namespace moraine::bench
