"""Tests that when an allocation of msim_cli fails, it ends with a message and exit status 1, or
with the same results.

Strings of the scene have at most 15 characters, as jansson 2.14 aborts if its buffer for a longer
one cannot grow. With MSIM_LONG_TESTS each allocation fails in turn, otherwise some forty per
command. Exit status 127 is that of the dynamic linker without memory. CHOLMOD is left out:
OpenBLAS and libgfortran crash when they are loaded without memory."""

import os
import re
import resource

import support
from cli_support import CliTest

SCENE = """{"msim": 1, "gravity": [0, 0, -9.81],
 "objects": [{"type": "cloth", "origin": [0, 0, 0], "n": [4, 4], "row": [1, 0, 0],
              "column": [0, 1, 0], "mass": 1, "k": {"structural": 50}, "pinned": [0]}],
 "planes": [{"normal": [0, 0, 1], "offset": -1}],
 "run": {"h": 0.01, "steps": 20}}"""
COMMANDS = [["run", "scene.json", "--integrator", "heun", "--out", "a.csv", "--final", "a.json"],
            ["run", "scene.json", "--integrator", "implicit-euler", "--solver", "pcg", "--stats"],
            ["explain", "scene.json", "--integrator", "heun"]]
RESULTS = "a.csv", "a.json"
# Not compared: the line `took`, the table `seconds` of --stats, the object "seconds" of a final
# state, and the number of notes, as a note that needs memory is omitted when there is none.
VARIES = re.compile(r'^  (took|notes) .*\n|^  seconds\n(    .*\n)+|"seconds": \{[^}]+\}', re.M)


class Memory(CliTest):
    def setUp(self):
        if support.setting("SANITIZE"):
            self.skipTest("sanitizers replace malloc themselves")
        super().setUp()
        self.scene(SCENE)

    def starved(self, command, at, later):
        """Exit status, stdout, stderr and whether allocation number `at` was reached."""
        for name in RESULTS:
            (self.folder / name).unlink(missing_ok=True)
        there, here = os.pipe()
        environment = {**os.environ, "LD_PRELOAD": support.setting("FAILING_ALLOCATOR"),
                       "FAIL_AT": str(at), "FAIL_PIPE": str(here)}
        if later:
            environment["FAIL_LATER"] = "1"
        try:
            result = self.cli(*command, env=environment, pass_fds=[here])
        finally:
            os.close(here)
        with os.fdopen(there, "rb") as pipe:
            return *result, pipe.read() == b"!"

    def results(self, out):
        """The output and the files of a command."""
        paths = [self.folder / name for name in RESULTS]
        texts = [out] + [path.read_text() for path in paths if path.exists()]
        return [VARIES.sub("", text) for text in texts]

    def count(self, command):
        low, high = 0, 1
        while self.starved(command, high, False)[3]:
            low, high = high, 2 * high
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if self.starved(command, middle, False)[3] else (low, middle)
        return high

    def test_every_allocation(self):
        everything = "MSIM_LONG_TESTS" in os.environ
        for command in COMMANDS:
            status, out, err, _ = self.starved(command, -1, False)
            self.assertEqual(status, 0, err)
            whole, count = self.results(out), self.count(command)
            stride = 1 if everything else count // 40 + 1
            for at in range(0, count, stride):
                for later in (False, True) if everything else (at // stride % 2 == 1,):
                    with self.subTest(command=command, at=at, later=later):
                        status, out, err, _ = self.starved(command, at, later)
                        self.assertIn(status, (0, 1, 127), err)
                        self.assertTrue(status == 0 or later or err)
                        if status == 0:
                            self.assertEqual(self.results(out), whole)
                        else:
                            self.assertNotIn(".part", " ".join(os.listdir(self.folder)))

    def test_scenes_too_large(self):
        def limit():
            resource.setrlimit(resource.RLIMIT_AS, (2 << 30, 2 << 30))

        objects = {"10000000000 particles; the limit is 715827882":
                       '"cloth", "n": [100000, 100000], "row": [1, 0, 0], "column": [0, 1, 0]',
                   "8000000000 particles; the limit is 715827882":
                       '"lattice", "n": [2000, 2000, 2000], "size": [1, 1, 1]',
                   "3899745002 springs; the limit is 2147483647":
                       '"cloth", "n": [26000, 25000], "row": [1, 0, 0], "column": [0, 1, 0]',
                   "out of memory": '"lattice", "n": [464, 464, 465], "size": [1, 1, 1]'}
        for refused, shape in objects.items():
            k = '{"structural": 1, "shear": 1, "bend": 1}' if "cloth" in shape else "1"
            self.scene(f"""{{"msim": 1, "objects": [{{"type": {shape}, "origin": [0, 0, 0],
                            "mass": 1, "k": {k}}}], "run": {{"integrator": "heun", "steps": 1}}}}""")
            status, _, err = self.cli("run", "scene.json", preexec_fn=limit)
            self.assertEqual(status, 1)
            self.assertIn(refused, err)


if __name__ == "__main__":
    support.main()
