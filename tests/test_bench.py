"""Tests of the command line of msim_bench, and that nothing of it is left when it is stopped."""

import os
import signal
import time

import support
from bench_support import BenchTest, Children


class Help(BenchTest):
    def test_help(self):
        out = self.good("--help")
        for word in ("Usage: msim_bench", "linear", "--quick", "--json FILE", "--scene NAME",
                     "--threads N", "cloth32", "mesh500", "forces", "scaling", "step",
                     "precision", "distributed", "--ranks N", "tools/plot_bench"):
            self.assertIn(word, out)
        self.assertLessEqual(max(map(len, out.splitlines())), 80)
        self.assertEqual(self.good("linear", "--help"), out)

    def test_version(self):
        self.assertRegex(self.good("--version"), r"\Amsim_bench \d+\.\d+\.\d+\n\Z")


class Refusals(BenchTest):
    def test_command_line(self):
        (self.folder / "folder").mkdir()
        os.mkfifo(self.folder / "pipe")
        for args, *words in [
            ([], "name of a bench", "linear", "or distributed", "'msim_bench --help'"),
            (["linaer"], "'linaer'"),
            (["linear", "linear"], "one bench"),
            (["--scene", "cloth32", "stability"], "'stability'", "its own scenes"),
            (["linear", "--svg", "a"], "'--svg'"),
            (["linear", "--quik"], "'--quik'"),
            (["linear", "--quick=1"], "--quick takes no value"),
            (["linear", "-q"], "'-q'"),
            (["linear", "--json"], "--json needs a value"),
            (["linear", "--json="], "--json"),
            (["linear", "--threads", "-1"], "threads", "'-1'"),
            (["forces", "--threads", "2"], "--threads", "forces"),
            (["linear", "--scene", "cloth32,cloth33"], "'cloth33'", "cloth32, cloth64"),
            (["linear", "--scene", ""], "''"),
            (["skip", "--scene", "cloth32"], "--scene", "'skip'"),
            (["scaling", "--scene", "cloth32,mesh100"], "'mesh100'", "'scaling'", "jelly8"),
            (["step", "--scene", "cloth32,cloth316"], "'cloth316'", "'step'"),
            (["precision", "--scene", "damped_rop"], "'damped_rop'", "'precision'", "damped_rope"),
            (["precision", "--scene", "chain,"], "''", "chain, "),
            (["step", "--threads", "2"], "--threads", "'step'"),
            (["linear", "--ranks", "2"], "'linear'", "--ranks"),
            (["distributed", "--ranks", "1,x"], "'1,x'", "1 to 64"),
            (["distributed", "--ranks", ""], "''"),
            (["distributed", "--ranks", "0"], "'0'"),
            (["distributed", "--ranks", "65"], "'65'"),
            (["distributed", "--ranks", "1,1,1,1,1,1,1,1,1"], "8 numbers"),
            (["distributed", "--threads", "2"], "--threads", "'distributed'"),
            (["linear", "--json", "missing/a.json"], "missing/a.json"),
            (["linear", "--json", "folder"], "folder", "a folder"),
            (["linear", "--json", "pipe"], "pipe", "not a file"),
        ]:
            with self.subTest(" ".join(args)):
                self.assert_refused(args, *words)


class Stopping(Children):
    def test_signals(self):
        (self.folder / "out.json").write_text("old")
        for number in (signal.SIGINT, signal.SIGTERM):
            with self.subTest(number.name):
                with self.start("linear", "--scene", "cloth64", "--json",
                                "out.json") as process:
                    self.wait_for_line(process, "cloth64")
                    time.sleep(0.5)
                    children = self.children(process)
                    process.send_signal(number)
                    _, err = process.communicate(timeout=20)
                self.assertEqual(process.returncode, 2)
                self.assert_sentence(err, "interrupted", "no file")
                self.assertEqual([child for child in children if self.alive(child)], [])
                self.assertEqual(self.files(), ["out.json"])
                self.assertEqual((self.folder / "out.json").read_text(), "old")

    def test_precision_in_time(self):
        with self.start("precision", "--json", "out.json") as process:
            self.wait_for_line(process, "trampoline")
            time.sleep(0.5)
            process.send_signal(signal.SIGINT)
            _, err = process.communicate(timeout=20)
        self.assertEqual(process.returncode, 2)
        self.assert_sentence(err, "interrupted", "no file")
        self.assertEqual(self.files(), [])

    def test_children_do_not_outlive_a_kill(self):
        with self.start("linear", "--scene", "cloth32") as process:
            self.wait_for_line(process, "cloth32")
            children = self.children(process)
            process.kill()
            process.communicate(timeout=20)
        self.wait_until(lambda: not any(self.alive(child) for child in children),
                        "children are still there")


if __name__ == "__main__":
    support.main()
