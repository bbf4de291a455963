#!/usr/bin/env bash
# Builds and installs the Python package. Its extension looks for plugins in lib/msim of the
# environment, three folders above site-packages/msim.
set -eu
"$PYTHON" -m pip install "$SRC_DIR/tools/python" -vv --no-deps --no-build-isolation \
  --config-settings=cmake.define.MSIM_BACKENDS=none \
  --config-settings=cmake.define.MSIM_PLUGIN_FOLDER=../../../msim
