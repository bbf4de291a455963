# What is installed: the library, its plugins (backends/CMakeLists.txt), the headers, the programs, the
# scenes, and two ways to find them. All paths are relative to one another: a moved install works.
# Components are the packages of packages.cmake; what names none belongs to dev.
set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME dev)
include(CMakePackageConfigHelpers)

get_property(msim_linked GLOBAL PROPERTY msim_linked)
set(package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/msim)
install(TARGETS msim EXPORT msim-targets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT lib NAMELINK_COMPONENT dev
  INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(DIRECTORY include/msim DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT lib)
if(TARGET msim_cli)
  file(RELATIVE_PATH library_folder ${CMAKE_INSTALL_FULL_BINDIR} ${CMAKE_INSTALL_FULL_LIBDIR})
  set_target_properties(msim_cli msim_bench PROPERTIES INSTALL_RPATH $ORIGIN/${library_folder})
  install(TARGETS msim_cli msim_bench RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT tools)
  install(DIRECTORY tools/scenes DESTINATION ${CMAKE_INSTALL_DATADIR}/msim COMPONENT tools)
endif()

# ---- find_package(msim) -------------------------------------------------------------------------
install(EXPORT msim-targets NAMESPACE msim:: DESTINATION ${package_folder})
configure_package_config_file(tools/cmake/msim-config.cmake.in msim-config.cmake
  INSTALL_DESTINATION ${package_folder} NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file(msim-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/msim-config.cmake
              ${PROJECT_BINARY_DIR}/msim-config-version.cmake
              ${PROJECT_SOURCE_DIR}/tools/cmake/msim-libraries.cmake
        DESTINATION ${package_folder})

# ---- pkg-config msim ----------------------------------------------------------------------------
set(pc_folder ${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig)
file(RELATIVE_PATH pc_to_prefix ${pc_folder} ${CMAKE_INSTALL_PREFIX})
string(REGEX REPLACE "/$" "" pc_to_prefix ${pc_to_prefix})
file(RELATIVE_PATH pc_libdir ${CMAKE_INSTALL_PREFIX} ${CMAKE_INSTALL_FULL_LIBDIR})
file(RELATIVE_PATH pc_includedir ${CMAKE_INSTALL_PREFIX} ${CMAKE_INSTALL_FULL_INCLUDEDIR})
set(pc_libraries "")
set(pc_requires "") # pkg-config refuses even --cflags where a private requirement is not installed
if(NOT BUILD_SHARED_LIBS)
  set(pc_requires "Requires.private: jansson")
  # no .pc file on Debian 12: CHOLMOD, KLU, SUNDIALS; one that means what it says: HDF5
  set(pc_targets "")
  foreach(name IN LISTS msim_linked)
    get_target_property(type msim::${name} TYPE)
    if(type STREQUAL "INTERFACE_LIBRARY")
      get_target_property(members msim::${name} INTERFACE_LINK_LIBRARIES)
      list(APPEND pc_targets ${members})
    else()
      list(APPEND pc_targets msim::${name})
    endif()
  endforeach()
  # -static: a library follows all that need it, so the last of several mentions counts
  list(REVERSE pc_targets)
  list(REMOVE_DUPLICATES pc_targets)
  list(REVERSE pc_targets)
  set(pc_files "")
  set(pc_behind "")
  foreach(target IN LISTS pc_targets)
    get_target_property(file ${target} IMPORTED_LOCATION)
    list(APPEND pc_files ${file})
    get_target_property(behind ${target} MSIM_BEHIND)
    if(behind)
      list(APPEND pc_behind ${behind})
    endif()
  endforeach()
  foreach(file IN LISTS pc_files pc_behind)
    get_filename_component(library ${file} NAME_WE)
    string(REGEX REPLACE "^lib" "-l" library ${library})
    string(APPEND pc_libraries "${library} ")
  endforeach()
endif()
configure_file(tools/cmake/msim.pc.in msim.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/msim.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)

# ---- cmake --build BUILD --target uninstall --------------------------------------------------------
add_custom_target(uninstall COMMENT "removing what was installed"
  COMMAND ${CMAKE_COMMAND} -D MANIFEST=${PROJECT_BINARY_DIR}/install_manifest.txt
          -P ${PROJECT_SOURCE_DIR}/tools/cmake/uninstall.cmake)

include(tools/cmake/packages.cmake)
