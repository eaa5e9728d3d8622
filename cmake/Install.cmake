# Installs the public library, so that find_package(cadmorph) and pkg-config find it.
include(CMakePackageConfigHelpers)

set(config_dir ${CMAKE_INSTALL_LIBDIR}/cmake/cadmorph)
set(header_dir ${CMAKE_INSTALL_INCLUDEDIR}/cadmorph)

install(TARGETS cadmorph_shared EXPORT cadmorphTargets
  LIBRARY COMPONENT library NAMELINK_COMPONENT development)
install(DIRECTORY apps/library/include/cadmorph/ DESTINATION ${header_dir})
install(FILES core/errors.h core/types.h DESTINATION ${header_dir}/core)
install(EXPORT cadmorphTargets NAMESPACE cadmorph:: DESTINATION ${config_dir})

configure_package_config_file(cmake/cadmorphConfig.cmake.in
  ${PROJECT_BINARY_DIR}/cadmorphConfig.cmake INSTALL_DESTINATION ${config_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/cadmorphConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(
  FILES ${PROJECT_BINARY_DIR}/cadmorphConfig.cmake
    ${PROJECT_BINARY_DIR}/cadmorphConfigVersion.cmake
  DESTINATION ${config_dir})
configure_file(cmake/cadmorph.pc.in ${PROJECT_BINARY_DIR}/cadmorph.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/cadmorph.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)

# The pages, and the model that they show the commands on.
install(FILES README.md CHANGELOG.md LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR}
  COMPONENT cadmorph)
install(DIRECTORY docs/ DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT cadmorph)
install(
  FILES models/bore/base.step models/bore/step20.step models/bore/hex.vtu models/bore/README.md
  DESTINATION ${CMAKE_INSTALL_DATADIR}/cadmorph/models/bore COMPONENT cadmorph)
