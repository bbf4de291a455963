"""Tests of the end of tools/quickstart, read from it: its run and the commands that it proposes work
with the msim_cli of this build."""
import os
import re

import support
from cli_support import CliTest

SCRIPT = (support.SOURCE / "tools/quickstart").read_text()


class Quickstart(CliTest):
    def bash(self, command, **variables):
        return support.run("bash", "-c", command, cwd=self.folder, env={
            **os.environ, "build": support.setting("BUILD"), "top": str(support.SOURCE),
            **variables})

    def test_its_scene_runs(self):
        """The command after the build, up to its `|| fail`"""
        found = re.search(r'^"\$build/bin/msim_cli" run .*?(?= \|\|)', SCRIPT, re.M | re.S)
        self.assertIsNotNone(found, "tools/quickstart runs another command")
        page = self.folder / "cloth.html"
        report = self.bash(f'cd "$top" && {found.group()}', page=str(page))
        self.assertIn("from t = 0 s to t = 2 s", report)
        self.assertGreater(page.stat().st_size, 100000)

    def test_what_to_try_next_works(self):
        commands = re.findall(r"^  (\$build/bin/msim_cli .*)", SCRIPT, re.M)
        self.assertEqual(len(commands), 3)
        for command in commands:
            with self.subTest(command):
                self.bash(command)
        self.assertEqual(self.files(), ["jelly.html"])


if __name__ == "__main__":
    support.main()
