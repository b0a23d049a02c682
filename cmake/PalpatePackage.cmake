# install and export: find_package(palpate) gives palpate::volume and the other libraries.
include(CMakePackageConfigHelpers)

set(palpate_package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/palpate)
install(EXPORT palpateTargets NAMESPACE palpate:: DESTINATION ${palpate_package_dir})
get_property(palpate_components GLOBAL PROPERTY PALPATE_INSTALLED)
configure_package_config_file(cmake/palpateConfig.cmake.in palpateConfig.cmake INSTALL_DESTINATION ${palpate_package_dir})
write_basic_package_version_file(palpateConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES
  ${CMAKE_CURRENT_BINARY_DIR}/palpateConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/palpateConfigVersion.cmake
  cmake/PalpateDependencies.cmake
  DESTINATION ${palpate_package_dir})

# The same for pkg-config.
set(palpate_pc_libs ${palpate_components})
list(REMOVE_ITEM palpate_pc_libs render)
list(TRANSFORM palpate_pc_libs PREPEND -lpalpate_)
set(palpate_pc_private openvdb boost_iostreams bz2 ${palpate_dicom_parts})
list(TRANSFORM palpate_pc_private PREPEND -l)
set(palpate_pc_requires glm fmt tomlplusplus sqlite3 libcrypto zlib libusb-1.0 Imath tbb)
if(PALPATE_SWEEP)
  list(APPEND palpate_pc_requires muparser)
endif()
list(JOIN palpate_pc_libs " " palpate_pc_libs)
list(JOIN palpate_pc_private " " palpate_pc_private)
list(JOIN palpate_pc_requires " " palpate_pc_requires)
file(RELATIVE_PATH palpate_pc_prefix /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
string(REGEX REPLACE "/$" "" palpate_pc_prefix "${palpate_pc_prefix}")
configure_file(packaging/palpate.pc.in palpate.pc @ONLY)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/palpate.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)

# All that `cmake --install` takes, without the tests.
set(palpate_installed ${palpate_components})
list(TRANSFORM palpate_installed PREPEND palpate_)
add_custom_target(palpate_installed)
foreach(target IN LISTS palpate_installed ITEMS palpate palpate-view palpate-trainer palpate-reference palpate-mesh
    palpate-rival-bullet palpate-rival-calculix palpate_python)
  if(TARGET ${target})
    add_dependencies(palpate_installed ${target})
  endif()
endforeach()

# Man pages and bash completion, which the programs tell of themselves.
if(NOT PALPATE_SANITIZE)
  find_package(Python3 COMPONENTS Interpreter)
endif()
if(Python3_FOUND)
  foreach(program palpate palpate-view palpate-trainer palpate-reference palpate-mesh)
    if(TARGET ${program})
      list(APPEND palpate_programs $<TARGET_FILE:${program}>)
    endif()
  endforeach()
  set(palpate_shell ${CMAKE_CURRENT_BINARY_DIR}/share/shell)
  add_custom_command(OUTPUT ${palpate_shell}/made
    COMMAND Python3::Interpreter -B ${PROJECT_SOURCE_DIR}/packaging/shell_files.py ${palpate_shell} ${palpate_programs}
    COMMAND ${CMAKE_COMMAND} -E touch ${palpate_shell}/made
    DEPENDS packaging/shell_files.py ${palpate_programs})
  add_custom_target(palpate_shell_files ALL DEPENDS ${palpate_shell}/made)
  add_dependencies(palpate_installed palpate_shell_files)
  install(DIRECTORY ${palpate_shell}/man ${palpate_shell}/bash-completion DESTINATION ${CMAKE_INSTALL_DATADIR})
endif()

install(FILES haptics/falcon/70-palpate-falcon.rules DESTINATION lib/udev/rules.d)
install(FILES README.md LICENSE NOTICE CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DOCDIR})
if(PALPATE_VIEWER)
  # The trainer in the desktop's menu.
  install(FILES packaging/palpate.desktop DESTINATION ${CMAKE_INSTALL_DATADIR}/applications)
  install(FILES packaging/org.palpate.Palpate.metainfo.xml DESTINATION ${CMAKE_INSTALL_DATADIR}/metainfo)
  install(FILES packaging/palpate.svg DESTINATION ${CMAKE_INSTALL_DATADIR}/icons/hicolor/scalable/apps)
endif()
install(DIRECTORY docs DESTINATION ${CMAKE_INSTALL_DOCDIR})
