# Installs the libraries and their headers so that find_package(cadmorph) finds cadmorph::core and
# the others.
include(CMakePackageConfigHelpers)

set(config_dir ${CMAKE_INSTALL_LIBDIR}/cmake/cadmorph)

install(
  TARGETS
    cadmorph_core cadmorph_cad cadmorph_surface cadmorph_volume cadmorph_outputs cadmorph_pipeline
  EXPORT cadmorphTargets)
foreach(folder core cad surface volume)
  install(DIRECTORY ${folder} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/cadmorph
    FILES_MATCHING PATTERN "*.h")
endforeach()
install(DIRECTORY apps/pipeline DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/cadmorph/apps
  FILES_MATCHING PATTERN "*.h")
install(EXPORT cadmorphTargets NAMESPACE cadmorph:: DESTINATION ${config_dir})

configure_package_config_file(cmake/cadmorphConfig.cmake.in
  ${PROJECT_BINARY_DIR}/cadmorphConfig.cmake INSTALL_DESTINATION ${config_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/cadmorphConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(
  FILES ${PROJECT_BINARY_DIR}/cadmorphConfig.cmake
    ${PROJECT_BINARY_DIR}/cadmorphConfigVersion.cmake
  DESTINATION ${config_dir})

# The pages, and the model that they show the commands on.
install(FILES README.md CHANGELOG.md LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR}
  COMPONENT cadmorph)
install(DIRECTORY docs/ DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT cadmorph)
install(
  FILES models/bore/base.step models/bore/step20.step models/bore/hex.vtu models/bore/README.md
  DESTINATION ${CMAKE_INSTALL_DATADIR}/cadmorph/models/bore COMPONENT cadmorph)
