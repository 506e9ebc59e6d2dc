#include "tests/support/catch.hpp"

int main(int argc, char** argv) { return moraine::run_catch(argc, argv); }
