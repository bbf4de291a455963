"""Helpers that the tests of msim_bench share."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import support
from cli_support import CliTest, no_constant


def plot_bench(*arguments, cwd):
    """Exit status and what is printed."""
    done = subprocess.run([sys.executable, support.SOURCE / "tools/plot_bench", *arguments], cwd=cwd,
                          text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    return done.returncode, done.stdout


class BenchTest(CliTest):
    PROGRAM = os.environ["MSIM_BENCH"]

    def result(self, name="out.json"):
        return json.loads((self.folder / name).read_text(), parse_constant=no_constant)

    def find(self, rows, **wanted):
        return [row for row in rows if wanted.items() <= row.items()]

    def check_printed(self, summary, out):
        for key, value in summary.items():
            printed = "no result" if value is None else "[-0-9.e]+"
            self.assertRegex(out, rf"(?m)^  {key} +{printed}$")


class Children(BenchTest):
    @staticmethod
    def children(process):
        """The reference programs and background loads, with their entries in /proc."""
        text = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text()
        return [Path("/proc") / pid for pid in text.split()]

    @staticmethod
    def alive(child):
        """True if the process runs; a zombie without a waiting parent does not."""
        try:
            return (child / "stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
        except OSError:
            return False

    def wait_for_line(self, process, pattern):
        for line in process.stdout:
            if re.match(pattern, line):
                return
        self.fail(f"no line like '{pattern}' was printed")
