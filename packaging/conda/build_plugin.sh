#!/usr/bin/env bash
# Builds and installs the plugin of the output PKG_NAME alone, with the libraries of that output.
set -eu
plugin=${PKG_NAME#libmsim-}
# shellcheck disable=SC2086 # CMAKE_ARGS is a list of words
cmake -S "$SRC_DIR" -B "$SRC_DIR/build-$plugin" -G Ninja ${CMAKE_ARGS} -DCMAKE_INSTALL_LIBDIR=lib \
  -DBUILD_SHARED_LIBS=ON -DMSIM_TESTS=OFF "-DMSIM_BACKENDS=$plugin"
cmake --build "$SRC_DIR/build-$plugin" -j "$CPU_COUNT" --target backends/all
cmake --install "$SRC_DIR/build-$plugin" --prefix "$PREFIX" --component "$plugin" --strip
