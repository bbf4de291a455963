"""Tests of accuracy in difficult scenes, each against a reference: impacts inside a step, sliding,
mass ratios, speed, late events, buckling. accuracy.json has scenes, options, references, limits."""
import json
import math
import subprocess
import tempfile
import unittest
from pathlib import Path

import support

CASES = json.loads((Path(__file__).parent / "accuracy.json").read_text())


class Runner:
    """Runs msim_cli in a temporary folder."""

    def __init__(self, folder):
        self.scene, self.final = Path(folder) / "scene.json", Path(folder) / "final.json"

    def status(self, scene, options):
        """Exit status of a run; its final state is in `final`."""
        self.scene.write_text(json.dumps({"msim": 1, **scene}))
        self.final.unlink(missing_ok=True)
        words = [support.setting("CLI"), "run", self.scene, "--quiet", "--threads", "1", "--final",
                 self.final]
        for name, value in options.items():
            words += ["--" + name, repr(value) if isinstance(value, float) else str(value)]
        done = subprocess.run([str(w) for w in words], stdin=subprocess.DEVNULL, text=True,
                              capture_output=True)
        self.said = done.stderr
        return done.returncode

    def run(self, scene, options):
        status = self.status(scene, options)
        assert status == 0, f"exit status {status}: {self.said}"
        return json.loads(self.final.read_text())


def deviation(end, measure):
    """The largest difference from the reference, of components that have one, over the scale."""
    values = end[measure.get("what", "x")]
    origin = values[measure["from"]] if "from" in measure else (0, 0, 0)
    return max(abs(values[particle][c] - origin[c] - wanted[c])
               for particle, wanted in zip(measure["of"], measure["ref"]) for c in range(3)
               if wanted[c] is not None) / measure.get("scale", 1)


def error(runner, case, measure):
    return deviation(runner.run(case["scene"], case["run"]), measure)


def contacts(runner, case, measure):
    return abs(runner.run(case["scene"], case["run"])["stats"]["contacts"] - measure["ref"])


def energy(runner, case, measure):
    end = runner.run(case["scene"], case["run"])
    return abs(end["energy"]["total"] / measure["E0"] - 1)


def energy_band(runner, case, measure):
    return max(abs(runner.run(case["scene"], {**case["run"], "steps": n})["energy"]["total"]
                   / measure["E0"] - 1) for n in range(*measure["steps"]))


def growth(runner, case, measure):
    """Final energy over initial energy; 0 if the run is refused."""
    if runner.status(case["scene"], case["run"]) == 1:
        return 0
    return runner.run(case["scene"], case["run"])["energy"]["total"] / measure["E0"]


def status(runner, case, _measure):
    return runner.status(case["scene"], case["run"])


def stat(runner, case, measure):
    end = runner.run(case["scene"], case["run"])
    assert deviation(end, measure["also"]) <= 1, "a wrong result"
    return end["stats"][measure["stat"]]


def stat_ratio(runner, case, measure):
    """A counter over that of a run with another scene or other options."""
    base = {**case, **measure["base"]}
    return (runner.run(case["scene"], case["run"])["stats"][measure["stat"]]
            / runner.run(base["scene"], base["run"])["stats"][measure["stat"]])


def momentum(runner, case, _measure):
    particles = case["scene"]["particles"]
    start = [math.fsum(m * v[c] for m, v in zip(particles["mass"], particles["v"])) for c in range(3)]
    end = runner.run(case["scene"], case["run"])["momentum"]
    return max(abs(a - b) for a, b in zip(start, end)) / max(map(abs, start))


def outside(runner, case, _measure):
    """The largest distance of a particle behind a plane at the end, m."""
    end = runner.run(case["scene"], case["run"])
    return max((p["offset"] - sum(a * b for a, b in zip(p["normal"], x)))
               / math.hypot(*p["normal"]) for p in case["scene"]["planes"] for x in end["x"])


MEASURES = {f.__name__: f for f in (error, contacts, energy, energy_band, growth, status, stat,
                                    stat_ratio, momentum, outside)}


class Accuracy(unittest.TestCase):
    def test_limits_are_kept(self):
        support.setting("CLI")
        with tempfile.TemporaryDirectory() as folder:
            for case in CASES:
                with self.subTest(case["name"], what=case["what"]):
                    measure = MEASURES[case["measure"]["kind"]]
                    self.assertLessEqual(measure(Runner(folder), case, case["measure"]),
                                         case["limit"])


if __name__ == "__main__":
    support.main()
