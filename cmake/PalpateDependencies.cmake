# All from Debian's packages; docs/dependencies.md says what each one replaces.
find_package(Threads REQUIRED)
# TBB first: OpenVDB's find module defines TBB::tbb and the config would then fail.
find_package(TBB CONFIG REQUIRED)

file(GLOB openvdb_module_dir /usr/lib/*/cmake/OpenVDB)
list(APPEND CMAKE_MODULE_PATH ${openvdb_module_dir})
find_package(OpenVDB 10 REQUIRED COMPONENTS openvdb)
list(REMOVE_ITEM CMAKE_MODULE_PATH ${openvdb_module_dir})

find_package(glm CONFIG REQUIRED)
find_package(fmt CONFIG REQUIRED)
find_package(CLI11 CONFIG REQUIRED)
find_package(nlohmann_json CONFIG REQUIRED)
find_package(tomlplusplus CONFIG REQUIRED)
if(PALPATE_SWEEP)
  find_package(muparser CONFIG REQUIRED)
endif()
find_package(SQLite3 REQUIRED)
find_package(OpenSSL 3 REQUIRED COMPONENTS Crypto)
find_package(ZLIB REQUIRED)
find_package(Boost 1.74 REQUIRED)
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(PkgConfig REQUIRED)
pkg_check_modules(libusb REQUIRED IMPORTED_TARGET GLOBAL libusb-1.0)

find_package(BZip2 REQUIRED)
# DICOM (its own config file asks for far more than is linked here) and the JPEG 2000 in it.
if(PALPATE_DICOM)
  find_path(DCMTK_INCLUDE dcmtk/dcmdata/dctk.h REQUIRED)
  find_path(OPENJPEG_INCLUDE openjpeg.h PATH_SUFFIXES openjpeg-2.5 REQUIRED)
  # A project may ask for Palpate more than once, also from its parts.
  if(NOT TARGET palpate_dicom)
    add_library(palpate_dicom INTERFACE IMPORTED)
    target_include_directories(palpate_dicom SYSTEM INTERFACE ${DCMTK_INCLUDE} ${OPENJPEG_INCLUDE})
    set(palpate_dicom_parts dcmjpls dcmtkcharls dcmjpeg ijg8 ijg12 ijg16 dcmimage dcmimgle dcmdata oflog ofstd openjp2)
    foreach(part IN LISTS palpate_dicom_parts)
      find_library(PALPATE_${part}_LIBRARY ${part} REQUIRED)
      target_link_libraries(palpate_dicom INTERFACE ${PALPATE_${part}_LIBRARY})
    endforeach()
  endif()
endif()

# Debian's own Python, whatever other one is first in PATH: its packages numpy and pybind11 are for that. Python is built
# without sanitizers.
if(PALPATE_PYTHON AND NOT (PALPATE_PYTHON STREQUAL AUTO AND PALPATE_SANITIZE))
  set(Python_EXECUTABLE /usr/bin/python3 CACHE FILEPATH "Python that `import palpate` is built for")
  set(PYBIND11_FINDPYTHON ON)
  if(PALPATE_PYTHON STREQUAL AUTO)
    find_package(Python 3.11 COMPONENTS Interpreter Development.Module QUIET)
    find_package(pybind11 2.10 CONFIG QUIET)
    set(PALPATE_PYTHON ${pybind11_FOUND})
    if(NOT PALPATE_PYTHON)
      message(STATUS "no pybind11: built without `import palpate`")
    endif()
  else()
    find_package(Python 3.11 COMPONENTS Interpreter Development.Module REQUIRED)
    find_package(pybind11 2.10 CONFIG REQUIRED)
  endif()
else()
  set(PALPATE_PYTHON OFF)
endif()

if(PALPATE_REFERENCE)
  find_package(CGAL 5.5 CONFIG REQUIRED)
  find_package(GetFEM REQUIRED)
  find_package(TetGen REQUIRED)
  find_package(VTK 9.1 REQUIRED COMPONENTS CommonCore CommonDataModel IOXML IOLegacy)
endif()

# After the reference's: render/ links VTK_LIBRARIES, which are those found last.
if(PALPATE_VIEWER)
  find_package(glfw3 3.3 CONFIG REQUIRED)
  find_package(GLEW REQUIRED)
  find_package(OpenGL REQUIRED)
  pkg_check_modules(imgui REQUIRED IMPORTED_TARGET GLOBAL imgui)
  pkg_check_modules(alsa REQUIRED IMPORTED_TARGET GLOBAL alsa)
  pkg_check_modules(spnav REQUIRED IMPORTED_TARGET GLOBAL spnav)
  find_package(VTK 9.1 REQUIRED COMPONENTS
    CommonCore CommonDataModel CommonExecutionModel CommonTransforms FiltersCore FiltersGeneral FiltersSources ImagingCore
    InteractionStyle IOImage RenderingAnnotation RenderingCore RenderingFreeType RenderingOpenGL2
    RenderingVolume RenderingVolumeOpenGL2)
endif()

if(BUILD_TESTING)
  find_package(GTest CONFIG REQUIRED)
  # A second reader of medical images, to compare with.
  find_package(ITK 5.2 REQUIRED COMPONENTS
    ITKCommon ITKIOImageBase ITKIONIFTI ITKIONRRD ITKIOMeta ITKIOGDCM)
endif()
