"""Tests of the operators of tools/mutate, on a function to which each of them applies."""
import sys
import tempfile
import unittest
from pathlib import Path

import support

sys.path.insert(0, str(support.SOURCE / "tools"))
from mutations import OPERATORS, accepted_mutations, describe, mutations_of  # noqa: E402

CODE = """\
#define LIMIT 3
/* a + b; f(x[0]) */
static int sum(int *x, int n) {
  int s = 0;
  for (int i = 0; i < n; i++)
    if (x[i] > 4 && x[0] == n) s += twice(x[i],
                                          0.5);
  if (n * s != 1) fsync(s);
  return puts("x - 1");
}
"""
ADDED = "if (x[i] > 4 && x[0] == n) s += twice(x[i],"
EXPECTED = {
    "sign": [(6, ADDED.replace("+=", "-=")), (8, "if (n / s != 1) fsync(s);")],
    "constant": [(4, "int s = 1;"), (5, "for (int i = 1; i < n; i++)"),
                 (6, ADDED.replace("> 4", "> 5")), (7, "2 * 0.5);"),
                 (8, "if (n * s != 2) fsync(s);")],
    "boundary": [(5, "for (int i = 0; i <= n; i++)"), (6, ADDED.replace("> 4", ">= 4"))],
    "dropped": [(6, "if (x[i] > 4 && x[0] == n) ;"), (8, "if (n * s != 1) ;")],
    "sync": [(8, "if (n * s != 1) 0;")],
    "index": [(6, ADDED.replace("(x[i] >", "(x[i + 1] >")), (6, ADDED.replace("x[0]", "x[1]")),
              (6, ADDED.replace("twice(x[i]", "twice(x[i + 1]"))],
    "negated": [(6, "if (!(x[i] > 4 && x[0] == n)) s += twice(x[i],"),
                (8, "if (!(n * s != 1)) fsync(s);"), (6, ADDED.replace("==", "!=")),
                (8, "if (n * s == 1) fsync(s);")],
    "logic": [(6, ADDED.replace("&&", "||"))],
}


class Accepted(unittest.TestCase):
    def test_each_can_be_made(self):
        for file, before, after in accepted_mutations(support.SOURCE / "tests/mutations_accepted.txt"):
            with self.subTest(file, before=before):
                path = support.SOURCE / file
                made = [describe(m)[1:] for operator in OPERATORS
                        for m in mutations_of(path, operator)]
                self.assertTrue((before, after) in made, f"no such mutation: {after}")


class Operators(unittest.TestCase):
    maxDiff = None

    def test_each_finds_its_places(self):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "sum.c"
            file.write_text(CODE)
            for operator in OPERATORS:
                with self.subTest(operator):
                    found = [describe(m) for m in mutations_of(file, operator)]
                    self.assertEqual([(line, after) for line, _, after in found],
                                     EXPECTED[operator])


if __name__ == "__main__":
    support.main()
