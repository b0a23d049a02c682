# install and export: find_package(palpate) gives palpate::volume and the other libraries.
include(CMakePackageConfigHelpers)

install(EXPORT palpateTargets NAMESPACE palpate:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/palpate)
configure_package_config_file(cmake/palpateConfig.cmake.in palpateConfig.cmake
  INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/palpate)
write_basic_package_version_file(palpateConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/palpateConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/palpateConfigVersion.cmake
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/palpate)
