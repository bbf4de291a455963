# shellcheck shell=bash
# Sourced by check: what --full does besides. Each function is one check, and counts as one where
# it runs no tests; a tool that is not there leaves it out, by name.

# check TOOL NAME COMMAND...
check() {
  local tool=$1 name=$2
  shift 2
  if ! command -v "$tool" >/dev/null; then
    note "no $tool: $name is left out"
    skipped+=("$name")
  elif step "$name" "$@"; then
    passed=$((passed + 1))
  else
    failed=$((failed + 1))
  fi
}

# Tests that can go on for longer do, where this is set.
long_tests() { MSIM_LONG_TESTS=1 tests release -L 'long|full'; }

# What the address sanitizer has not seen yet.
sanitized_long() { tests asan -LE full -R "$long_runs"; }

# Speeds, and results that other builds have seen, tell nothing about threads.
thread_sanitizer() {
  build tsan tsan -DMSIM_TEST_TIMEOUT=1200
  TSAN_OPTIONS=halt_on_error=1 tests tsan \
    -R '^(pool|parallel|threads_(pcg|cholmod)|islands|auto|sim|recorder|cli_running)$'
}

# The same bits as by GCC, with the same flags.
clang_bits() {
  CC=clang-14 build clang release
  tests clang -R '^(golden|vector|pass|physics)'
}

memory_checked() {
  local test
  for test in scene objects scene_json bad_scenes layout shapes sim newton respa planes frames \
    events coarse recorder csv checkpoint_bytes hdf5_resume; do
    MSIM_ISA=baseline MSIM_PLUGIN_PATH=$top/build/release/lib/msim valgrind --quiet \
      --suppressions=tools/valgrind.supp --leak-check=full --errors-for-leak-kinds=definite \
      --error-exitcode=1 "build/release/bin/test_$test" || return
  done
}

c_files() { find src backends tools/common tools/msim_cli -name '*.c'; }

tidied() { c_files | xargs -P2 -n4 clang-tidy-14 --quiet -p build/release; }

cppchecked() {
  c_files | xargs cppcheck --quiet --std=c11 --enable=warning,performance --inline-suppr \
    --suppress=missingIncludeSystem --suppress=internalAstError --error-exitcode=1 \
    -I include -I src -I tools -DMSIM_X86_KERNELS -DMSIM_LINKED_RECORDERS= -D__GNUC__
}

# The build that is not optimised also tells the lines that no test reaches, and the ABI. Its tests
# take three times as long, and where they fill disks its own counts are not written either; two of
# them see what gcov adds. Of the kernels two copies count, those for any CPU and for AVX2: few
# machines can run that for AVX-512.
coverage() {
  build coverage debug "-DCMAKE_C_FLAGS=--coverage -fprofile-update=atomic" -DMSIM_TEST_TIMEOUT=1200
  GCOV_ERROR_FILE=/dev/null tests coverage -LE full \
    -E '^(bench|golden|symbols|loader|memory_cli|oracle_sundials)'
  check gcovr "line coverage of src, at least 95 %" gcovr --root . --filter src/ \
    --exclude-directories '.*kernels_avx512' --print-summary --fail-under-line 95 build/coverage
  grep '^lines' build/check.log || true
  check abidiff "ABI against tools/msim-0.1.abi" tools/abi build/coverage/lib/libmsim.so
}

full() {
  long_tests
  sanitized_long
  thread_sanitizer
  if command -v clang-14 >/dev/null; then clang_bits; else skipped+=("the same bits by clang"); fi
  coverage
  check valgrind "valgrind" memory_checked
  check clang-tidy-14 "clang-tidy" tidied
  check cppcheck "cppcheck" cppchecked
}
