# Debian's TetGen has no config file: gives TetGen::tetgen.
find_path(TetGen_INCLUDE_DIR tetgen.h)
find_library(TetGen_LIBRARY tet)

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(TetGen REQUIRED_VARS TetGen_LIBRARY TetGen_INCLUDE_DIR)

if(TetGen_FOUND AND NOT TARGET TetGen::tetgen)
  add_library(TetGen::tetgen UNKNOWN IMPORTED)
  # Its header leaves TETLIBRARY to who includes it.
  set_target_properties(TetGen::tetgen PROPERTIES
    IMPORTED_LOCATION ${TetGen_LIBRARY}
    INTERFACE_INCLUDE_DIRECTORIES ${TetGen_INCLUDE_DIR}
    INTERFACE_COMPILE_DEFINITIONS TETLIBRARY)
endif()
