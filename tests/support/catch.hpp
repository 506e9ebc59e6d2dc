// Runs the tests of an executable.
#pragma once

namespace moraine {

/// Runs the test cases that the arguments of Catch's command line choose; the number of those that failed.
int run_catch(int argc, char** argv);

}  // namespace moraine
