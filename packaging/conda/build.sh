#!/usr/bin/env bash
# Builds the library, its plugins and the programs; install.sh takes the outputs from there.
set -eu
# shellcheck disable=SC2086 # CMAKE_ARGS is a list of words
cmake -S "$SRC_DIR" -B "$SRC_DIR/build" -G Ninja ${CMAKE_ARGS} -DCMAKE_INSTALL_LIBDIR=lib \
  -DBUILD_SHARED_LIBS=ON -DMSIM_TESTS=OFF -DMSIM_BACKENDS=assimp,cholmod,hdf5,klu,sundials
cmake --build "$SRC_DIR/build" -j "$CPU_COUNT"
