# Runs a portfile without vcpkg: cmake -DCURRENT_PORT_DIR= -DWORK= -DVCPKG_LIBRARY_LINKAGE= -DFEATURES=
# -P THIS. The functions do what vcpkg's own do for this port, by their documentation; the package
# is WORK/package. Any other function that a port calls is an error.
cmake_minimum_required(VERSION 3.21)
set(PORT msim)
set(CURRENT_PACKAGES_DIR ${WORK}/package)

function(run_cmake)
  execute_process(COMMAND ${CMAKE_COMMAND} ${ARGN} COMMAND_ERROR_IS_FATAL ANY
                  OUTPUT_VARIABLE printed ERROR_VARIABLE printed)
  if(printed MATCHES "variables were not used by the project:[^-]*MSIM_")
    message(FATAL_ERROR "${printed}")
  endif()
endfunction()

function(vcpkg_check_features)
  cmake_parse_arguments(PARSE_ARGV 0 arg "" OUT_FEATURE_OPTIONS FEATURES)
  list(POP_FRONT arg_FEATURES feature variable)
  set(value OFF)
  if(feature IN_LIST FEATURES)
    set(value ON)
  endif()
  set(${arg_OUT_FEATURE_OPTIONS} -D${variable}=${value} PARENT_SCOPE)
endfunction()

function(vcpkg_cmake_configure)
  cmake_parse_arguments(PARSE_ARGV 0 arg "" SOURCE_PATH "OPTIONS;OPTIONS_RELEASE;OPTIONS_DEBUG")
  string(COMPARE EQUAL ${VCPKG_LIBRARY_LINKAGE} dynamic shared)
  foreach(type IN ITEMS Release Debug)
    string(TOUPPER OPTIONS_${type} options)
    set(prefix_Release ${CURRENT_PACKAGES_DIR})
    set(prefix_Debug ${CURRENT_PACKAGES_DIR}/debug)
    run_cmake(-S ${arg_SOURCE_PATH} -B ${WORK}/${type} -G Ninja -DCMAKE_BUILD_TYPE=${type}
              -DBUILD_SHARED_LIBS=${shared} -DCMAKE_INSTALL_PREFIX=${prefix_${type}}
              -DCMAKE_INSTALL_LIBDIR:STRING=lib -DCMAKE_INSTALL_BINDIR:STRING=bin
              -DCMAKE_ERROR_ON_ABSOLUTE_INSTALL_DESTINATION=ON ${arg_OPTIONS} ${arg_${options}})
  endforeach()
endfunction()

function(vcpkg_cmake_install)
  foreach(type IN ITEMS Debug Release)
    run_cmake(--build ${WORK}/${type} --target install)
  endforeach()
endfunction()

# Moves lib/cmake/msim to share/msim, with the debug configuration of the targets.
function(vcpkg_cmake_config_fixup)
  cmake_parse_arguments(PARSE_ARGV 0 arg "" CONFIG_PATH "")
  set(share ${CURRENT_PACKAGES_DIR}/share/${PORT})
  file(GLOB configs ${CURRENT_PACKAGES_DIR}/${arg_CONFIG_PATH}/*.cmake)
  if(NOT configs)
    message(FATAL_ERROR "no CMake package in ${arg_CONFIG_PATH}")
  endif()
  file(COPY ${configs} ${CURRENT_PACKAGES_DIR}/debug/${arg_CONFIG_PATH}/msim-targets-debug.cmake
       DESTINATION ${share})
  file(REMOVE_RECURSE ${CURRENT_PACKAGES_DIR}/lib/cmake ${CURRENT_PACKAGES_DIR}/debug/lib/cmake)
  set(parent "get_filename_component(_IMPORT_PREFIX \"\${_IMPORT_PREFIX}\" PATH)\n")
  file(READ ${share}/msim-targets.cmake text)
  string(REPLACE "${parent}${parent}${parent}" "${parent}${parent}" text "${text}")
  file(WRITE ${share}/msim-targets.cmake "${text}")
  file(READ ${share}/msim-targets-debug.cmake text)
  string(REPLACE "\${_IMPORT_PREFIX}/lib" "\${_IMPORT_PREFIX}/debug/lib" text "${text}")
  file(WRITE ${share}/msim-targets-debug.cmake "${text}")
endfunction()

function(vcpkg_fixup_pkgconfig)
  foreach(folder IN ITEMS lib debug/lib)
    execute_process(COMMAND pkg-config --validate ${CURRENT_PACKAGES_DIR}/${folder}/pkgconfig/msim.pc
                    COMMAND_ERROR_IS_FATAL ANY)
  endforeach()
endfunction()

function(vcpkg_copy_tools)
  cmake_parse_arguments(PARSE_ARGV 0 arg AUTO_CLEAN "" TOOL_NAMES)
  foreach(tool IN LISTS arg_TOOL_NAMES)
    file(INSTALL ${CURRENT_PACKAGES_DIR}/bin/${tool} DESTINATION ${CURRENT_PACKAGES_DIR}/tools/${PORT}
         USE_SOURCE_PERMISSIONS)
    file(REMOVE ${CURRENT_PACKAGES_DIR}/bin/${tool})
  endforeach()
  file(GLOB left ${CURRENT_PACKAGES_DIR}/bin/*)
  if(NOT left)
    file(REMOVE_RECURSE ${CURRENT_PACKAGES_DIR}/bin)
  endif()
endfunction()

function(vcpkg_install_copyright)
  cmake_parse_arguments(PARSE_ARGV 0 arg "" "" FILE_LIST)
  file(INSTALL ${arg_FILE_LIST} DESTINATION ${CURRENT_PACKAGES_DIR}/share/${PORT} RENAME copyright)
endfunction()

include(${CURRENT_PORT_DIR}/portfile.cmake)
