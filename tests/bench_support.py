"""What the tests of msim_bench share."""

import json
import os

from cli_support import CliTest, no_constant


class BenchTest(CliTest):
    PROGRAM = os.environ["MSIM_BENCH"]

    def result(self, name="out.json"):
        return json.loads((self.folder / name).read_text(), parse_constant=no_constant)

    def find(self, rows, **wanted):
        return [row for row in rows if wanted.items() <= row.items()]
