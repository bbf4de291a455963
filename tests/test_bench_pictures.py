"""Tests of the diagrams of msim_bench --svg, with gnuplot and without."""

import os
import re
import shutil
from xml.etree import ElementTree

import support
from bench_support import BenchTest


class Picture(BenchTest):
    """For one small scene: the input of a substitute for gnuplot, and the output of gnuplot."""
    SMALL = ["forces", "--quick", "--scene", "cloth100,jelly16,cloth32", "--svg", "out.svg"]

    def stand_in(self, script):
        """A PATH that contains only this script, as gnuplot."""
        folder = self.folder / "bin"
        folder.mkdir()
        if script:
            (folder / "gnuplot").write_text("#!/bin/sh\n" + script)
            (folder / "gnuplot").chmod(0o755)
        return {**os.environ, "PATH": str(folder)}

    def test_without_gnuplot(self):
        path = self.stand_in(None)
        with self.start(*self.SMALL, "--json", "out.json", env=path) as process:
            out, err = process.communicate(timeout=10)
        self.assertEqual((process.returncode, out), (1, ""))
        self.assert_sentence(err, "--svg", "gnuplot", "--json")
        self.assertEqual(self.files(), ["bin"])

    def test_script(self):
        status, _, err = self.cli(*self.SMALL, env=self.stand_in(
            'while read -r line; do echo "$line"; done\n'))
        self.assertEqual((status, err), (0, ""))
        script = (self.folder / "out.svg").read_text()
        self.assertEqual(self.files(), ["bin", "bin/gnuplot", "out.svg"])
        self.assertIn("set terminal svg", script)
        blocks = dict(re.findall(r"(?ms)^\$data(\d+) << END\n(.*?)^END$", script))
        titles = re.findall(r"title '([^']*)'", script.partition("\nplot ")[2])
        self.assertLessEqual({"msim, 1 thread", "textbook, 1 thread"}, set(titles))
        self.assertEqual(len(blocks), len(titles))
        for block in blocks.values():
            places = re.findall(r'(?m)^(\d+) [0-9.]+ "(\w+)"$|^$', block.strip())
            self.assertEqual(places, [("5826", "cloth32"), ("59002", "cloth100"), ("", ""),
                                      ("46620", "jelly16")])

    def test_gnuplot_that_fails(self):
        (self.folder / "out.svg").write_text("old")
        status, _, err = self.cli(*self.SMALL, env=self.stand_in(
            '[ "$2" = --version ] || exit 3\n'))
        self.assertEqual(status, 1)
        self.assert_sentence(err, "gnuplot", "3")
        self.assertEqual((self.folder / "out.svg").read_text(), "old")
        self.assertNotIn("out.svg.part", self.files())

    def test_svg(self):
        support.require(shutil.which("gnuplot"), "gnuplot")
        for args, words in [
            (self.SMALL, ("msim, 1 thread", "cloth32", "jelly16")),
            (["scaling", *self.SMALL[1:3], "cloth32,jelly8", *self.SMALL[4:]],
             ("auto", "cloth32", "jelly8")),
            (["step", *self.SMALL[1:3], "cloth32", *self.SMALL[4:]], ("relative error",)),
            (["linear", *self.SMALL[1:3], "cloth32", *self.SMALL[4:]], ("auto", "pcg", "cloth32")),
        ]:
            with self.subTest(args[0]):
                self.good(*args)
                self.assertEqual(self.files(), ["out.svg"])
                picture = ElementTree.parse(self.folder / "out.svg").getroot()
                self.assertEqual(picture.tag, "{http://www.w3.org/2000/svg}svg")
                text = "".join(picture.itertext())
                for word in words:
                    self.assertIn(word, text)


if __name__ == "__main__":
    support.main()
