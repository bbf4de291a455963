# shellcheck shell=bash
# Sourced by check: what finds little, in slices. Each run of tools/check takes one turn, of ten
# minutes at most, and --full takes all, and what takes longer or depends on chance. tools/packages has
# what each slice needs, under its name.
turns=(clang_bits "documentation player" kills debian quick_benches "recipes fully_static"
  "failing_allocations paraview" sanitized_methods sanitized_runs sanitized_contact sanitized_solvers
  thread_sanitizer coverage memory_errors memory_errors_of_newton "static_analysis instructions"
  fuzzing python)
read -ra slices <<<"${turns[*]} wheels mutations"

# The number of commits chooses, so that neighbouring commits take different turns; in a shallow
# clone, which does not know it, the hash.
turn_of_commit() {
  local number
  number=$(git rev-list --count HEAD 2>/dev/null || echo 0)
  if [[ $(git rev-parse --is-shallow-repository 2>/dev/null) == true ]]; then
    number=$((16#$(git rev-parse HEAD | cut -c1-8)))
  fi
  echo "${turns[number % ${#turns[@]}]}"
}

# 500 runs, and 20 of several ranks, killed at random moments and resumed
kills() { tests release -R '^(resume|rank)_kills$'; }

# Every snippet is run in the default part; this builds the site.
documentation() { check "documentation" tools/docs; }

debian_packages() { tools/deb && python3 tests/install/test_debian.py; }

# The packages, installed and removed in a bare Debian
debian() { check "Debian packages" debian_packages; }

recipe_python() {
  python3 -m venv build/recipes/python &&
    build/recipes/python/bin/pip install --quiet jinja2 pyyaml numpy nanobind scikit-build-core
}

# The recipes of conda and vcpkg, with stand-ins for these programs
recipes() {
  local test
  check "Python packages of the recipes" recipe_python
  for test in conda vcpkg; do
    check "tests/install/test_$test.py" \
      env PYTHONPATH=tests build/recipes/python/bin/python -B "tests/install/test_$test.py"
  done
}

quick_benches() { tests release -R '^bench_(quick|runs|pictures)$'; }

# The distribution's ParaView opens what it can open of the trajectories.
paraview() { tests release -R '^paraview$'; }

# Every allocation of a run fails in turn.
failing_allocations() { MSIM_LONG_TESTS=1 tests release -L long; }

# What the address sanitizer does not see in the default run
# sanitized REGEX: these tests under address and undefined-behaviour sanitizers
sanitized() {
  build asan asan -DMSIM_TEST_TIMEOUT=600 "-DMSIM_TEST_PROGRAMS=$1" \
    '-DMSIM_TEST_PROGRAMS_EXCLUDED=^$'
  tests asan -LE full -R "$1"
}
sanitized_methods() { sanitized "$long_methods"; }
sanitized_runs() { sanitized "$long_runs"; }
sanitized_contact() { sanitized "$long_contact"; }
sanitized_solvers() { sanitized "$long_solvers"; }

# Speeds, and results that other builds have seen, tell nothing about threads.
thread_sanitizer() {
  build tsan tsan -DMSIM_TEST_TIMEOUT=1200 \
    "-DMSIM_TEST_PROGRAMS=^(pool|parallel|threads|islands|auto|sim|recorder)$"
  TSAN_OPTIONS=halt_on_error=1 tests tsan \
    -R '^(pool|parallel|threads_(pcg|cholmod)|islands|auto|sim|recorder|cli_running)$'
}

# The same bits as by GCC, with the same flags
clang_bits() {
  local with_lanes='^(golden|vector|force_sweep|physics)'
  CC=clang-14 build clang release "-DMSIM_TEST_PROGRAMS=$with_lanes"
  tests clang -R "$with_lanes"
}

# Lists the lines that no test reaches. Its tests take twice as long, and where they fill disks its
# own counts are not written either; two of them see what gcov adds. The slow ones take two thirds of
# the time, and reach 1 % of the lines alone. Of the kernels two copies count, those for any CPU and
# for AVX2: few machines can run that for AVX-512.
coverage() {
  local slow='advice|auto_cost|bdf2_restart|breaking|collider_events|colliders|contact_random'
  slow+='|error_growth|frames|islands|memory|moving_events|newton|parallel|pcg|rank_checkpoints'
  slow+='|rank_files|rank_load_creation|rank_load_sims|respa|sampled_colliders|self_contact'
  slow+='|self_contact_pressed|self_contact_runs|single_pcg|step_verification|stiff_contact|subproject'
  build coverage debug "-DCMAKE_C_FLAGS=-O1 --coverage -fprofile-update=atomic" \
    -DMSIM_TEST_TIMEOUT=1200
  GCOV_ERROR_FILE=/dev/null tests coverage -LE full \
    -E "^(bench|golden|symbols|loader|memory_cli|oracle_sundials|quickstart)|^($slow)\$|$long_solvers"
  check "line coverage of src, at least 95 %" gcovr --root . --filter src/ \
    --exclude-directories '.*kernels_avx512' --print-summary --fail-under-line 95 build/coverage
  grep '^lines' build/check.log || true
}

memory_checked() {
  local test
  for test in "$@"; do
    MSIM_ISA=baseline MSIM_PLUGIN_PATH=$top/build/release/lib/msim valgrind --quiet \
      --suppressions=tools/valgrind.supp --leak-check=full --errors-for-leak-kinds=definite \
      --error-exitcode=1 "build/release/bin/test_$test" || return
  done
}

# test_newton takes as long as all others.
memory_errors() {
  check "valgrind" memory_checked scene objects scene_json bad_scenes layout spring_graphs sim respa \
    reflection events coarse recorder strain csv pvd checkpoint_refusals hdf5_resume
}

memory_errors_of_newton() { check "valgrind: newton" memory_checked newton; }

c_files() { find src backends tools/common tools/msim_cli -name '*.c'; }

tidied() { c_files | xargs -P2 -n4 clang-tidy-14 --quiet -p build/release; }

cppchecked() {
  c_files | xargs cppcheck --quiet --std=c11 --enable=warning,performance --inline-suppr \
    --suppress=missingIncludeSystem --suppress=internalAstError --error-exitcode=1 \
    -I include -I src -I tools -DMSIM_X86_KERNELS -DMSIM_LINKED_RECORDERS= -D__GNUC__ \
    -DPETSC_USE_REAL_DOUBLE
}

abi() {
  cmake --preset debug -DMSIM_TESTS=OFF && cmake --build build/debug --target msim &&
    tools/abi build/debug/lib/libmsim.so
}

# Pages of --out run.html in a headless Chromium
player() { tests release -R '^player$'; }

static_analysis() {
  check "clang-tidy" tidied
  check "cppcheck" cppchecked
  check "ABI against tools/msim-0.1.abi" abi
}

# No more instructions than before
instructions() { check "instructions" tools/instructions; }

# Small faults in the code, a hundred at random, of which tests see four in five; an hour.
mutations() {
  check "mutations" tools/mutate -n 100 --survivors 25 src backends
}

# Run a target from its corpus on for a minute, or with an input.
fuzz_target() {
  MSIM_PLUGIN_PATH=$top/build/fuzz/lib/msim "build/fuzz/bin/fuzz_$1" -timeout=20 "${@:2}"
}

# What crashes stays in build/fuzz-found.
fuzzed() {
  mkdir -p build/fuzz-found
  fuzz_target "$@" -max_total_time=60 -artifact_prefix=build/fuzz-found/ "$(mktemp -d)" \
    "tests/fuzz/corpus/$1"
}

# libhdf5 itself crashes on damaged files (tests/fuzz/README.md). So processes that end are replaced,
# and what ended them is run again: it is a finding of ours unless libhdf5 has the innermost frame.
fuzzed_with_hdf5() {
  local target=$1 memory=-malloc_limit_mb=1000000 input frame found=0
  local ours='(src|tests|backends)/[a-z0-9_/]+\.c:' ended
  ended=$(mktemp -d)
  fuzz_target "$target" $memory -max_total_time=60 -fork=1 -ignore_crashes=1 \
    -artifact_prefix="$ended/" "$(mktemp -d)" "tests/fuzz/corpus/$target" 2>&1 | tee "$ended/log"
  grep -q "INFO: exiting" "$ended/log" || return 1
  mkdir -p build/fuzz-found
  for input in "$ended"/*-*; do
    [[ -e $input ]] || continue
    frame=$(fuzz_target "$target" $memory "$input" 2>&1 | grep -m 1 -E " #[0-9]+ .*(libhdf5|$ours)")
    [[ -z $frame || $frame == *libhdf5* ]] && continue
    echo "$(basename "$input"): $frame"
    cp "$input" build/fuzz-found/
    found=1
  done
  return $found
}

fuzzing() {
  local target
  build fuzz fuzz
  for target in scene arguments; do
    check "fuzzing: $target" fuzzed "$target" "-dict=tests/fuzz/$target.dict"
  done
  for target in backend plugins checkpoint; do check "fuzzing: $target" fuzzed "$target"; done
  for target in hdf5 trajectory; do check "fuzzing: $target" fuzzed_with_hdf5 "$target"; done
}

python_tools() {
  python3 -m venv build/python &&
    build/python/bin/pip install --quiet pytest scipy h5py tqdm mypy build cibuildwheel ipython \
      pyvista matplotlib imageio-ffmpeg distributed pandas
}

# Built once; what they are made from does not change.
wheel_libraries() {
  local libraries=$top/build/wheel_libraries
  { [[ -f $libraries/lib/libhdf5.a ]] || tools/python/wheel_libraries.sh "$libraries"; } &&
    { [[ -f ${libraries}_cholmod/lib/libcholmod.a ]] ||
      tools/python/wheel_libraries.sh "${libraries}_cholmod" cholmod; }
}

# python_tests MARKS
python_tests() {
  MSIM_WHEEL_LIBRARIES=$top/build/wheel_libraries \
    build/python/bin/pytest -q -rfs -m "$1" tools/python/tests
}

# The package for Python, installed from source in an environment of its own
python() {
  check "Python packages of the tests" python_tools
  check "pip install tools/python" build/python/bin/pip install --quiet ./tools/python
  check "tools/python/tests" python_tests "not slow"
}

# Programs linked with -static, against the archives that Debian has
fully_static() {
  build fully_static static -DMSIM_WERROR=ON -DMSIM_BACKENDS=klu,sundials,hdf5 -DMSIM_TESTS=OFF
  check "tests/install/test_fully_static.py" \
    env PYTHONPATH=tests python3 -B tests/install/test_fully_static.py
}

# The source archive and the wheels, each in a fresh environment. The libraries behind the wheel are
# built from their sources, which takes half an hour once.
wheels() {
  check "Python packages of the tests" python_tools
  check "static libraries of the wheels" wheel_libraries
  check "pip install tools/python" build/python/bin/pip install --quiet ./tools/python
  check "archive and wheel" python_tests slow
}
