"""Runs the last command of tools/quickstart, read from it, with the msim_cli of this build."""
import os
import re
import unittest

import support
from cli_support import CliTest


class Quickstart(CliTest):
    def command(self):
        """The command after the build, up to its `|| fail`; it uses $build and $trajectory."""
        script = (support.SOURCE / "tools/quickstart").read_text()
        found = re.search(r'^"\$build/bin/msim_cli" run .*?(?= \|\|)', script, re.M | re.S)
        self.assertIsNotNone(found, "tools/quickstart runs another command")
        return found.group()

    def test_its_scene_runs(self):
        name = "cloth.vtkhdf" if "recorder_hdf5" in support.plugins() else "cloth.csv"
        report = support.run("bash", "-c", self.command(), cwd=support.SOURCE,
                             env={**os.environ, "build": support.setting("BUILD"),
                                  "trajectory": str(self.folder / name)})
        self.assertIn("from t = 0 s to t = 2 s", report)
        self.assertGreater((self.folder / name).stat().st_size, 100000)


if __name__ == "__main__":
    support.main()
