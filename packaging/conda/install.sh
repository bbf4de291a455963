#!/usr/bin/env bash
# Installs what belongs to the output PKG_NAME, by the components of msim's installation.
set -eu
case $PKG_NAME in
  libmsim) components=(lib dev) ;;
  msim) components=(tools) ;;
  libmsim-*) components=("${PKG_NAME#libmsim-}") ;;
esac
for component in "${components[@]}"; do
  cmake --install "$SRC_DIR/build" --prefix "$PREFIX" --component "$component" --strip
done
