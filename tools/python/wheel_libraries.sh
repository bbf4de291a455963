#!/bin/sh
# Builds the static libraries behind msim's wheels, from the sources of Debian 12, by their hashes.
# usage: wheel_libraries.sh PREFIX [cholmod]     needs cc, cmake, make, curl, xz, and some minutes
#
# For the wheel msim: jansson, KLU of SuiteSparse, SUNDIALS, HDF5. With cholmod, for the wheel
# msim-cholmod: CHOLMOD, whose supernodal part is under the GPL; without METIS, which the archive of
# Debian lacks, so that solids are factorized more slowly than with a CHOLMOD of the system.
set -eu
mkdir -p "$1"
prefix=$(cd "$1" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
pool=http://deb.debian.org/debian/pool/main

# unpack NAME SHA256 PATH: into $work/NAME
unpack() {
  curl -fsSL --retry 3 -o "$work/$1.tar" "$pool/$3"
  echo "$2  $work/$1.tar" | sha256sum --check --quiet
  mkdir "$work/$1"
  tar -xf "$work/$1.tar" -C "$work/$1" --strip-components 1
}

# build NAME CACHE_ENTRIES...: by CMake, which HDF5 expects to run in the build folder
build() {
  mkdir "$work/$1/msim"
  cd "$work/$1/msim"
  shift
  cmake .. -DCMAKE_BUILD_TYPE=Release \
    -DCMAKE_INSTALL_PREFIX="$prefix" -DCMAKE_INSTALL_LIBDIR=lib -DCMAKE_PREFIX_PATH="$prefix" \
    -DCMAKE_POSITION_INDEPENDENT_CODE=ON -DCMAKE_C_VISIBILITY_PRESET=hidden \
    -DBUILD_SHARED_LIBS=OFF -DBUILD_TESTING=OFF "$@"
  cmake --build . -j2 --target install
}

# suitesparse PARTS...: their libraries and headers
suitesparse() {
  unpack suitesparse bb106c43049138c19675cd70322e72ff8e4fd8bdcab3a096307fd78488913faf \
    s/suitesparse/suitesparse_5.12.0+dfsg.orig.tar.xz
  mkdir -p "$prefix/lib" "$prefix/include/suitesparse"
  for part in SuiteSparse_config "$@"; do
    folder=$work/suitesparse/$part
    libraries=$folder
    if [ -d "$folder/Lib" ]; then libraries=$folder/Lib; fi
    make -C "$libraries" -j2 static AUTOCC=no CC=cc CFOPENMP= CFLAGS="-O2 -fPIC" \
      CHOLMOD_CONFIG=-DNPARTITION
    cp "$libraries"/*.a "$prefix/lib"
    find "$folder" -name '*.h' -path "*$part/Include/*" \
      -exec cp {} "$prefix/include/suitesparse" \;
  done
  cp "$work/suitesparse/SuiteSparse_config/SuiteSparse_config.h" "$prefix/include/suitesparse"
}

if [ "${2-}" = cholmod ]; then
  suitesparse AMD CAMD COLAMD CCOLAMD CHOLMOD
  cp "$work/suitesparse/CHOLMOD/Doc/License.txt" "$prefix/include/suitesparse/CHOLMOD-License.txt"
  cp "$work/suitesparse/CHOLMOD/Supernodal/gpl.txt" "$prefix/include/suitesparse"
  exit
fi

unpack jansson c739578bf6b764aa0752db9a2fdadcfe921c78f1228c7ec0bb47fa804c55d17b \
  j/jansson/jansson_2.14.orig.tar.gz
build jansson -DJANSSON_BUILD_DOCS=OFF -DJANSSON_EXAMPLES=OFF -DJANSSON_WITHOUT_TESTS=ON

suitesparse AMD BTF COLAMD KLU

unpack sundials c61157f1d4be06c704bea40cb131eb63ba2dada161989071604d0a0959cdf04a \
  s/sundials/sundials_6.4.1+dfsg1.orig.tar.xz
build sundials -DENABLE_KLU=ON -DKLU_INCLUDE_DIR="$prefix/include/suitesparse" \
  -DKLU_LIBRARY_DIR="$prefix/lib" -DBUILD_STATIC_LIBS=ON -DEXAMPLES_ENABLE_C=OFF \
  -DEXAMPLES_INSTALL=OFF -DBUILD_ARKODE=OFF -DBUILD_CVODE=OFF -DBUILD_CVODES=OFF \
  -DBUILD_IDA=OFF -DBUILD_IDAS=OFF -DBUILD_KINSOL=OFF

unpack hdf5 7b38e58ff83b13fd8959a90b13bf896bc318ba096c940ab0847abf3ad41a0b31 \
  h/hdf5/hdf5_1.10.8+repack1.orig.tar.gz
build hdf5 -DHDF5_BUILD_TOOLS=OFF -DHDF5_BUILD_EXAMPLES=OFF -DHDF5_BUILD_HL_LIB=OFF \
  -DHDF5_BUILD_CPP_LIB=OFF -DHDF5_ENABLE_Z_LIB_SUPPORT=OFF -DHDF5_ENABLE_SZIP_SUPPORT=OFF
