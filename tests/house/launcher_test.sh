#!/usr/bin/env bash
# The launcher on a small project of the same shape: its program prints its arguments and the folder it runs in.
# usage: launcher_test.sh ROOT_OF_MORAINE
set -uo pipefail

source_root=$1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
house="$folder/a house"  # the space is meant
n_failed=0

check() {  # check SENTENCE COMMAND...: the command must succeed
  if "${@:2}"; then echo "ok: $1"; else echo "FAILED: $1"; n_failed=$((n_failed + 1)); fi
}
ends_with() { local code=$1; shift; "$@" >"$folder/out" 2>"$folder/err"; [[ $? == "$code" ]] || { cat "$folder/out" "$folder/err"; false; }; }
out_is() { [[ $(<"$folder/out") == "$1" ]] || { echo "stdout is: $(<"$folder/out")"; false; }; }
err_has() { grep -qF -- "$1" "$folder/err" || { echo "stderr is: $(<"$folder/err")"; false; }; }
err_is_empty() { [[ ! -s $folder/err ]] || { echo "stderr is: $(<"$folder/err")"; false; }; }
no_escapes() { ! grep -q $'\033' "$folder/out" "$folder/err"; }
calls_are() { [[ $(sort "$folder/calls" | uniq -c | tr -s ' \n' ' ') == "$1" ]] || { cat "$folder/calls"; false; }; }

# cmake and ninja as they are, but each call leaves a line.
mkdir -p "$folder/tools"
for tool in cmake ninja; do
  printf '#!/bin/sh\necho %s >>"%s/calls"\nexec %s "$@"\n' $tool "$folder" "$(command -v $tool)" >"$folder/tools/$tool"
  chmod +x "$folder/tools/$tool"
done

mkdir -p "$house/.ci" "$folder/elsewhere" "$folder/bin"
cp "$source_root/moraine" "$house/"
printf '#!/bin/sh\necho "$@" >>"%s/installed"\n' "$folder" >"$house/.ci/install"  # nothing is installed by a test
chmod +x "$house/.ci/install"
cat >"$house/CMakeLists.txt" <<'CMAKE'
cmake_minimum_required(VERSION 3.22)
project(small LANGUAGES CXX)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)
add_executable(moraine main.cpp)
add_executable(extra main.cpp)
enable_testing()
add_test(NAME quick COMMAND extra)
add_test(NAME slow COMMAND extra)
set_tests_properties(slow PROPERTIES LABELS long)
CMAKE
cat >"$house/main.cpp" <<'CPP'
#include <cstdio>
#include <unistd.h>
int main(int n, char** words) {
  char here[4096];
  std::printf("%s", getcwd(here, sizeof here));
  for (int i = 1; i < n; ++i) std::printf("|%s", words[i]);
  return n > 1 && words[1][0] == '7' ? 7 : 0;
}
CPP
unset MORAINE_BUILD_DIR MORAINE_WERROR MORAINE_JOBS OMPI_COMM_WORLD_RANK PMIX_RANK PMI_RANK
cd "$folder/elsewhere"
ln -s "$house/moraine" "$folder/bin/moraine"

# Two at once from nothing, one of them through a link.
"$house/moraine" run first >"$folder/one" 2>"$folder/one.err" & one=$!
"$folder/bin/moraine" run second >"$folder/two" 2>"$folder/two.err" & two=$!
wait $one; code_one=$?; wait $two; code_two=$?
check "two first starts at once both run" test "$code_one$code_two" == 00
check "the program runs where it was called" test "$(<"$folder/one")" == "$folder/elsewhere|run|first"
check "a link to the launcher works" test "$(<"$folder/two")" == "$folder/elsewhere|run|second"
check "only one of them built" test "$(cat "$folder/one.err" "$folder/two.err" | grep -c ' building (')" == 1
check "run builds no more than the program" test ! -e "$house/build/bin/extra"

check "with nothing to do" ends_with 0 "$house/moraine" run 'an argument' '*' ''
check "  arguments arrive as they are" out_is "$folder/elsewhere|run|an argument|*|"
check "  nothing is said" err_is_empty
rm -f "$folder/calls"
PATH=$folder/tools:$PATH "$house/moraine" run >/dev/null
check "  it asks ninja once, and cmake not at all" calls_are ' 1 ninja '
check "the program's exit code comes back" ends_with 7 "$house/moraine" 7
check "packages for a run are those of the build group" test "$(sort -u "$folder/installed")" == build
check "rendering asks for its packages too" ends_with 0 "$house/moraine" render x
check "  by name" grep -qx "build render" "$folder/installed"
check "scaling asks for its packages too" ends_with 0 "$house/moraine" scale x
check "  by name" grep -qx "build plot" "$folder/installed"

# While somebody else builds, a start says so and waits.
exec 8>"$house/build/.lock"
flock 8
"$house/moraine" run >"$folder/out" 2>"$folder/err" 8>&- & waiting=$!
for ((i = 0; i < 200; ++i)); do [[ -s $folder/err ]] && break; sleep 0.05; done
check "a start says that it waits for another's build" err_has "waiting for another start"
check "  and waits" test ! -s "$folder/out"
exec 8>&-
wait $waiting
check "  and then runs" out_is "$folder/elsewhere|run"

# Ranks come all at once and wait for each other as a matter of course.
flock "$house/build/.lock" sleep 0.5 &
sleep 0.1
check "a rank waits for the others without a word" ends_with 0 env PMIX_RANK=1 "$house/moraine" run
check "  and runs" out_is "$folder/elsewhere|run"
check "  and has said nothing" err_is_empty
wait

# Broken code, then mended.
cp "$house/main.cpp" "$folder/good.cpp"
echo 'int broken = "text";' >>"$house/main.cpp"
check "broken code ends with 1" ends_with 1 "$house/moraine" run
check "  the compiler's words are shown" err_has "main.cpp:9:"
check "  the place of the log is shown" err_has "$house/build/build.log"
check "  without the command line" bash -c "! grep -q -- '-o CMakeFiles' '$folder/err'"
check "  without colour codes" no_escapes
cp "$folder/good.cpp" "$house/main.cpp"
check "mended code builds and runs" ends_with 0 "$house/moraine" run
check "  and says that it built" err_has "moraine: build took"
check "  without colour codes" no_escapes

echo 'message(FATAL_ERROR "no such thing")' >>"$house/CMakeLists.txt"
check "a broken build description ends with 1" ends_with 1 "$house/moraine" run
check "  and says why" err_has "no such thing"
sed -i '$d' "$house/CMakeLists.txt"

# Other verbs.
check "build makes everything" ends_with 0 "$house/moraine" build
check "  the tests too" test -x "$house/build/bin/extra"
check "test runs the quick tests" ends_with 0 "$house/moraine" test
check "  and ends with ctest's summary" grep -q "^100% tests passed, 0 tests failed out of 1" "$folder/out"
check "  not the long ones" bash -c "! grep -q slow '$folder/out'"
check "test --long runs the long ones" ends_with 0 "$house/moraine" test --long
check "  only" bash -c "grep -q slow '$folder/out' && ! grep -q quick '$folder/out'"
check "arguments of test go to ctest" ends_with 0 "$house/moraine" test -N -R quick
check "a test that selects nothing fails" ends_with 1 bash -c "'$house/moraine' test -R nothing-like-this || exit 1"
check "bench says when there are none" ends_with 1 "$house/moraine" bench
check "  so" err_has "there are no benchmarks"
check "python says when there is no module" ends_with 1 "$house/moraine" python script.py
check "  so" err_has "there is no Python module in this build"
check "help names the launcher's commands" ends_with 0 "$house/moraine" help
check "  test among them" grep -q "test --long" "$folder/out"

# The checkout moves, with its build folder.
mv "$house" "$folder/moved"
check "a moved checkout builds anew" ends_with 0 "$folder/moved/moraine" run
check "  and runs" out_is "$folder/elsewhere|run"
check "another build folder can be named" ends_with 0 env MORAINE_BUILD_DIR=here "$folder/moved/moraine" run
check "  beside the caller" test -x "$folder/elsewhere/here/bin/moraine"
check "a build folder that cannot be made is named" ends_with 1 env MORAINE_BUILD_DIR=/proc/nowhere "$folder/moved/moraine" run
check "  with the cure" err_has "set MORAINE_BUILD_DIR"

# The installer, with a package that does not exist, for a user who may not install it.
sed 's/\[render\]="povray ffmpeg"/[render]="no-such-package-as-this"/' "$source_root/.ci/install" >"$folder/install"
sed -i 's/EUID != 0/1/; s/command -v sudo/false/' "$folder/install"
if command -v dpkg-query >/dev/null; then
  check "missing packages without root end with 1" ends_with 1 bash "$folder/install" render
  check "  and the exact command" err_has "apt-get update && apt-get install -y --no-install-recommends no-such-package-as-this"
  check "an unknown group is named" ends_with 1 bash "$folder/install" oddments
fi

if ((n_failed > 0)); then echo "$n_failed failed"; exit 1; fi
echo "all passed"
