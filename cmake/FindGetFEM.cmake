# Debian's GetFEM has no config file: gives getfem::getfem, with the sequential MUMPS that it calls and BLAS.
find_path(GetFEM_INCLUDE_DIR getfem/getfem_mesh.h)
find_library(GetFEM_LIBRARY getfem)
# GetFEM's own library asks for these two, but its inline code calls them from our objects too.
find_library(GetFEM_DMUMPS_LIBRARY dmumps_seq)
find_library(GetFEM_ZMUMPS_LIBRARY zmumps_seq)
find_path(GetFEM_MUMPS_INCLUDE_DIR dmumps_c.h)
find_package(BLAS QUIET)
find_package(LAPACK QUIET)

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(GetFEM REQUIRED_VARS GetFEM_LIBRARY GetFEM_INCLUDE_DIR GetFEM_DMUMPS_LIBRARY
  GetFEM_ZMUMPS_LIBRARY GetFEM_MUMPS_INCLUDE_DIR BLAS_LIBRARIES LAPACK_LIBRARIES)

if(GetFEM_FOUND AND NOT TARGET getfem::getfem)
  add_library(getfem::getfem UNKNOWN IMPORTED)
  set_target_properties(getfem::getfem PROPERTIES
    IMPORTED_LOCATION ${GetFEM_LIBRARY}
    INTERFACE_INCLUDE_DIRECTORIES "${GetFEM_INCLUDE_DIR};${GetFEM_MUMPS_INCLUDE_DIR}"
    INTERFACE_LINK_LIBRARIES "${GetFEM_DMUMPS_LIBRARY};${GetFEM_ZMUMPS_LIBRARY};${LAPACK_LIBRARIES};${BLAS_LIBRARIES}")
endif()
