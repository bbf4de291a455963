# The port of msim, as an overlay: `vcpkg install msim --overlay-ports=packaging/vcpkg`. It builds this
# checkout; in a registry SOURCE_PATH is set by vcpkg_from_github or vcpkg_download_distfile.
get_filename_component(SOURCE_PATH "${CURRENT_PORT_DIR}/../../.." ABSOLUTE)

set(backends none)
foreach(plugin IN ITEMS assimp cholmod hdf5 klu mpi sundials)
  if(plugin IN_LIST FEATURES)
    string(APPEND backends ",${plugin}")
  endif()
endforeach()
vcpkg_check_features(OUT_FEATURE_OPTIONS feature_options FEATURES tools MSIM_TOOLS)

vcpkg_cmake_configure(
  SOURCE_PATH "${SOURCE_PATH}"
  OPTIONS -DMSIM_TESTS=OFF "-DMSIM_BACKENDS=${backends}"
  OPTIONS_RELEASE ${feature_options}
  OPTIONS_DEBUG -DMSIM_TOOLS=OFF)
vcpkg_cmake_install()
vcpkg_cmake_config_fixup(CONFIG_PATH lib/cmake/msim)
vcpkg_fixup_pkgconfig()

if("tools" IN_LIST FEATURES)
  # msim_bench compares msim with other programs of its checkout
  file(REMOVE "${CURRENT_PACKAGES_DIR}/bin/msim_bench")
  vcpkg_copy_tools(TOOL_NAMES msim_cli AUTO_CLEAN)
endif()
file(REMOVE_RECURSE
  "${CURRENT_PACKAGES_DIR}/debug/include"
  "${CURRENT_PACKAGES_DIR}/debug/share"
  "${CURRENT_PACKAGES_DIR}/libexec"
  "${CURRENT_PACKAGES_DIR}/share/doc")
file(INSTALL "${CURRENT_PORT_DIR}/usage" DESTINATION "${CURRENT_PACKAGES_DIR}/share/${PORT}")
vcpkg_install_copyright(FILE_LIST "${SOURCE_PATH}/LICENSE")
