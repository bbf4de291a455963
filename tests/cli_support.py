"""Helpers that the tests of programs share.

MSIM_CLI is the path of msim_cli, MSIM_SCENES a folder of scenes."""

import csv
import json
import os
import re
import signal
import subprocess
import tempfile
import time
import unittest
from contextlib import contextmanager
from pathlib import Path

CLI = os.environ["MSIM_CLI"]
SCENES = Path(os.environ["MSIM_SCENES"])
INTEGRATORS = ("explicit-euler heun verlet linearly-implicit-euler symplectic-euler "
               "velocity-verlet rk4 dop853").split()
OPTIONS = ("integrator h steps t_end solver solver.rtol solver.max_iterations solver.options jacobian indefinite "
           "newton.rtol newton.max_iterations collision tol threads heun.collision verlet.start "
           "every fps sync skip.springs skip.kept_factor "
           "skip.two_d skip.zero_rest_length skip.at_rest skip.islands").split()
COUNTERS = {"steps", "force_evaluations", "assemblies", "analyses", "factorizations", "solves",
            "iterations", "newton_iterations", "contacts", "indefinite_steps",
            "coarse_factors", "kept_factors", "refinements", "fallbacks", "steps_at_rest",
            "islands_at_rest", "spring_evaluations", "rejected_steps", "incomplete_steps",
            "broken"}
SECONDS = {"total", "force", "assemble", "factor", "solve", "collide", "output"}
FOR_EVER = ["--steps", "100000000000"]

# A pinned particle and one that swings from it; 100 steps.
PENDULUM = {
    "msim": 1,
    "name": "pendulum",
    "gravity": [0, 0, -9.81],
    "particles": {"x": [[0, 0, 0], [0.5, 0.1, 0]], "v": [[0, 0, 0], [0, 1, 0]], "mass": 1,
                  "pinned": [0]},
    "springs": {"ij": [[0, 1]], "k": 100, "rest": 0.4},
    "run": {"integrator": "velocity-verlet", "h": 0.001, "t_end": 0.1},
}


def pendulum(**run):
    return {**PENDULUM, "run": run}


def no_constant(word):
    raise ValueError(f"{word} is no JSON")


def default_signals():
    """Default handlers, as for a program started in a terminal; a background job ignores Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


class CliTest(unittest.TestCase):
    PROGRAM = CLI

    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.addCleanup(self.temporary.cleanup)
        self.folder = Path(self.temporary.name)

    def write(self, name, content):
        text = content if isinstance(content, str) else json.dumps(content)
        (self.folder / name).write_text(text)
        return name

    def scene(self, content=None):
        return self.write("scene.json", content or PENDULUM)

    @contextmanager
    def start(self, *args, **keys):
        """A process that ends with the test at the latest."""
        keys = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE,
                "stderr": subprocess.PIPE, "preexec_fn": default_signals, **keys}
        with subprocess.Popen([self.PROGRAM, *args], cwd=self.folder, text=True, **keys) as process:
            try:
                yield process
            finally:
                process.kill()

    def cli(self, *args, **keys):
        """Run to the end: exit status, stdout, stderr."""
        with self.start(*args, **keys) as process:
            out, err = process.communicate(timeout=60)
        return process.returncode, out, err

    def good(self, *args, **keys):
        status, out, err = self.cli(*args, **keys)
        self.assertEqual((status, err), (0, ""), out)
        return out

    def final(self, name="final.json"):
        return json.loads((self.folder / name).read_text(), parse_constant=no_constant)

    def run_final(self, *args, status=0):
        """The final state of a run of scene.json."""
        code, _, err = self.cli("run", "scene.json", "--final", "final.json", "--quiet", *args)
        self.assertEqual(code, status, err)
        return self.final()

    def rows(self, name="out.csv"):
        with open(self.folder / name, newline="") as file:
            return list(csv.DictReader(file))

    def frames(self, name="out.csv"):
        """The steps of the frames in a file, each once, in order."""
        steps = [int(row["step"]) for row in self.rows(name)]
        return list(dict.fromkeys(steps))

    def files(self):
        return sorted(str(path.relative_to(self.folder)) for path in self.folder.rglob("*"))

    def wait_until(self, condition, otherwise):
        for _ in range(1000):
            if condition():
                return
            time.sleep(0.01)
        self.fail(otherwise)

    def wait_for(self, name):
        """Wait for the --out file: then the run has begun, and a signal stops it cleanly."""
        self.wait_until((self.folder / name).exists, f"{name} never appeared")

    def without_advice(self, err):
        """The messages, without the lines of advice that follow numerical events."""
        return re.sub(r"^msim_cli: try: .*\n", "", err, flags=re.M)

    def assert_sentence(self, err, *words):
        """The text is one message: the name of the program, and one line."""
        self.assertRegex(err, rf"\A{Path(self.PROGRAM).name}: [^\n]{{10,}}\n\Z")
        for word in words:
            self.assertIn(word, err)

    def assert_refused(self, args, *words):
        before = self.files()
        status, out, err = self.cli(*args)
        self.assertEqual((status, out), (1, ""), err)
        self.assert_sentence(err, *words)
        self.assertEqual(self.files(), before)
