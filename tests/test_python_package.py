"""Tests of tools/python that need neither its compiler nor packages: what it repeats of the C code."""
import ast
import re
import unittest

import support

PACKAGE = support.SOURCE / "tools/python"


def text(path):
    return (support.SOURCE / path).read_text()


class PythonPackage(unittest.TestCase):
    def test_version(self):
        parts = [re.search(rf"MSIM_VERSION_{part} (\d+)", text("include/msim/api.h"))[1]
                 for part in ("MAJOR", "MINOR", "PATCH")]
        version = f'\nversion = "{".".join(parts)}"\n'
        self.assertIn(version, text("tools/python/pyproject.toml"))
        self.assertIn(version, text("tools/python/cholmod/pyproject.toml"))

    def test_statuses(self):
        in_c = dict(re.findall(r"X\(MSIM_(\w+), (-?\d+),", text("include/msim/status.h")))
        in_python = dict(re.findall(r"^    ([A-Z_]+) = (-?\d+)$",
                                    text("tools/python/src/msim/_errors.py"), re.M))
        self.assertEqual(in_python, in_c)

    def test_counts_of_stats(self):
        members = re.search(r"typedef struct msim_stats \{(.*?)\}", text("include/msim/msim.h"), re.S)
        code = re.sub(r"/\*.*?\*/|\b(size_t size|int64_t|double)\b", "", members[1], flags=re.S)
        bound = re.findall(r"ADD\((\w+)\)", text("tools/python/core/readings.cpp"))
        self.assertEqual(sorted(set(bound) - {"name"}), sorted(re.findall(r"\w+", code)))

    def test_sources_of_the_archive(self):
        tree = ast.parse(text("tools/python/build_backend.py"))
        names = next(ast.literal_eval(node.value) for node in tree.body
                     if isinstance(node, ast.Assign) and node.targets[0].id == "_SOURCES")
        for name in names:
            self.assertTrue((support.SOURCE / name).exists(), name)
        folders = re.findall(r"(?:include|add_subdirectory)\((?!tests)([\w/]+)[/)]",
                             text("CMakeLists.txt"))
        for folder in set(folders) - {"tools", "GNUInstallDirs"}:
            self.assertTrue(any(folder.startswith(name) for name in names), folder)

    def test_modules_compile(self):
        for path in sorted(PACKAGE.rglob("*.py*")):
            if path.suffix in (".py", ".pyi"):
                compile(path.read_text(), str(path), "exec")


if __name__ == "__main__":
    support.main()
