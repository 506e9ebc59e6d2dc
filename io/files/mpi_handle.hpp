// The ranks of a run as parallel HDF5 wants them: the one place outside comm that sees MPI.
#pragma once

#define OMPI_SKIP_MPICXX 1  // the C++ bindings that were removed from the standard
#include <mpi.h>

#include "comm/world.hpp"

namespace moraine {

/// Only where the world is not alone.
inline MPI_Comm mpi_handle(const World& world) { return *static_cast<const MPI_Comm*>(world.communicator()); }

/// Hints for files: none.
inline MPI_Info mpi_hints() { return MPI_INFO_NULL; }

}  // namespace moraine
