#!/usr/bin/env python3
"""bench/compare sees a regression, and only a regression: compare_test.py PATH_OF_COMPARE."""
import importlib.machinery, importlib.util, itertools, json, os, random, subprocess, sys, tempfile, unittest

program = sys.argv.pop(1)
loader = importlib.machinery.SourceFileLoader("compare", program)
sys.dont_write_bytecode = True
compare = importlib.util.module_from_spec(importlib.util.spec_from_loader("compare", loader))
loader.exec_module(compare)


def results(repetitions, unit="us", counters=(), context=None, aggregates=True):
    """A results file's content: names with the times of their repetitions, as Google Benchmark writes them."""
    rows = []
    for name, times in repetitions.items():
        for index, time in enumerate(times):
            row = {"name": name, "run_name": name, "run_type": "iteration", "repetition_index": index, "iterations": 10,
                   "real_time": 1.1 * time, "cpu_time": time, "time_unit": unit}
            row.update({counter: 1e9 / time for counter in counters})
            rows.append(row)
        if aggregates:
            rows.append({"name": name + "_mean", "run_name": name, "run_type": "aggregate", "aggregate_name": "mean",
                         "real_time": 1e9, "cpu_time": 1e9, "time_unit": unit})
    return {"context": context or {"host_name": "here", "num_cpus": 4}, "benchmarks": rows}


def noisy(middle, n=9, seed=1, spread=0.02):
    generator = random.Random(seed)
    return [middle * (1.0 + generator.uniform(-spread, spread)) for _ in range(n)]


class Compare(unittest.TestCase):
    def run_on(self, before, after, *arguments):
        with tempfile.TemporaryDirectory() as folder:
            paths = []
            for name, content in (("before.json", before), ("after.json", after)):
                paths.append(os.path.join(folder, name))
                with open(paths[-1], "w") as out:
                    out.write(content if isinstance(content, str) else json.dumps(content))
            done = subprocess.run([sys.executable, program, *paths, *arguments], capture_output=True, text=True)
            return done.returncode, done.stdout, done.stderr

    def test_p_is_that_of_all_orders(self):
        """Exact p of all splits of n values into two groups, by trying each."""
        for m, n in ((1, 1), (2, 3), (4, 4), (3, 6), (5, 5)):
            values = list(range(m + n))
            for first in itertools.combinations(values, m):
                u = lambda group: sum(sum(1 for b in values if b not in group and b < a) for a in group)
                distance = lambda group: abs(u(group) - 0.5 * m * n)
                as_far = sum(1 for group in itertools.combinations(values, m) if distance(group) >= distance(first))
                exact = as_far / sum(1 for _ in itertools.combinations(values, m))
                found = compare.mann_whitney(list(first), [v for v in values if v not in first])
                self.assertAlmostEqual(found, exact, places=12, msg=f"{first} of {m} + {n}")

    def test_p_with_ties_is_near_that_of_all_orders(self):
        values = [1, 1, 2, 2, 2, 3, 4, 4, 5, 6, 6, 7]
        rank = dict(zip(range(12), compare.ranks(values)[0]))
        distance = lambda group: abs(sum(rank[k] for k in group) - 0.5 * 6 * 13)
        groups = list(itertools.combinations(range(12), 6))
        for first in groups[::40]:
            exact = sum(1 for group in groups if distance(group) >= distance(first) - 1e-9) / len(groups)
            found = compare.mann_whitney([values[k] for k in first], [values[k] for k in range(12) if k not in first])
            self.assertAlmostEqual(found, exact, delta=0.015 if exact < 0.1 else 0.06, msg=str(first))

    def test_one_program_twice_is_seldom_different(self):
        """Of many comparisons without a difference about alpha are significant."""
        generator = random.Random(3)
        n_significant = sum(
            compare.mann_whitney([generator.gauss(0, 1) for _ in range(7)], [generator.gauss(0, 1) for _ in range(7)]) < 0.05
            for _ in range(2000))
        self.assertGreater(n_significant, 40)
        self.assertLess(n_significant, 130)

    def test_a_regression_is_seen_and_named(self):
        before = results({"contact/a": noisy(10.0), "contact/b": noisy(20.0, seed=2)})
        after = results({"contact/a": noisy(10.0, seed=5), "contact/b": noisy(22.0, seed=6)})
        code, text, _ = self.run_on(before, after)
        self.assertEqual(code, 1)
        lines = {line.split()[0]: line for line in text.split("\n") if line.startswith("contact")}
        self.assertTrue(lines["contact/b"].endswith("slower"), text)
        self.assertFalse(lines["contact/a"].endswith("er"), text)
        self.assertIn("2 compared by cpu_time: 1 slower, 0 faster", text)
        code, text, _ = self.run_on(before, after, "--filter", "/a$")
        self.assertEqual(code, 0)
        self.assertIn("1 compared", text)

    def test_what_got_faster_is_no_regression(self):
        code, text, _ = self.run_on(results({"k": noisy(10.0)}), results({"k": noisy(8.0, seed=4)}))
        self.assertEqual(code, 0)
        self.assertIn("0 slower, 1 faster", text)

    def test_significant_but_small_is_left_alone_until_asked_for(self):
        before, after = results({"k": noisy(10.0, spread=0.001)}), results({"k": noisy(10.2, seed=4, spread=0.001)})
        self.assertEqual(self.run_on(before, after)[0], 0)
        self.assertEqual(self.run_on(before, after, "--threshold", "1")[0], 1)

    def test_large_but_within_the_noise_is_no_regression(self):
        before, after = results({"k": [10, 11, 20, 30, 12]}), results({"k": [10.5, 31, 19, 13, 32]})
        self.assertEqual(self.run_on(before, after)[0], 0)

    def test_units_do_not_matter(self):
        code, text, _ = self.run_on(results({"k": noisy(10.0)}), results({"k": noisy(0.01, seed=4)}, unit="ms"))
        self.assertEqual(code, 0, text)
        self.assertIn("0 slower, 0 faster", text)

    def test_of_counters_more_is_better(self):
        before = results({"k": noisy(10.0), "bare": noisy(1.0)}, counters=["items/s"])
        before["benchmarks"] = [row for row in before["benchmarks"] if row["run_name"] == "k" or row.pop("items/s", 0) >= 0]
        after = results({"k": noisy(12.0, seed=4)}, counters=["items/s"])
        code, text, _ = self.run_on(before, after, "--metric", "items/s")
        self.assertEqual(code, 1, text)
        self.assertIn("1 slower", text)

    def test_a_benchmark_that_is_gone_is_not_passed_over(self):
        before, after = results({"k": noisy(10.0), "gone": noisy(5.0)}), results({"k": noisy(10.0, seed=4), "fresh": noisy(1.0)})
        code, text, _ = self.run_on(before, after)
        self.assertEqual(code, 1)
        self.assertIn("1 missing in the second file: gone", text)
        self.assertIn("1 new in it: fresh", text)

    def test_other_machines_are_noted(self):
        there = results({"k": noisy(10.0)}, context={"host_name": "there", "num_cpus": 4})
        self.assertIn("host_name: here before, there after", self.run_on(results({"k": noisy(10.0)}), there)[1])

    def test_too_few_repetitions_are_an_error_with_the_cure(self):
        code, _, error = self.run_on(results({"k": noisy(10.0, 3)}), results({"k": noisy(20.0, 3)}))
        self.assertEqual(code, 2)
        self.assertIn("--benchmark_repetitions=4 or more", error)

    def test_what_is_no_results_file_is_an_error(self):
        good = results({"k": noisy(10.0)})
        for bad, words in (("not json", "is no JSON"), ("[1, 2]", "no results file"), ({"benchmarks": []}, "holds no repetition"),
                           (results({"k": []}), "leave out --benchmark_report_aggregates_only"),
                           (results({"other": noisy(1.0)}), "no benchmark in common")):
            code, _, error = self.run_on(good, bad)
            self.assertEqual(code, 2, words)
            self.assertIn(words, error)
        done = subprocess.run([sys.executable, program, "/nowhere/a.json", "b.json"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 2)
        self.assertIn("/nowhere/a.json: No such file", done.stderr)
        self.assertEqual(self.run_on(good, good, "--filter", "(")[0], 2)


if __name__ == "__main__":
    unittest.main()
