// How ranks are placed and started, and what is left of mpirun's talk.
#include <catch2/catch.hpp>

#include "io/cli/launch.hpp"
#include "io/cli/layout.hpp"
#include "io/cli/mpirun_talk.hpp"

using namespace moraine;

namespace {

const std::string dashes(74, '-');

std::string notice(const std::string& text) { return dashes + '\n' + text + '\n' + dashes + '\n'; }

std::string options(const Layout& layout, const Place& place) {
  std::string line;
  for (const std::string& word : mpirun_options(layout, place)) line += (line.empty() ? "" : " ") + word;
  return line;
}

const std::string about_a_kill =
    notice("mpirun noticed that process rank 7 with PID 0 on node n12 exited on signal 11 (Segmentation fault).");

}  // namespace

TEST_CASE("ranks with CPUs of their own use them all, ranks that may run on the same ones share them") {
  CHECK(threads_for_each({{"a", {0, 1}}, {"a", {2, 3}}}) == 2);
  CHECK(threads_for_each({{"a", {0, 1, 2, 3}}, {"a", {0, 1, 2, 3}}}) == 2);
  CHECK(threads_for_each({{"a", {0, 1, 2, 3}}, {"b", {0, 1, 2, 3}}}) == 4);
  CHECK(threads_for_each({{"a", {0, 1, 2, 3}}, {"b", {0, 1}}}) == 2);
  CHECK(threads_for_each({{"a", {0}}, {"a", {0}}, {"a", {0}}}) == 1);
}

TEST_CASE("CPUs are crowded where more threads may run on them than they are") {
  const std::vector<RankCpus> apart = {{"a", {0, 1}}, {"a", {2, 3}}}, together = {{"a", {0, 1}}, {"a", {0, 1}}};
  CHECK_FALSE(are_crowded(apart, 2));
  CHECK(are_crowded(apart, 3));
  CHECK_FALSE(are_crowded(together, 1));
  CHECK(are_crowded(together, 2));
}

TEST_CASE(
    "ranks are bound to cores of their own where there are enough, to hardware threads where these are, else to none") {
  const Place place{8, 4, true, false};
  CHECK(options({2, 2}, place) == "-n 2 --map-by slot:PE=2 --bind-to core");
  CHECK(options({4, 2}, place) == "-n 4 --use-hwthread-cpus --map-by slot:PE=2 --bind-to hwthread");
  CHECK(options({9, 1}, place) == "-n 9 --oversubscribe --bind-to none --mca mpi_yield_when_idle 1");
  CHECK(options({2, 2}, {4, 4, false, false}) == "-n 2 --oversubscribe --bind-to none");
  CHECK(options({64, 2}, {4, 4, true, true}) == "-n 64 --map-by slot:PE=2 --bind-to core");
}

TEST_CASE(
    "mpirun's notices about the end of a job are dropped, however they are cut into pieces, and nothing else is") {
  const std::string before = "error: rank 3: bad\n  of two lines\n", after = "\r\x1b[K 12 %\n";
  const std::string own = notice("There are not enough slots available in the system");
  const std::string aside =
      "mpirun.openmpi: Forwarding signal 12 to job\n"
      "[n1:123] 2 more processes have sent help message help-mpi-api.txt / mpi-abort\n"
      "[n1:123] [[1755,0],0] ORTE_ERROR_LOG: Data unpack would read past end of buffer in file "
      "../../../orte/util/show_help.c at line 501\n"
      "[n1:123] [[1755,0],0] ORTE_ERROR_LOG: Data unpack had inadequate space in file "
      "../../../orte/util/show_help.c at line 501\n"
      "[n1:123] [[1755,0],0] ORTE_ERROR_LOG: Out of resource in file ../../../orte/util/show_help.c at line 507\n"
      "[n1:123] Read -1, expected 4080, errno = 3\n"
      "[n1:123] Set MCA parameter \"orte_base_help_aggregate\" to 0 to see all help / error messages\n";
  const std::string text = before + notice("MPI_ABORT was invoked on rank 3\nwith errorcode 1.") + own + aside +
                           about_a_kill + after + "mpirun: and this\n";
  for (std::size_t piece : {1u, 2u, 7u, 75u, 10000u}) {
    MpirunTalk talk;
    std::string shown;
    for (std::size_t at = 0; at < text.size(); at += piece) shown += talk.pass(text.substr(at, piece));
    shown += talk.rest();
    CHECK(shown == before + own + after + "mpirun: and this\n");
    REQUIRE(talk.killed());
    CHECK(talk.killed()->rank == 7);
    CHECK(talk.killed()->node == "n12");
    CHECK(talk.killed()->signal == 11);
  }
}

TEST_CASE("a line of progress is shown before it has an end, and a notice right after it is still seen") {
  MpirunTalk talk;
  CHECK(talk.pass("\r\x1b[K 12 %") == "\r\x1b[K 12 %");
  CHECK(talk.pass("\r\x1b[K 13 %") == "\r\x1b[K 13 %");
  CHECK(talk.pass(about_a_kill) == "");
  CHECK(talk.killed());
  CHECK(talk.rest() == "");
}

TEST_CASE("a notice that is cut off is shown when all is over, unless it is about the end") {
  MpirunTalk talk;
  CHECK(talk.pass(dashes + "\nIt looks like") == "");
  CHECK(talk.rest() == dashes + "\nIt looks like");
}

TEST_CASE("the sign that the ranks have found each other is heard and not shown, also within a notice of mpirun's") {
  const std::string sign = "moraine: the ranks have found each other\n";
  for (std::size_t size = 1; size <= sign.size(); ++size) {
    MpirunTalk talk;
    std::string shown;
    CHECK_FALSE(talk.are_ranks_up());
    for (std::size_t at = 0; at < sign.size(); at += size) shown += talk.pass(sign.substr(at, size));
    CHECK(talk.are_ranks_up());
    CHECK(shown + talk.rest() == "");
  }
  MpirunTalk within;
  const std::string shown = within.pass(dashes + "\nthere is\n" + sign + "a hole\n" + dashes + "\n");
  CHECK(within.are_ranks_up());
  CHECK(shown == notice("there is\na hole"));
}
