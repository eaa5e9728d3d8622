# `cpack --config build/CPackConfig.cmake` makes two Debian packages: cadmorph, the programs with
# manual pages, completion, docs and a model; libcadmorph-dev, the libraries.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "moves a simulation mesh onto a changed CAD model")
set(CPACK_PACKAGE_CONTACT "the authors of cadmorph <cadmorph@localhost>")
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR})
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL cadmorph development)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_CADMORPH_PACKAGE_NAME cadmorph)
set(CPACK_DEBIAN_CADMORPH_PACKAGE_RECOMMENDS "xvfb, libgl1-mesa-dri")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libcadmorph-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
  "libeigen3-dev, libhdf5-dev, libnanoflann-dev, libopenblas-dev, libpugixml-dev, libtbb-dev, \
libvtk9-dev, zlib1g-dev, \
libocct-data-exchange-dev, libocct-modeling-algorithms-dev, libocct-modeling-data-dev")
include(CPack)
