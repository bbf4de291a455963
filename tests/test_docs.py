"""Tests that README.md and docs say what works: each snippet is run, each link leads somewhere.

A block of code is fenced with its language and, if it is a file, the file's name:
  ```json NAME    a scene, written to that file and loaded
  ```c NAME       a program, written to that file, compiled and run
  ```sh           commands, each of which must succeed, in a folder with the files of the page
Other blocks show something and are not run."""
import os
import re
import subprocess
import tempfile
import unittest
from pathlib import Path

import support

PAGES = [support.SOURCE / "README.md", *sorted((support.SOURCE / "docs").glob("*.md"))]
BLOCK = re.compile(r"^```(\w+)(?: (\S+))?\n(.*?)^```$", re.S | re.M)
LINK = re.compile(r"\]\(([^)#\s]+)(?:#([^)]*))?\)")
INCLUDE = re.compile(r"^```\{include\} (\S+)\n```$", re.M)
FENCED = re.compile(r"^```.*?^```$", re.S | re.M)


def headings(page):
    text = INCLUDE.sub(lambda found: (page.parent / found[1]).read_text(), page.read_text())
    return re.findall(r"^#+ (.*)$", FENCED.sub("", text), re.M)


def anchor(heading):
    """As GitHub and MyST make it."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


class Snippets(unittest.TestCase):
    def run_in(self, folder, *command):
        environment = {**os.environ, "PATH": f"{self.cli.parent}:{os.environ['PATH']}"}
        done = subprocess.run(command, cwd=folder, env=environment, text=True, timeout=300,
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, check=False)
        self.assertEqual(done.returncode, 0, f"{command}\n{done.stdout}")
        return done.stdout

    def compile(self, folder, file):
        library = support.shared_library()
        sanitizer = support.setting("SANITIZE")
        self.run_in(folder, support.setting("CC"), "-std=c11", "-Wall", "-Wextra", "-Werror",
                    *([f"-fsanitize={sanitizer}"] if sanitizer else []),
                    f"-I{support.SOURCE / 'include'}", file, str(library),
                    f"-Wl,-rpath,{library.parent}", "-o", Path(file).stem)
        self.run_in(folder, f"./{Path(file).stem}")

    def try_page(self, page, folder):
        for language, name, code in BLOCK.findall(page.read_text()):
            if name:
                Path(folder, name).write_text(code)
            if language == "json" and name:
                self.run_in(folder, self.cli, "explain", name)
            elif language == "sh":
                self.run_in(folder, "bash", "-e", "-c", code)
            elif language == "c" and name:
                self.compile(folder, name)

    def test_each_runs(self):
        self.cli = Path(support.setting("CLI"))
        for page in PAGES:
            with self.subTest(page.name), tempfile.TemporaryDirectory() as folder:
                self.try_page(page, folder)


class Links(unittest.TestCase):
    def test_each_leads_somewhere(self):
        for page in PAGES:
            for target, section in LINK.findall(page.read_text()):
                if re.match(r"\w+:", target):
                    continue
                self.assertTrue((page.parent / target).exists(), f"{page.name}: {target}")
                if section:
                    self.assertIn(section, map(anchor, headings(page.parent / target)),
                                  f"{page.name}: {target}")


class HowDoI(unittest.TestCase):
    """Each question is answered in a few lines, and its answer is found by the contents alone."""
    PAGE = support.SOURCE / "docs" / "how_do_i.md"

    def questions(self):
        return re.findall(r"^\*\*(How do I .*?\?)\*\* (.*?)(?=\n\n|\Z)", self.PAGE.read_text(),
                          re.S | re.M)

    @staticmethod
    def stems(text):
        """The beginnings of the words by which a reader searches"""
        common = {"with", "from", "what", "that", "when", "while", "them", "this", "make", "find",
                  "does", "before", "given", "msim", "first", "which", "after"}
        words = re.findall(r"\w+", text.lower().replace("how do i", ""))
        return {word[:5] for word in words if len(word) > 3 and word not in common}

    def test_length(self):
        self.assertGreaterEqual(len(self.questions()), 28)
        for question, answer in self.questions():
            prose = re.sub(r"`[^`]*`|\]\([^)]*\)", "", answer)
            sentences = re.findall(r"[^.:]+[.:](?=\s|$)", prose)
            self.assertLessEqual(len(sentences), 5, question)

    def test_the_contents_alone_lead_to_each_answer(self):
        for question, answer in self.questions():
            with self.subTest(question):
                entries = []
                for target, section in LINK.findall(answer):
                    titles = headings(self.PAGE.parent / target)
                    entries += [title for title in titles
                                if anchor(title) == section or title == titles[0]]
                self.assertTrue(self.stems(question) & self.stems(" ".join(entries)), entries)


class Readme(unittest.TestCase):
    def test_it_is_short(self):
        text = (support.SOURCE / "README.md").read_text()
        self.assertLessEqual(text.count("\n"), 150)
        prose = re.sub(r"^(```.*?^```|\|.*?)$", "", text, flags=re.S | re.M)
        lengths = sorted(len(sentence.split()) for sentence in re.split(r"[.:]\s|\n\n|\n- ", prose)
                         if sentence.strip())
        self.assertLessEqual(lengths[int(0.9 * len(lengths))], 25)

    def test_numbers_are_those_of_what_they_count(self):
        text = (support.SOURCE / "README.md").read_text()
        methods = (support.SOURCE / "src/methods/methods.h").read_text()
        gallery = (support.SOURCE / "docs/gallery.md").read_text()
        for words, number in ((r"(\d+) integrators", methods.count("  X(ms_")),
                              (r"(\d+) scenes with their pictures", gallery.count("| !["))):
            self.assertEqual(re.search(words, text).group(1), str(number))


if __name__ == "__main__":
    support.main()
