"""Tests of the sources: includes between modules, lengths of files, functions and lines."""
import re
import unittest
from pathlib import Path

import support

LEVELS = {"base": 0, "scene": 1, "layout": 2, "physics": 3, "linear": 4, "contact": 5, "integrate": 5, "methods": 5, "sim": 6,
          "choose": 7, "statics": 7, "checkpoint": 8, "record": 9, "report": 9, "api": 10}
# The modules and headers that a module may include besides its own headers and those of C11;
# layout, physics, linear and integrate only compute.
C11 = {name + ".h" for name in
       """assert complex ctype errno fenv float inttypes iso646 limits locale math setjmp signal
       stdalign stdarg stdatomic stdbool stddef stdint stdio stdlib stdnoreturn string tgmath time
       wchar wctype""".split()}
SYSTEM = {"base": {"dlfcn.h", "immintrin.h", "pthread.h", "sched.h", "sys/mman.h", "unistd.h"},
          "scene": {"jansson.h"}, "record": {"dirent.h", "fcntl.h", "sys/stat.h", "unistd.h"}}
LONGEST_FILE, LONGEST_FUNCTION, LONGEST_LINE = 500, 50, 100

INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]+(?:"([^"]+)"|<([^>]+)>)', re.M)
COMMENT_OR_STRING = re.compile(r'/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\\n])*"|'
                               r"'(?:\\.|[^'\\\n])*'", re.S)
PREPROCESSOR = re.compile(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", re.M)


def files(*folders, pattern="*.[ch]"):
    return sorted(p for f in folders for p in (support.SOURCE / f).rglob(pattern) if p.is_file())


def name(path):
    return str(path.relative_to(support.SOURCE))


def is_ours(include):
    return any((support.SOURCE / folder / include).is_file() for folder in ("include", "src"))


def includes(path):
    """The headers of the project that a file includes, as it spells them, in either quotes."""
    return [quoted or angled for quoted, angled in INCLUDE.findall(path.read_text())
            if quoted or is_ours(angled)]


def system_includes(path):
    """All other headers that a file includes."""
    return [angled for _, angled in INCLUDE.findall(path.read_text())
            if angled and not is_ours(angled)]


def is_neighbour(path, include):
    return (path.parent / include).is_file()


def blank(match):
    """The same number of empty lines."""
    return "\n" * match.group().count("\n")


def functions(text):
    """(line, lines) of each function: the text between braces at file level, after a `)`."""
    text = PREPROCESSOR.sub(blank, COMMENT_OR_STRING.sub(blank, text))
    text = re.sub(r'extern\s*\{', "", text)
    depth, start, first, is_function = 0, 0, 0, False
    for brace in re.finditer(r"[{};]", text):
        at = brace.start()
        if brace.group() == "{":
            if depth == 0:
                head = text[start:at]
                is_function = head.rstrip().endswith(")")
                first = text.count("\n", 0, start + len(head) - len(head.lstrip()))
            depth += 1
            continue
        if brace.group() == "}":
            depth = max(depth - 1, 0)
            if depth == 0 and is_function:
                yield first + 1, text.count("\n", 0, at) - first + 1
        if depth == 0:
            start = at + 1


def definitions(text):
    """Names of the functions with external linkage that a file defines; text: without comments."""
    return re.findall(r"^(?!static)[A-Za-z_][\w \*]*?\b(msi?m?_\w+)\([^;{]*\)\s*\{", text, re.M)


def circles(uses):
    """The files that use each other, in groups; uses: {file: files whose functions it names}."""
    def reach(start):
        seen, todo = set(), [start]
        while todo:
            for other in uses[todo.pop()] - seen:
                seen.add(other)
                todo.append(other)
        return seen

    reached = {file: reach(file) for file in uses}
    return sorted({tuple(sorted(other for other in reached[file] if file in reached[other]))
                   for file in uses if file in reached[file]})


def uses_of(texts):
    """{file: the other files whose functions it names}; texts: {file: its text}."""
    code = {file: COMMENT_OR_STRING.sub(blank, text) for file, text in texts.items()}
    home = {function: file for file, text in code.items() for function in definitions(text)}
    return {file: {home[word] for word in re.findall(r"\b\w+\b", text) if word in home} - {file}
            for file, text in code.items()}


class Layers(unittest.TestCase):
    def check(self, path, include, allowed, why):
        self.assertTrue(allowed, f"{name(path)} includes {include}: {why}")

    def test_modules_look_down(self):
        sources = files("src")
        self.assertTrue(sources)
        for path in sources:
            own = path.relative_to(support.SOURCE / "src").parts[0]
            self.assertIn(own, LEVELS, f"{name(path)}: no level is known for this module")
            for include in includes(path):
                module = Path(include).parts[0] if "/" in include else own
                self.check(path, include, module == "msim" or module in LEVELS, "unknown module")
                self.check(path, include, LEVELS.get(module, 0) <= LEVELS[own],
                           f"{module} is above {own}")
            for include in system_includes(path):
                self.check(path, include, include in C11 | SYSTEM.get(own, set()),
                           f"{own} needs no such header")

    def test_files_do_not_call_in_circles(self):
        texts = {name(path): path.read_text() for path in files("src", pattern="*.c")}
        self.assertEqual(circles(uses_of(texts)), [])

    def test_the_search_for_circles_itself(self):
        texts = {"a.c": "int ms_a(void) { return ms_b(); }", "b.c": "int ms_b(void) { ms_c(); }",
                 "c.c": "void ms_c(void) {\n  ms_b();\n}", "d.c": "static int ms_d(void) { ms_a(); }"}
        self.assertEqual(circles(uses_of(texts)), [("b.c", "c.c")])

    def test_backends_see_their_table_only(self):
        for path in files("backends"):
            for include in includes(path):
                self.check(path, include,
                           include in ("msim/backend.h", "msim/comm.h", "msim/importer.h",
                                       "msim/recorder.h", "msim/status.h")
                           or is_neighbour(path, include), "a plugin sees its table only")

    def test_tools_see_public_headers_only(self):
        # the reference loop is compiled for the instruction set that the library uses
        shared = {("tools/bench_reference/textbook.h", "base/isa.h")}
        for path in files("tools"):
            for include in includes(path):
                public = include.startswith("msim/") and (support.SOURCE / "include" / include)
                self.check(path, include, public and public.is_file()
                           or is_neighbour(path, include) or (name(path), include) in shared,
                           "tools see public headers only")

    def test_public_headers_stand_alone(self):
        for path in files("include"):
            for include in includes(path):
                self.check(path, include, include.startswith("msim/"), "not public")
            for include in system_includes(path):
                self.check(path, include, include in ("stddef.h", "stdint.h"),
                           "a program that includes it would need that, too")


class Sizes(unittest.TestCase):
    maxDiff = None
    FOLDERS = "include", "src", "backends", "tools", "tests"

    def assert_none(self, offenders):
        self.assertEqual([f"{name(path)}:{line}: {size}" for path, line, size in offenders], [])

    def test_files(self):
        others = files("tools", "tests", pattern="*.py") + files("tools", "tests", pattern="*.[ch]pp")
        sizes = [(path, 1, path.read_text().count("\n")) for path in files(*self.FOLDERS) + others]
        self.assert_none(size for size in sizes if size[2] > LONGEST_FILE)

    def test_functions(self):
        self.assert_none((path, line, lines) for path in files(*self.FOLDERS)
                         for line, lines in functions(path.read_text())
                         if lines > LONGEST_FUNCTION)

    def test_lines(self):
        self.assert_none((path, i, len(line)) for path in files(*self.FOLDERS)
                         for i, line in enumerate(path.read_text().splitlines(), 1)
                         if len(line) > LONGEST_LINE)

    def test_the_scan_itself(self):
        text = ('#define M(x) \\\n  do { x; } while (0)\nextern "C" {\n'
                'static const int a[] = {1};\nstruct s { int i; };\n/* } */\n'
                "int f(int i)\n{\n  if (i) {\n  }\n  return '}';\n}\n")
        self.assertEqual(list(functions(text)), [(7, 6)])


if __name__ == "__main__":
    support.main()
