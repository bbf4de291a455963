"""msim_bench linear and scaling as a whole: all keys, in a minute, however busy the machine is."""

import time
import unittest

from bench_support import BenchTest

ALONE = {"jacobian_over_force", "auto_slowdown_when_other_core_busy_cloth64"}
BESIDE_CHOLMOD = {"auto_over_tuned_cholmod_cloth64", "auto_over_tuned_cholmod_cloth100",
                  "auto_over_tuned_cholmod_cloth200", "auto_over_tuned_cholmod_jelly16",
                  "auto_over_tuned_cholmod_stiff_cloth100", "expanded_jacobian_over_force",
                  "cholmod_step_over_bare_cloth100",
                  "cholmod_slowdown_when_other_core_busy_cloth64"}
BESIDE_DEFAULT = {"auto_over_default_cholmod_cloth100", "cholmod_step_over_default_cloth32",
                  "cholmod_step_over_default_cloth64", "cholmod_step_over_default_cloth100"}


class Quick(BenchTest):
    def run_quick(self, bench):
        start = time.monotonic()
        self.good(bench, "--quick", "--json", "out.json")
        self.assertLess(time.monotonic() - start, 60)
        return self.result()

    def check_keys(self, result, expected):
        """Absent are those only for which the machine had no time."""
        found = set(result["summary"])
        self.assertEqual(found - expected, set())
        for value in result["summary"].values():
            self.assertGreater(value, 0)
        late = [row for row in result["rows"] if "no time" in row.get("reason", "")]
        if found != expected and late:
            self.skipTest("too busy a machine for " + ", ".join(sorted(expected - found)))
        self.assertEqual(found, expected)

    def test_linear(self):
        result = self.run_quick("linear")
        machine = result["machine"]
        solvers, references = machine["solvers"], machine["references"]
        expected = set(ALONE)
        if len(set(solvers) - {"auto"}) > 1:
            expected |= {"max_disagreement", "max_disagreement_stiff"}
        if "cholmod" in solvers:
            expected |= BESIDE_CHOLMOD
            if "default cholmod" in references:
                expected |= BESIDE_DEFAULT
        elif "default cholmod" in references:
            expected.add("auto_over_default_cholmod_cloth100")
        if "sundials-pcg" in solvers:
            expected.add("sundials_pcg_over_builtin_per_iteration_cloth100")
            if "stock sundials" in references:
                expected.add("sundials_pcg_over_stock_cloth100")
        if machine["cores"] == 1:
            expected = {key for key in expected if "other_core" not in key}
        self.check_keys(result, expected)

    def test_scaling(self):
        result = self.run_quick("scaling")
        self.check_keys(result, {"time_per_particle_growth_cloth64_to_cloth500",
                                 "iterations_growth_k_to_100k"})
        large = self.find(result["rows"], scene="cloth500", solver="auto")
        self.assertEqual([(row["status"], row["unknowns"]) for row in large], [("ok", 749994)])


if __name__ == "__main__":
    unittest.main()
