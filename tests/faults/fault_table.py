#!/usr/bin/python3
"""Counts what the program survives, as a page: steps until each planted error is found, inputs of strangers by kind, faults by kind.

usage: fault_table.py BUILD [--inputs N] [--faults N] [--seed S] [--out FILE]

Exit code 1 where anything was lost, was not found, or was not refused by name.
"""

import argparse
import datetime
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TARGETS = sorted(path.name for path in (ROOT / "tests" / "fuzz" / "seeds").iterdir())


def heard(*words):
    """Exit code, output, and seconds."""
    start = time.monotonic()
    done = subprocess.run([str(word) for word in words], text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    return done.returncode, done.stdout, time.monotonic() - start


def machine():
    model = re.search(r"^model name\s*: (.*)$", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
    return f"{model.group(1) if model else 'unknown CPU'}, {os.cpu_count()} CPUs"


def planted(build):
    code, said, seconds = heard(build / "bin" / "tests_faults")
    rows = re.findall(r"^planted: (.*?) +found after (\d+) steps$", said, re.MULTILINE)
    lines = ["| planted error | found after steps |", "|---|---|"]
    lines += [f"| {what} | {int(steps) if int(steps) else 'refused before the first'} |" for what, steps in rows]
    return code == 0 and bool(rows), lines + ["", f"All tests of bad input ({'passed' if code == 0 else 'FAILED'}): {seconds:.0f} s."]


def inputs(build, n, seed):
    lines, is_good, total, total_seconds = ["| target | inputs | s | not named, crashed, hung |", "|---|---|---|---|"], True, 0, 0.0
    for target in TARGETS:
        code, said, seconds = heard(build / "bin" / "tests_fuzz", ROOT / "tests" / "fuzz" / "seeds", n, seed, target)
        found = re.search(r"^(\d+) inputs, all read", said, re.MULTILINE)
        is_good &= code == 0 and found is not None
        n_tried = int(found.group(1)) if found else 0
        total, total_seconds = total + n_tried, total_seconds + seconds
        lines.append(f"| {target} | {n_tried or 'ended early'} | {seconds:.0f} | {0 if found else said.strip()[-200:]} |")
    return is_good, lines + [f"| all | {total} | {total_seconds:.0f} | |"]


def chaos(build, n, seed):
    with tempfile.NamedTemporaryFile(suffix=".md") as table:
        code, said, _ = heard(sys.executable, ROOT / "tests" / "faults" / "chaos_test.py", build / "bin" / "moraine", "--faults", n, "--seed", seed,
                              "--table", table.name)
        return code == 0, [Path(table.name).read_text().strip(), "", said.strip().splitlines()[-1]]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("build", type=Path)
    parser.add_argument("--inputs", type=int, default=1000, help="alterations of seeds for each target")
    parser.add_argument("--faults", type=int, default=24)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    build = given.build.resolve()
    commit = heard("git", "-C", ROOT, "describe", "--always", "--dirty")[1].strip()
    page = ["# Faults survived", "", f"Machine: {machine()}. {datetime.date.today()}, commit {commit}.", "",
            f"    tests/faults/fault_table.py build --inputs {given.inputs} --faults {given.faults} --seed {given.seed}", ""]
    is_good = True
    for title, part in (("Planted errors", lambda: planted(build)),
                        ("Inputs of strangers (seeds and their alterations, no allocation above 16 MB and 2048 times the input)",
                         lambda: inputs(build, given.inputs, given.seed)),
                        ("Faults at random moments of runs", lambda: chaos(build, given.faults, given.seed))):
        good, lines = part()
        is_good &= good
        page += [f"## {title}", ""] + lines + [""]
        print("\n".join([title] + lines), flush=True)
    if given.out:
        given.out.write_text("\n".join(page))
    return 0 if is_good else 1


if __name__ == "__main__":
    sys.exit(main())
