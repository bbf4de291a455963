"""Tests of msim_cli during a run and at its end: signals, streams, progress, report."""

import contextlib
import json
import os
import pty
import re
import resource
import select
import signal
import struct
import subprocess
import termios
import time
from fcntl import ioctl

import support
from cli_support import CLI, SCENES, COUNTERS, SECONDS, FOR_EVER, PENDULUM, pendulum, CliTest


def caught(process, number):
    """True if the process has a handler for this signal."""
    with open(f"/proc/{process.pid}/status", encoding="ascii") as status:
        mask = next(line for line in status if line.startswith("SigCgt:")).split()[1]
    return int(mask, 16) >> (number - 1) & 1


class Stopping(CliTest):
    def test_signals(self):
        self.scene()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1):
            with self.subTest(number.name):
                with self.start("run", "scene.json", *FOR_EVER, "--out", "out.csv", "--every",
                                "100000", "--final", "final.json") as process:
                    self.wait_for("out.csv")
                    time.sleep(0.3)
                    process.send_signal(number)
                    out, err = process.communicate(timeout=20)
                self.assertEqual(process.returncode, 2)
                self.assertIn("pendulum", out)
                final = self.final()
                self.assertEqual(final["status"], "stopped")
                self.assert_sentence(err, "stopped", f"step {final['step']},", "t = ")
                self.assertEqual(self.frames()[-1], final["step"])
                self.assertEqual(self.files(), ["final.json", "out.csv", "scene.json"])
                os.remove(self.folder / "out.csv")

    def test_second_signal_kills(self):
        """The stopped run writes its report to a full pipe without a reader."""
        self.scene()
        read, write = os.pipe()
        os.set_blocking(write, False)
        with contextlib.suppress(BlockingIOError):
            while True:
                os.write(write, bytes(1))
        os.set_blocking(write, True)
        with self.start("run", "scene.json", *FOR_EVER, "--out", "out.csv",
                        stdout=write) as process:
            self.wait_for("out.csv")
            process.send_signal(signal.SIGINT)
            self.wait_until(lambda: not caught(process, signal.SIGINT), "the first still counts")
            self.assertIsNone(process.poll())
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=20)
        self.assertEqual(process.returncode, -signal.SIGINT)
        os.close(read)
        os.close(write)

    def test_ignored_signals_stay_ignored(self):
        self.scene()
        ignore = lambda: signal.signal(signal.SIGINT, signal.SIG_IGN)
        with self.start("run", "scene.json", *FOR_EVER, "--out", "out.csv",
                        preexec_fn=ignore) as process:
            self.wait_for("out.csv")
            process.send_signal(signal.SIGINT)
            time.sleep(0.2)
            self.assertIsNone(process.poll())
            process.send_signal(signal.SIGTERM)
            process.communicate(timeout=20)
        self.assertEqual(process.returncode, 2)


class NumericalEvents(CliTest):
    def assert_event(self, scene, args, word, where="step {next},"):
        self.scene(scene)
        status, out, err = self.cli("run", "scene.json", "--final", "final.json", "--out",
                                    "out.csv", *args)
        self.assertEqual(status, 2, err)
        lines = [line for line in self.without_advice(err).splitlines(True)
                 if ": note: " not in line]
        self.assertRegex(err, "\nmsim_cli: try: Set ")
        self.assert_sentence("".join(lines), "step ", "t = ")
        final = self.final()
        self.assertEqual(final["status"], word)
        self.assertIn(where.format(last=final["step"], next=final["step"] + 1), err)
        self.assertEqual(self.frames()[-1], final["step"])
        self.assertEqual(self.files(), ["final.json", "out.csv", "scene.json"])
        self.assertIn("energy", out)
        return err

    def test_unstable(self):
        err = self.assert_event(pendulum(integrator="explicit-euler", h=100, steps=100000),
                                ["--watch", "off"], "not_finite")
        self.assertIn("particle 1", err)
        self.assertIn("note: h = 100 s: with explicit-euler undamped vibrations grow", err)

    def test_beyond_what_energy_allows(self):
        for h, word in (0.1, "unstable"), (100, "not_finite"):
            err = self.assert_event(pendulum(integrator="explicit-euler", h=h, steps=100000), [],
                                    word, "the state of step {last} was restored")
            self.assertIn("particle 1", err)

    def test_not_positive_definite(self):
        scene = json.loads(json.dumps(PENDULUM))
        scene["springs"].update(k=1e6, rest=5)
        self.assert_event(scene, ["--integrator", "linearly-implicit-euler", "--h", "0.1",
                                  "--indefinite", "stop"], "not_spd")

    def test_not_converged(self):
        self.assert_event({"msim": 1, "gravity": [0, 0, -9.81], "objects": [
            {"type": "rope", "n": 50, "from": [0, 0, 0], "to": [1, 0, 0], "mass": 1, "k": 1e5,
             "pinned": [0]}]}, ["--integrator", "linearly-implicit-euler", "--h", "0.1", "--steps",
                                "10", "--solver", "pcg", "--solver.max_iterations", "2"],
            "not_converged")


class Streams(CliTest):
    COMMANDS = (["--help"], ["--version"], ["list"], ["run", "--help"], ["run", "scene.json"],
                ["explain", "scene.json"])

    def test_full_device(self):
        self.scene()
        for args in self.COMMANDS:
            with self.subTest(" ".join(args)), open("/dev/full", "w") as full:
                status, _, err = self.cli(*args, stdout=full)
                self.assertEqual(status, 1)
                self.assert_sentence(err, "standard output", "No space left")

    def test_reader_gone(self):
        self.scene()
        for args in self.COMMANDS:
            with self.subTest(" ".join(args)):
                read, write = os.pipe()
                os.close(read)
                status, _, err = self.cli(*args, stdout=write)
                os.close(write)
                self.assertEqual(status, 1)
                self.assert_sentence(err, "standard output", "Broken pipe")

    def test_closed(self):
        """If stdout is closed, output must not go into the file that is opened next."""
        self.scene()
        out = ["--out", "out.csv", "--steps", "2", "--every", "1"]
        status, _, err = self.cli("run", "scene.json", *out, stdout=None,
                                  preexec_fn=lambda: os.close(1))
        self.assertEqual(status, 1)
        self.assert_sentence(err, "standard output")
        self.assertEqual(self.frames(), [0, 1, 2])
        closed = lambda: [os.close(fd) for fd in (0, 1, 2)]
        self.assertEqual(self.cli("run", "scene.json", *out, "--quiet", stdout=None, stderr=None,
                                  preexec_fn=closed)[0], 0)
        self.assertEqual(self.frames(), [0, 1, 2])
        self.assertEqual(self.cli("run", "missing.json", stdout=None, stderr=None,
                                  preexec_fn=closed)[0], 1)

    def test_head(self):
        self.scene()
        done = subprocess.run(f"'{CLI}' run scene.json | head -1", shell=True, cwd=self.folder,
                              capture_output=True, text=True, timeout=100)
        self.assertEqual((done.stdout, done.returncode), ("pendulum\n", 0))

    def test_disk_full(self):
        """A file size limit simulates it: exit status 1, the frames so far are good."""
        self.scene()
        limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))
        status, out, err = self.cli("run", "scene.json", "--out", "out.csv", "--final",
                                    "final.json", "--steps", "1000", "--every", "1",
                                    preexec_fn=limit)
        self.assertEqual((status, out), (1, ""))
        self.assert_sentence(err, "out.csv", "File too large")
        self.assertEqual(self.files(), ["out.csv", "scene.json"])
        rows = self.rows()
        self.assertGreater(len(rows), 100)
        self.assertEqual(len(rows) % 2, 0)
        self.assertTrue(all(None not in row.values() for row in rows))

    def test_disk_full_for_the_final_state(self):
        self.scene()
        limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (500, 500))
        status, out, err = self.cli("run", "scene.json", "--final", "final.json",
                                    preexec_fn=limit)
        self.assertEqual((status, out), (1, ""))
        self.assert_sentence(err, "final.json", "File too large")
        self.assertEqual(self.files(), ["scene.json"])

    def test_quiet(self):
        self.scene()
        out = self.good("run", "scene.json", "--quiet", "--stats", "--out", "out.csv", "--h",
                        "0.03")
        self.assertEqual(out, "")

    def test_control_characters_do_not_reach_the_terminal(self):
        self.scene({**PENDULUM, "name": "a\x1b[31mb\nc"})
        self.assertEqual(self.good("run", "scene.json").splitlines()[0], "a [31mb c")
        self.assert_refused(["run", "no\x1b[31m\nfile.json"], "no [31m file.json")


class Report(CliTest):
    def test_summary(self):
        self.scene()
        out = self.good("run", "scene.json", "--out", "out.csv", "--final", "final.json")
        for pattern in (r"\Apendulum\n", r"velocity-verlet", r"steps +100 of h = 0.001 s",
                        r"from t = 0 s to t = 0.1 s", r"took +[0-9.e-]+ s", r"kinetic +0\.5 ",
                        r"elastic +\S+ +\S+ +\S+", r"total ", r"motion +out.csv; frames: 101",
                        r"last state +final.json"):
            self.assertRegex(out, pattern)
        self.assertNotIn("contacts", out)
        self.assertNotIn("force_evaluations", out)

    def test_stats(self):
        self.scene()
        out = self.good("run", "scene.json", "--stats")
        for name in COUNTERS | SECONDS:
            self.assertRegex(out, rf"(?m)^    {name} +[0-9.]+  [a-z].*$")
        titles = re.findall(r"(?m)^  (\w+)$", out)
        self.assertEqual(titles, ["steps", "forces", "matrices", "solutions", "contact", "seconds"])
        self.assertLessEqual(max(map(len, out[out.index("\n  steps\n"):].splitlines())), 80)

    def test_contacts(self):
        scene = {"msim": 1, "gravity": [0, 0, -9.81], "planes": [{"normal": [0, 0, 1], "offset": 0}],
                 "particles": {"x": [[0, 0, 0.1]], "mass": 1}}
        self.scene(scene)
        out = self.good("run", "scene.json", "--integrator", "rk4", "--t_end", "1")
        self.assertRegex(out, r"(?m)contacts +[1-9]\d* impacts or reflections of particles$")
        rope = {"type": "rope", "n": 3, "from": [0, 0, 0.2], "to": [1, 0, 0.2], "mass": 1, "k": 10}
        self.scene({**scene, "self_contact": {"thickness": 0.01}, "objects": [rope]})
        out = self.good("run", "scene.json", "--integrator", "rk4", "--t_end", "1")
        self.assertRegex(out, r"(?m)contacts +[1-9]\d* .* of particles, and pairs pushed apart$")

    def test_notes(self):
        self.scene()
        args = ["run", "scene.json", "--h", "0.03"]
        status, out, err = self.cli(*args)
        self.assertEqual(status, 0)
        self.assert_sentence(err, "note: ", "lowered")
        self.assertRegex(out, r"notes +1")

    def test_h_auto(self):
        self.scene()
        self.good("run", "scene.json", "--h", "auto", "--final", "final.json")
        chosen = self.final()["h"]
        self.assertGreater(chosen, 1e-3)
        self.assertIn(f"h = {chosen:.10g} s, 0.9 of the stability limit",
                      self.good("explain", "scene.json", "--h", "auto"))
        _, _, err = self.cli("run", "scene.json", "--h", "0.5", "--steps", "2", "--watch", "off")
        self.assert_sentence(err, "note: h = 0.5 s exceeds the stability limit")
        status, _, err = self.cli("run", "scene.json", "--h", "auto", "--integrator", "newmark")
        self.assertEqual(status, 1)
        self.assert_sentence(err, "h is 'auto', but newmark")

    def test_nothing_kept(self):
        self.scene()
        self.assertIn("--out FILE", self.good("run", "scene.json"))

    def test_explain(self):
        self.write("bare.json", {**PENDULUM, "run": {}})
        out = self.good("explain", "bare.json", "--integrator", "velocity-verlet")
        self.assertIn("velocity-verlet", out)
        self.assertEqual(self.files(), ["bare.json"])
        out = self.good("explain", "bare.json", "--integrator", "linearly-implicit-euler",
                        "--solver", "pcg", "--jacobian=clamp")
        self.assertIn("pcg", out)

    def compare(self, scene, *args):
        """Rows of the comparison by method, and the lines after the table."""
        self.write("bare.json", scene)
        out = self.good("explain", "bare.json", *args)
        table, _, advice = out.partition("\n\nrecommended   ")
        rows = re.findall(r"^(\w[\w-]*(?: \([\w-]+\))?) +(\S+) +(\S+) +(\S+) +(\S+)   (\S.*)$", table, re.M)
        return {row[0].split()[0]: row[1:] for row in rows if row[0] != "method"}, advice, out

    def test_explain_leads_with_advice(self):
        self.scene()
        lines = self.good("explain", "scene.json").splitlines()
        self.assertEqual([line.split(" ")[0] for line in lines[:6]],
                         ["advice", "method", "cost", "limit", "output", "scene"])

    def test_methods_are_compared_without_an_integrator(self):
        """h = 0.9 of the limit 2/omega, omega = sqrt(k/m) = 10/s; counts are those of runs."""
        bare = {**PENDULUM, "run": {}}
        rows, advice, out = self.compare(bare)
        self.assertIn("no integrator is given; to t = 1 s,", out)
        self.assertEqual(list(rows), ["velocity-verlet", "linearly-implicit-euler", "dop853", "auto"])
        self.assertEqual(rows["velocity-verlet"][:4], ("0.1667", "6", "7", "0"))
        self.assertEqual(rows["linearly-implicit-euler"][:4], ("0.01667", "60", "60", "60"))
        self.assertEqual([rows[name][4] for name in rows],
                         ["not known", "not known", "1e-06", "0.0001"])
        self.assertTrue(advice.startswith("--integrator auto --tol 0.0001: its error is known\n"))
        self.assertEqual(self.files(), ["bare.json"])
        final = {}
        for name, options in (("velocity-verlet", ["--h", "auto"]), ("dop853", ["--tol", "1e-6"])):
            self.good("run", "bare.json", "--integrator", name, *options, "--t_end", "1", "--quiet",
                      "--final", "final.json")
            final[name] = self.final()["stats"]
        self.assertEqual(int(rows["velocity-verlet"][2]),
                         final["velocity-verlet"]["force_evaluations"])
        steps = final["dop853"]["steps"]
        self.assertTrue(0.5 * steps <= float(rows["dop853"][1]) <= 2 * steps)

    def test_the_end_and_tol_of_a_comparison(self):
        rows, _, out = self.compare({**PENDULUM, "run": {"h": 0.01, "steps": 300}}, "--tol", "1e-3")
        self.assertIn("to t = 3 s,", out)
        self.assertEqual(rows["linearly-implicit-euler"][1], "180")
        self.assertEqual((rows["dop853"][4], rows["auto"][4]), ("0.001", "0.001"))
        _, _, out = self.compare({**PENDULUM, "run": {"t_end": 0.25}})
        self.assertIn("to t = 0.25 s,", out)

    def test_methods_that_are_refused_are_said_to_be(self):
        motion = {"t": [0, 1], "x": [[0, 0, -5], [0, 0, -6]]}
        collider = {"type": "sphere", "center": [0, 0, -5], "radius": 1, "motion": motion}
        rows, advice, out = self.compare({**PENDULUM, "run": {}, "colliders": [collider]})
        self.assertEqual(rows["auto"], ("-", "-", "-", "-", "-"))
        self.assertIn("does not support colliders that move", " ".join(out.split()))
        self.assertTrue(advice.startswith("--integrator dop853 --tol 1e-06: its error is"), advice)

    def test_every_scene_is_understood(self):
        scenes = sorted(SCENES.glob("*.json"))
        self.assertTrue(scenes)
        for scene in scenes:
            with self.subTest(scene.name):
                self.good("run", str(scene), "--integrator", "rk4", "--h", "1e-4", "--steps", "1",
                          "--quiet")
                self.good("explain", str(scene), "--integrator", "rk4", "--h", "1e-4")


class Progress(CliTest):
    def watch(self, *args, columns=100, bars=3, seconds=20, env=None):
        """The output on stderr, a terminal, of a run stopped after some bars or some time."""
        self.scene()
        terminal, slave = pty.openpty()
        self.addCleanup(os.close, terminal)
        ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
        shown, end = b"", time.monotonic() + seconds
        with self.start("run", "scene.json", "--out", "out.csv", *args, stderr=slave,
                        env={**os.environ, **(env or {})}) as process:
            os.close(slave)
            self.wait_for("out.csv")
            while process.poll() is None or select.select([terminal], [], [], 0)[0]:
                if shown.count(b"%") >= bars or time.monotonic() > end:
                    process.send_signal(signal.SIGINT)
                    bars, end = 1000, end + 1000
                try:
                    if select.select([terminal], [], [], 0.02)[0]:
                        shown += os.read(terminal, 65536)
                except OSError:  # the program has ended
                    break
            process.communicate(timeout=20)
        return shown.decode().replace("\r\n", "\n")

    def test_on_a_terminal(self):
        lines = self.watch(*FOR_EVER, columns=140).split("\r")
        bars = [line for line in lines if "%" in line]
        self.assertGreaterEqual(len(bars), 3)
        for bar in bars:
            self.assertRegex(bar, r"^\[[#-]+\] +\d+%  [0-9:]+ left  step +\d+/100000000000  "
                                  r"t \S+/\S+ s  \S+ steps/s *$")
        # erased before the last message
        self.assertRegex(lines[-1], r"\Amsim_cli: stopped at step \d+, t = .*\n\Z")
        self.assertEqual(lines[-2].strip(), "")

    def test_ten_times_a_second(self):
        start = time.monotonic()
        self.watch(*FOR_EVER, bars=11)
        self.assertGreater(time.monotonic() - start, 1.4)

    def test_never_wraps(self):
        for columns in (20, 40, 80, 200):
            with self.subTest(columns):
                bars = self.watch(*FOR_EVER, columns=columns).split("\r")[:-1]
                self.assertTrue(any("%" in bar for bar in bars))
                self.assertLess(max(map(len, bars)), columns)
                os.remove(self.folder / "out.csv")

    def test_width_from_the_environment(self):
        bars = self.watch(*FOR_EVER, columns=0, env={"COLUMNS": "30"}).split("\r")[:-1]
        self.assertTrue(any("%" in bar for bar in bars))
        self.assertLess(max(map(len, bars)), 30)

    def test_quiet(self):
        self.assert_sentence(self.watch(*FOR_EVER, "--quiet", seconds=1), "stopped")

    def test_not_in_a_short_run(self):
        self.assertEqual(self.watch("--steps", "100"), "")

    def test_not_into_a_pipe(self):
        self.scene()
        with self.start("run", "scene.json", *FOR_EVER, "--out", "out.csv") as process:
            self.wait_for("out.csv")
            time.sleep(1)
            process.send_signal(signal.SIGINT)
            _, err = process.communicate(timeout=20)
        self.assert_sentence(err, "stopped")


if __name__ == "__main__":
    support.main()
