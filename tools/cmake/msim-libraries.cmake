# The libraries behind msim, as imported targets. None of them has a CMake package on Debian 12.
# msim's own build uses this file, and msim-config.cmake where msim is static.

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

# msim_find(NAMES...)   NAME: jansson, cholmod or hdf5
function(msim_find)
  foreach(name IN LISTS ARGN)
    if(name STREQUAL "cholmod")
      msim_library(cholmod cholmod.h suitesparse cholmod)
    elseif(name STREQUAL "hdf5")
      # The serial flavour. Debian keeps it beside one for MPI, which `pkg-config hdf5` may mean.
      msim_library(hdf5 hdf5.h hdf5/serial hdf5_serial hdf5)
    else()
      msim_library(${name} ${name}.h "" ${name})
    endif()
  endforeach()
endfunction()
