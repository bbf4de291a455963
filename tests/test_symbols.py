"""Tests of the exported symbols and needed libraries of the binaries; and that each header compiles
alone, in every supported language."""
import os
import re
import shutil
import unittest

import support

# libdl and libpthread are parts of libc since glibc 2.34
NEEDED = re.compile(r"(libc|libm|libjansson|libdl|libpthread|ld-linux.*)\.so\.\d+")
SANITIZER = re.compile(r"lib(asan|lsan|tsan|ubsan)\.so\.\d+")


# of the linker, exported where a library behind a plugin refers to them
ENDS = {"__bss_start", "_edata", "_end"}


def symbols(path, kind):
    return {line.split()[-1].split("@")[0]
            for line in support.run("nm", "-D", kind, path).splitlines()} - ENDS


def dynamic(path, tag):
    text = support.run("readelf", "-d", "-W", path)
    return re.findall(rf"\({tag}\)[^\[]*\[([^\]]*)\]", text)


def promised():
    """The functions that the public headers declare."""
    text = "".join(path.read_text() for path in (support.SOURCE / "include/msim").glob("*.h"))
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.S)
    text = re.sub(r"^\s*#.*", "", text, flags=re.M)
    return set(re.findall(r"\bMSIM_API\b[^;(]*?(\w+)\s*\(", text))


class Symbols(unittest.TestCase):
    def setUp(self):
        self.library = support.shared_library()

    def test_library_exports_what_its_header_promises(self):
        self.assertEqual(symbols(self.library, "--defined-only"), promised())

    def test_library_needs_little(self):
        for needed in dynamic(self.library, "NEEDED"):
            if support.setting("SANITIZE") and SANITIZER.fullmatch(needed):
                continue
            self.assertRegex(needed, NEEDED)
        self.assertEqual(dynamic(self.library, "SONAME"), ["libmsim.so.0"])

    def test_library_leaves_the_environment_alone(self):
        """The programs set the variable that chooses OpenBLAS kernels, the library never does."""
        self.assertEqual(symbols(self.library, "--undefined-only") &
                         {"setenv", "putenv", "unsetenv", "clearenv"}, set())

    def test_plugins_show_their_entry_and_use_nothing_of_ours(self):
        support.require(support.plugins(), "every plugin")
        for name, path in support.plugins().items():
            with self.subTest(plugin=name):
                kind = name.split("_")[0]
                self.assertEqual(symbols(path, "--defined-only"), {f"msim_{kind}_entry"})
                ours = {s for s in symbols(path, "--undefined-only") if re.match("(msim|ms)_", s)}
                self.assertEqual(ours, set())
                self.assertNotIn("libmsim.so.0", dynamic(path, "NEEDED"))


class Headers(unittest.TestCase):
    def compile(self, compiler, language, standard, header):
        support.run(compiler, "-x", language, f"-std={standard}", "-Wall", "-Wextra", "-Wpedantic",
                    "-Werror", "-fsyntax-only", "-I", support.SOURCE / "include",
                    "-include", f"msim/{header}", "-include", f"msim/{header}", "/dev/null")

    def each(self, compiler, language, *standards):
        for standard in standards:
            for header in sorted(os.listdir(support.SOURCE / "include/msim")):
                with self.subTest(standard=standard, header=header):
                    self.compile(compiler, language, standard, header)

    def test_c(self):
        self.each(support.setting("CC"), "c", "c99", "c11", "c17")

    def test_cplusplus(self):
        compiler = shutil.which("c++")
        support.require(compiler, "a C++ compiler")
        self.each(compiler, "c++", "c++11", "c++17")


if __name__ == "__main__":
    support.main()
