# install and export: find_package(palpate) gives palpate::volume and the other libraries.
include(CMakePackageConfigHelpers)

set(palpate_package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/palpate)
install(EXPORT palpateTargets NAMESPACE palpate:: DESTINATION ${palpate_package_dir})
configure_package_config_file(cmake/palpateConfig.cmake.in palpateConfig.cmake INSTALL_DESTINATION ${palpate_package_dir})
write_basic_package_version_file(palpateConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES
  ${CMAKE_CURRENT_BINARY_DIR}/palpateConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/palpateConfigVersion.cmake
  cmake/PalpateDependencies.cmake
  DESTINATION ${palpate_package_dir})

install(FILES README.md LICENSE NOTICE CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DOCDIR})
if(PALPATE_VIEWER)
  # The trainer in the desktop's menu.
  install(FILES packaging/palpate.desktop DESTINATION ${CMAKE_INSTALL_DATADIR}/applications)
  install(FILES packaging/palpate.svg DESTINATION ${CMAKE_INSTALL_DATADIR}/icons/hicolor/scalable/apps)
endif()
install(DIRECTORY docs DESTINATION ${CMAKE_INSTALL_DOCDIR})
