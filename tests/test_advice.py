"""Tests of msim_sim_advice through msim_cli: runs meant to fail, and the same runs with what the
first sentence says. A run succeeds if it reaches its end."""
import re
import unittest

from cli_support import PENDULUM, CliTest

LEAST = 0.9  # the share of runs that the first sentence must help
EXPLICIT = "explicit-euler heun verlet symplectic-euler velocity-verlet respa rk4 ssprk102 ssprk104 rk6 rkc".split()
SMOOTH = "takahashi-imada force-gradient rkn6".split()
NEWTON = "implicit-euler implicit-midpoint trapezoidal newmark bdf2 tr-bdf2 sdirk2".split()
GRAVITY = [0, 0, -9.81]


def cloth(k, damping=0, **more):
    return {"msim": 1, "gravity": GRAVITY, "objects": [
        {"type": "cloth", "n": [7, 7], "origin": [0, 0, 0], "row": [0, 1, 0], "column": [1, 0, 0], "mass": 0.2,
         "k": {"structural": k, "shear": k}, "damping": damping, "pinned": ["first_corners"]}], **more}


def rope(k):
    return {"msim": 1, "gravity": GRAVITY, "objects": [
        {"type": "rope", "n": 12, "from": [0, 0, 0], "to": [1, 0, 0.3], "mass": 0.1, "k": k,
         "pinned": [0]}]}


def block(k):
    return {"msim": 1, "gravity": GRAVITY, "planes": [{"normal": [0, 0.1, 1], "offset": -0.02}],
            "objects": [{"type": "lattice", "n": [4, 4, 4], "origin": [0, 0, 0.02],
                         "size": [0.3, 0.3, 0.3], "mass": 1,
                         "k": k}]}


def ball(k):
    return {**cloth(k), "colliders": [{"type": "sphere", "center": [0.5, 0.5, -0.4], "radius": 0.3}]}


def block_on_box(k):
    scene = block(k)
    del scene["planes"]
    return {**scene, "colliders": [{"type": "box", "center": [0.15, 0.15, -0.5], "size": [4, 4, 1]}]}


def rope_with_law(law):
    n = 12
    return {"msim": 1, "gravity": GRAVITY, "laws": [law],
            "particles": {"x": [[i / 11, 0, 0.02 * i] for i in range(n)], "mass": 0.01, "pinned": [0]},
            "springs": {"ij": [[i, i + 1] for i in range(n - 1)], "k": 5000, "law": 1}}


def shaken_rope(k):
    x = [[[0, 0, 0.3 * (i % 2)]] for i in range(4)]
    return {**rope(k), "motions": [{"particles": [0], "t": [0, 0.02, 0.04, 0.06], "x": x}]}


def failing_runs_of_later_kinds():
    """Laws, motions, colliders, islands and indefinite systems"""
    table = {"type": "table", "stretch": [0.5, 0.9, 1, 1.1, 1.2], "force": [-50, -10, 0, 10, 4000]}
    for method in ("velocity-verlet", "rk4", "heun"):
        for scene in (ball(3000), rope_with_law(table), rope_with_law({"type": "tension"}),
                      shaken_rope(1e5)):
            yield scene, ["--integrator", method, "--h", "0.02", "--t_end", "1"]
    for method in ("implicit-midpoint", "newmark", "implicit-euler", "tr-bdf2",
                   "linearly-implicit-euler"):
        for scene in (ball(30000), block_on_box(1e5)):
            yield scene, ["--integrator", method, "--h", "0.05", "--t_end", "2"]
    for solver in ("sundials-spgmr", "sundials-spfgmr", "klu"):
        yield cloth(30000), ["--integrator", "linearly-implicit-euler", "--h", "0.05", "--t_end", "2",
                             "--indefinite", "solve", "--solver", solver]


def failing_runs():
    """(scene, options) of runs that most likely fail."""
    yield from failing_runs_of_later_kinds()
    for method in EXPLICIT + SMOOTH:
        for scene in (cloth(300), rope(2000), cloth(3000)):
            for h in (0.02, 0.1):
                yield scene, ["--integrator", method, "--h", str(h), "--t_end", str(40 * h)]
        if method not in SMOOTH + ["rkc"]:
            yield cloth(300, 0.5), ["--integrator", method, "--h", "0.02", "--t_end", "1"]
            yield block(3000), ["--integrator", method, "--h", "0.05", "--t_end", "2"]
    for method in NEWTON + ["linearly-implicit-euler"]:
        yield block(20000), ["--integrator", method, "--h", "0.02", "--t_end", "0.4"]
        for scene in (cloth(3000), block(20000), cloth(500, 0.05)):
            for limit in (["--newton.max_iterations", "1"], ["--newton.rtol", "1e-17"],
                          ["--solver.max_iterations", "1", "--solver", "pcg"],
                          ["--solver.rtol", "1e-17", "--solver", "sundials-pcg"]):
                yield scene, ["--integrator", method, "--h", "0.02", "--t_end", "0.4",
                              "--newton.retries", "0", "--collision", "event", *limit]
    for method in ("linearly-implicit-euler",):
        for k in (3000, 30000, 1e5):
            for how in ("stop", "solve"):
                yield cloth(k), ["--integrator", method, "--h", "0.05", "--t_end", "1",
                                 "--indefinite", how, "--solver", "cholmod"]
    for method in ("dop853", "rk4", "velocity-verlet", "bdf2"):
        for tol in ("1e-17", "1e-30"):
            yield PENDULUM, ["--integrator", method, "--tol", tol, "--t_end", "0.1"]


def settings(sentence):
    """The options that the part before the colon or the first comma of the reason sets."""
    head = sentence.split(": ")[0]
    return re.findall(r"([\w.]+) = ([\w.+-]+)", head)


class Advice(CliTest):
    def attempt(self, options):
        try:
            status, _, err = self.cli("run", "scene.json", "--quiet", *options)
        except Exception as error:  # a run that does not end
            return 1, str(error)
        return status, err

    def test_the_first_sentence_helps(self):
        failed, helped, others = 0, 0, []
        for scene, options in failing_runs():
            self.scene(scene)
            status, err = self.attempt(options)
            if status != 2:
                continue
            failed += 1
            sentences = re.findall(r"^msim_cli: try: (.*)$", err, re.M)
            self.assertTrue(1 <= len(sentences) <= 5, err)
            self.assertEqual(len(set(sentences)), len(sentences), err)
            first = settings(sentences[0])
            self.assertTrue(first, sentences[0])
            changed = [word for name, value in first for word in (f"--{name}", value)]
            keys = {f"--{name}" for name, _ in first}
            kept = [word for i in range(0, len(options), 2) if options[i] not in keys
                    for word in options[i:i + 2]]
            if self.attempt(kept + changed)[0] == 0:
                helped += 1
            else:
                others.append((options, sentences[0], err.splitlines()[0]))
        report = "\n".join(map(str, others))
        print(f"{failed} runs failed, the first sentence helped {helped}\n{report}")
        self.assertGreaterEqual(failed, 100)
        self.assertGreaterEqual(helped, LEAST * failed, report)


if __name__ == "__main__":
    unittest.main(verbosity=2)
