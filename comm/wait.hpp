// Waiting for MPI, inside comm: the only places where a rank stands still for another.
#pragma once

#include <span>

#include "comm/mpi.hpp"

namespace moraine {

/// Until the request, or all of them, are done, as patience() says.
void wait_for(MPI_Request request);
void wait_for_all(std::span<MPI_Request> requests);

/// For loops that ask for several things: called each time that nothing has come, with the number of times so far.
void be_patient(unsigned n_times);
/// What such a loop has waited [s].
void add_waited(double seconds);

}  // namespace moraine
