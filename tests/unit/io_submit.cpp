// The scripts of batch jobs: their text, and what goes into it.
#include <catch2/catch.hpp>
#include <sstream>

#include "io/cli/job_script.hpp"
#include "io/cli/programs.hpp"

using namespace moraine;

namespace {

Job small_job() {
  Job job;
  job.name = "bed";
  job.nodes = 2;
  job.layouts = {{8, 4}};
  job.memory = 1200;
  job.origin = "a test";
  job.program = "/opt/moraine";
  job.scene = "/scenes/bed.toml";
  job.out = "/runs/bed";
  job.script = "/runs/bed/job/submit.sh";
  return job;
}

/// The lines that start so, in their order.
std::vector<std::string> lines_with(const std::string& start, const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);)
    if (line.starts_with(start)) lines.push_back(line);
  return lines;
}

bool has_line(const std::string& text, const std::string& line) {
  return text.find('\n' + line + '\n') != std::string::npos;
}

}  // namespace

TEST_CASE("a time limit is read as Slurm reads it") {
  const auto hms = [](std::int64_t hours, std::int64_t minutes, std::int64_t seconds) {
    return (hours * 60 + minutes) * 60 + seconds;
  };
  for (const auto& [text, seconds] : {std::pair<const char*, std::int64_t>("90", hms(0, 90, 0)),
                                      {"1:30", 90},
                                      {"600:00", hms(10, 0, 0)},
                                      {"2:00:00", hms(2, 0, 0)},
                                      {"36:00:01", hms(36, 0, 1)},
                                      {"1-0", hms(24, 0, 0)},
                                      {"1-12", hms(36, 0, 0)},
                                      {"1-12:30", hms(36, 30, 0)},
                                      {"0-00:00:05", 5}})
    CHECK(parse_time_limit(text) == seconds);
}

TEST_CASE("what is no time limit is refused with the formats that there are") {
  for (const char* text : {"", "1h", "an hour", "-5", "1.5", "1:2:3:4", "1-", "-", "1-2:3:4:5", "1:", ":30", " 5", "5 ",
                           "1e3", "+5", "99999999999999999999"})
    CHECK_THROWS_WITH(parse_time_limit(text), Catch::StartsWith("--time \"" + std::string(text) + "\": ") &&
                                                  Catch::Contains("DAYS-HOURS:MINUTES:SECONDS"));
  CHECK_THROWS_WITH(parse_time_limit("0"), Catch::Contains("no time at all"));
  CHECK_THROWS_WITH(parse_time_limit("0-0:0:0"), Catch::Contains("no time at all"));
  for (const char* text : {"1:60", "1:00:60", "1:60:00", "1-24", "1-0:60"})
    CHECK_THROWS_WITH(parse_time_limit(text), Catch::Contains("there is no "));
}

TEST_CASE("a time limit is written so that it reads back to itself") {
  CHECK(time_limit_text(60) == "00:01:00");
  CHECK(time_limit_text(86399) == "23:59:59");
  CHECK(time_limit_text(86400) == "1-00:00:00");
  for (const std::int64_t seconds : {1, 59, 3600, 3661, 86399, 86400, 1'000'000})
    CHECK(parse_time_limit(time_limit_text(seconds)) == seconds);
}

TEST_CASE("memory is read in Slurm's units, and rounded up to MiB") {
  CHECK(parse_memory("4000") == 4000);
  CHECK(parse_memory("4000M") == 4000);
  CHECK(parse_memory("16G") == 16 * 1024);
  CHECK(parse_memory("2t") == 2 * 1024 * 1024);
  CHECK(parse_memory("1025K") == 2);
  CHECK(parse_memory("0") == 0);
  for (const char* text : {"", "G", "16GB", "16 G", "1.5G", "-1", "0x10", "16P"})
    CHECK_THROWS_WITH(parse_memory(text), Catch::Contains("expected a number with K, M, G or T"));
}

TEST_CASE("the memory asked for covers a node's share of the grains twice, and each of its ranks") {
  const auto in_bytes = [](std::int64_t mebibytes) { return static_cast<double>(mebibytes) * 1048576.0; };
  for (const int nodes : {1, 2, 16})
    for (const int ranks : {16, 64}) {
      const std::int64_t needed = memory_of_node(1e11, {ranks, 1}, nodes);
      CHECK(in_bytes(needed) > 2e11 / nodes);
      CHECK(in_bytes(needed) < 2e11 / nodes + ranks / nodes * 3e8 + 2e8);
      CHECK(needed > memory_of_node(1e11, {ranks / 2, 1}, nodes));
      CHECK(needed % 100 == 0);
    }
}

TEST_CASE("a job's name has no characters that a batch system would stumble over") {
  CHECK(job_name("deep_bed-2.5") == "deep_bed-2.5");
  CHECK(job_name("my bed; rm *") == "my_bed__rm__");
  CHECK(job_name("") == "moraine");
}

TEST_CASE("a Slurm job asks for its nodes, ranks, threads, memory and a signal, and for what was chosen beside them") {
  Job job = small_job();
  const std::string plain = job_script(job);
  CHECK(plain.starts_with("#!/bin/bash\n"));
  CHECK(lines_with("#SBATCH", plain) ==
        std::vector<std::string>{
            "#SBATCH --job-name=bed", "#SBATCH --nodes=2", "#SBATCH --ntasks=8", "#SBATCH --ntasks-per-node=4",
            "#SBATCH --cpus-per-task=4", "#SBATCH --threads-per-core=1", "#SBATCH --mem=1200M",
            "#SBATCH --output=/runs/bed/job/%j.out", "#SBATCH --signal=USR2@120", "#SBATCH --no-requeue"});
  job.time_limit = 36 * 3600;
  job.margin = 300;
  job.partition = "long";
  job.account = "sand";
  job.memory = 0;
  job.mpi = "pmi2";
  job.directives = {"qos=high", "--constraint=avx512", "-H"};
  const std::string full = job_script(job);
  for (const char* line :
       {"#SBATCH --time=1-12:00:00", "#SBATCH --signal=USR2@300", "#SBATCH --partition=long", "#SBATCH --account=sand",
        "#SBATCH --mem=0", "#SBATCH --qos=high", "#SBATCH --constraint=avx512", "#SBATCH -H"})
    CHECK(has_line(full, line));
  CHECK(full.find("srun --mpi=pmi2 ") != std::string::npos);
}

TEST_CASE("all directives come before the first command, where a batch system stops to read them") {
  for (const BatchSystem system : {BatchSystem::slurm, BatchSystem::pbs, BatchSystem::lsf}) {
    Job job = small_job();
    job.system = system;
    job.time_limit = 3600;
    job.directives = {"qos=high"};
    const std::string text = job_script(job);
    std::istringstream stream(text);
    std::string line;
    while (std::getline(stream, line) && (line.empty() || line[0] == '#')) continue;
    CHECK(line == "script=/runs/bed/job/submit.sh");
    while (std::getline(stream, line)) {
      for (const char* mark : {"#SBATCH", "#PBS", "#BSUB"}) CHECK_FALSE(line.starts_with(mark));
    }
  }
}

TEST_CASE("names with blanks, quotes and per cent signs are quoted for the directive and for the shell") {
  Job job = small_job();
  job.out = "/runs/50% \"sand\"";
  job.script = job.out / "job" / "submit.sh";
  job.overrides = {"title='it is $5'"};
  const std::string text = job_script(job);
  CHECK(has_line(text, "#SBATCH --output=\"/runs/50%% \\\"sand\\\"/job/%j.out\""));
  CHECK(has_line(text, "out='/runs/50% \"sand\"'"));
  CHECK(text.find("--set 'title='\\''it is $5'\\'''\n") != std::string::npos);
}

TEST_CASE("a line break cannot slip into a directive") {
  for (const auto spoil :
       {+[](Job& job) { job.partition = "a\n#SBATCH --mem=0"; }, +[](Job& job) { job.account = "a\tb"; },
        +[](Job& job) { job.directives = {"qos=a\nrm x"}; }, +[](Job& job) { job.mpi = "a\nb"; },
        +[](Job& job) { job.script = "/runs/a\nb/submit.sh"; }}) {
    Job job = small_job();
    spoil(job);
    CHECK_THROWS_WITH(job_script(job), Catch::Contains("control characters"));
  }
}

TEST_CASE("ranks that do not divide evenly over the nodes are refused with the numbers that would") {
  Job job = small_job();
  job.nodes = 3;
  CHECK_THROWS_WITH(job_script(job), Catch::Contains("8 ranks do not divide evenly over 3 nodes; take 6 or 9 ranks"));
  job.layouts = {{2, 4}};
  CHECK_THROWS_WITH(job_script(job), Catch::Contains("take 3 ranks"));
}

TEST_CASE("a time limit that the margin uses up is refused") {
  Job job = small_job();
  job.time_limit = 120;
  CHECK_THROWS_WITH(job_script(job), Catch::Contains("--margin") && Catch::Contains("120 s before"));
  job.time_limit = 121;
  CHECK_NOTHROW(job_script(job));
}

TEST_CASE("a run has a quarter of its time limit for its checkpoint, and at most two minutes") {
  CHECK(default_margin(std::nullopt) == 120);
  CHECK(default_margin(24 * 3600) == 120);
  CHECK(default_margin(60) == 15);
  for (const std::int64_t limit : {2, 3, 60, 480, 1000}) CHECK(default_margin(limit) < limit);
}

TEST_CASE("a sweep is an array with nodes of its own and room for its widest layout") {
  Job job = small_job();
  job.is_sweep = true;
  job.layouts = {{2, 4}, {4, 4}, {8, 1}};
  const std::string text = job_script(job);
  for (const char* line :
       {"#SBATCH --array=0-2", "#SBATCH --exclusive", "#SBATCH --cpus-per-task=8",
        "#SBATCH --output=/runs/bed/job/%A_%a.out", "layouts=(2x4 4x4 8x1)", "out=/runs/bed/$layout"})
    CHECK(has_line(text, line));
}

TEST_CASE("PBS and LSF are asked for the same in their words") {
  Job job = small_job();
  job.time_limit = 5400;
  job.partition = "long";
  job.account = "sand";
  job.system = BatchSystem::pbs;
  const std::string pbs = job_script(job);
  for (const char* line : {"#PBS -N bed", "#PBS -q long", "#PBS -A sand", "#PBS -l walltime=01:30:00",
                           "#PBS -l select=2:ncpus=16:mpiprocs=4:ompthreads=4:mem=1200mb"})
    CHECK(has_line(pbs, line));
  job.system = BatchSystem::lsf;
  const std::string lsf = job_script(job);
  for (const char* line : {"#BSUB -J bed", "#BSUB -q long", "#BSUB -P sand", "#BSUB -W 1:30", "#BSUB -n 8",
                           "#BSUB -R \"span[ptile=4] affinity[core(4)]\""})
    CHECK(has_line(lsf, line));
}

TEST_CASE("what is given for a directive or for srun is not carried out by the shell") {
  Job job = small_job();
  job.mpi = "$(touch x)";
  CHECK(job_script(job).find("srun --mpi='$(touch x)' ") != std::string::npos);
  job.system = BatchSystem::pbs;
  job.time_limit = 3600;
  job.directives = {"-l feature=fast"};
  CHECK(has_line(job_script(job), "#PBS -l feature=fast"));
}

TEST_CASE("a word in the shell's quotes comes back from the shell as it was") {
  for (const char* word :
       {"plain", "", "a b", "it's", "\"$HOME\" `id` \\", "a\nb", "*", "~", "#x", "--set=a[0]={ b = 1 }"})
    CHECK(hear_program({"printf", "<%s>", word}).output == '<' + std::string(word) + '>');
  CHECK(shell_quoted("a/b-c_1.2:3,4=5@6+") == "a/b-c_1.2:3,4=5@6+");
}

TEST_CASE("a program that is heard gives both its streams and its exit code, or the signal that ended it") {
  const ProgramEnd end = hear_program({"sh", "-c", "echo one; echo two >&2; exit 7"});
  CHECK(end.code == 7);
  CHECK(end.output == "one\ntwo");
  CHECK(hear_program({"sh", "-c", "kill -9 $$"}).code == 137);
  CHECK(hear_program({"cat"}).output.empty());  // there is nothing to read
}

TEST_CASE("a program is found by the first of its names, where it can be executed") {
  CHECK(find_program({"no-such-program-anywhere", "sh"})->filename() == "sh");
  CHECK_FALSE(find_program({"no-such-program-anywhere"}).has_value());
}
