// MPI for the sources of comm; nobody else includes it.
#pragma once

#define OMPI_SKIP_MPICXX 1  // the C++ bindings that were removed from the standard
#include <mpi.h>

#include "comm/world.hpp"

namespace moraine {

/// Only where the world is not alone.
inline MPI_Comm communicator_of(const World& world) { return *static_cast<const MPI_Comm*>(world.communicator()); }

}  // namespace moraine
