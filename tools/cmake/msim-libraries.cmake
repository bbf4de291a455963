# The libraries behind msim, as imported targets. None of them has a CMake package on Debian 12.
# msim's own build uses this file, and msim-config.cmake where msim is static.
set(MSIM_SUNDIALS_SOLVERS sundials-pcg sundials-spgmr sundials-spfgmr sundials-spbcgs
                          sundials-sptfqmr)

# msim_packages(NAME RESULT): the packages of Debian and Ubuntu that bring msim::NAME
function(msim_packages name result)
  if(name STREQUAL "cholmod")
    set(packages libsuitesparse-dev)
  elseif(name STREQUAL "klu")
    set(packages libsundials-dev libsuitesparse-dev)
  elseif(name IN_LIST MSIM_SUNDIALS_SOLVERS)
    set(packages libsundials-dev)
  elseif(name STREQUAL "petsc")
    set(packages petsc-dev)
  elseif(name STREQUAL "mpi")
    set(packages libopenmpi-dev)
  else()
    set(packages lib${name}-dev)
  endif()
  list(JOIN packages " " packages)
  set(${result} "${packages}" PARENT_SCOPE)
endfunction()

# msim_library(NAME HEADER FOLDER LIBRARIES...): the target msim::NAME, where it is found.
# FOLDER: below an include folder, searched first; LIBRARIES: names, the first one found wins.
function(msim_library name header folder)
  string(TOUPPER msim_${name} prefix)
  find_library(${prefix}_LIBRARY NAMES ${ARGN})
  find_path(${prefix}_INCLUDE_DIR ${header} PATH_SUFFIXES ${folder})
  mark_as_advanced(${prefix}_LIBRARY ${prefix}_INCLUDE_DIR)
  if(${prefix}_LIBRARY AND ${prefix}_INCLUDE_DIR AND NOT TARGET msim::${name})
    add_library(msim::${name} UNKNOWN IMPORTED)
    set_target_properties(msim::${name} PROPERTIES
      IMPORTED_LOCATION ${${prefix}_LIBRARY}
      INTERFACE_INCLUDE_DIRECTORIES ${${prefix}_INCLUDE_DIR})
  endif()
endfunction()

# msim_behind(NAME LIBRARIES...): what an archive of msim::NAME needs as well, in the order of the link
# line, as far as it is found. A shared library names that itself.
function(msim_behind name)
  set(found "")
  foreach(library IN LISTS ARGN)
    string(TOUPPER msim_${library}_library variable)
    find_library(${variable} ${library})
    mark_as_advanced(${variable})
    if(${variable})
      list(APPEND found ${${variable}})
    endif()
  endforeach()
  if(TARGET msim::${name})
    set_target_properties(msim::${name} PROPERTIES MSIM_BEHIND "${found}")
    get_target_property(file msim::${name} IMPORTED_LOCATION)
    if(file MATCHES "[.]a$")
      set_target_properties(msim::${name} PROPERTIES INTERFACE_LINK_LIBRARIES "${found};m")
    endif()
  endif()
endfunction()

# msim_bundle(NAME MEMBERS...): the target msim::NAME that stands for others, where all are found
function(msim_bundle name)
  foreach(member IN LISTS ARGN)
    if(NOT TARGET msim::${member})
      return()
    endif()
  endforeach()
  if(NOT TARGET msim::${name})
    list(TRANSFORM ARGN PREPEND msim::)
    add_library(msim::${name} INTERFACE IMPORTED)
    set_target_properties(msim::${name} PROPERTIES INTERFACE_LINK_LIBRARIES "${ARGN}")
  endif()
endfunction()

# msim_sundials(MODULES...): each module is a library of its own. The header is new in SUNDIALS 6:
# an older one is not found.
function(msim_sundials)
  set(header sundials/sundials_context.h)
  msim_library(sundials ${header} "" sundials_core sundials_generic)
  foreach(module IN LISTS ARGN)
    msim_library(sundials_${module} ${header} "" sundials_${module})
  endforeach()
endfunction()

# msim_by_pkg_config(NAME HEADER MODULES LIBRARIES...): as msim_library, beginning where the first of the
# modules that pkg-config knows says
function(msim_by_pkg_config name header modules)
  string(TOUPPER msim_${name} prefix)
  find_package(PkgConfig QUIET)
  if(PKG_CONFIG_FOUND)
    pkg_search_module(${prefix}_PC QUIET ${modules})
  endif()
  find_library(${prefix}_LIBRARY NAMES ${ARGN} HINTS ${${prefix}_PC_LIBRARY_DIRS})
  find_path(${prefix}_INCLUDE_DIR ${header} HINTS ${${prefix}_PC_INCLUDE_DIRS})
  msim_library(${name} ${header} "" ${ARGN})
endfunction()

# msim_find_mpi(): MPI. msim_find_petsc(): PETSc, of real numbers, with the MPI behind it
function(msim_find_mpi)
  msim_by_pkg_config(mpi mpi.h "ompi;mpich;mpi" mpi mpich)
endfunction()

function(msim_find_petsc)
  msim_find_mpi()
  msim_by_pkg_config(libpetsc petscksp.h "PETSc>=3.17" petsc_real petsc)
  msim_bundle(petsc libpetsc mpi)
endfunction()

# msim_find(NAMES...)   NAME: jansson, assimp, cholmod, hdf5, klu, mpi, petsc, or of SUNDIALS' solvers
function(msim_find)
  foreach(name IN LISTS ARGN)
    if(name STREQUAL "cholmod")
      msim_library(cholmod cholmod.h suitesparse cholmod)
      msim_behind(cholmod ccolamd camd colamd amd suitesparseconfig)
    elseif(name STREQUAL "assimp")
      msim_library(assimp assimp/cimport.h "" assimp)
    elseif(name STREQUAL "hdf5")
      # The serial flavour. Debian keeps it beside one for MPI, which `pkg-config hdf5` may mean.
      msim_library(hdf5 hdf5.h hdf5/serial hdf5_serial hdf5)
      msim_behind(hdf5 sz aec z)
    elseif(name STREQUAL "klu")
      msim_sundials(sunlinsolklu sunmatrixsparse nvecserial)
      msim_library(libklu klu.h suitesparse klu)
      msim_behind(libklu btf amd colamd suitesparseconfig)
      msim_bundle(klu sundials_sunlinsolklu sundials_sunmatrixsparse sundials_nvecserial sundials
                  libklu)
    elseif(name IN_LIST MSIM_SUNDIALS_SOLVERS)
      string(REPLACE "sundials-" "sunlinsol" module ${name})
      msim_sundials(${module})
      msim_bundle(${name} sundials_${module} sundials)
    elseif(name STREQUAL "petsc")
      msim_find_petsc()
    elseif(name STREQUAL "mpi")
      msim_find_mpi()
    else()
      msim_library(${name} ${name}.h "" ${name})
    endif()
  endforeach()
endfunction()
