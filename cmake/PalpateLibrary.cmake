# One folder, one library, one namespace level.
#
#   palpate_library(chainmail
#     HEADERS lattice.h propagate.h
#     SOURCES lattice.cpp propagate.cpp
#     PUBLIC  palpate::volume
#     PRIVATE TBB::tbb)
#
# gives palpate::chainmail with its headers as <chainmail/lattice.h>, <palpate/chainmail/lattice.h> where it is installed, warnings, install rule, and
# (-DPALPATE_VERIFY_HEADERS=ON, target all_verify_interface_header_sets) a compile of each header on its own.
# PALPATE_BUILT: libraries to take from the build folder PALPATE_BUILT_IN instead, with this folder's sources as they were there.
# WARM: works beside ticks, and not in them.
# UNINSTALLED: for a program of ours only: commands, pages and windows, in which no tick runs.
function(palpate_library name)
  cmake_parse_arguments(arg "UNINSTALLED;WARM" "" "HEADERS;SOURCES;PUBLIC;PRIVATE;INCLUDES" ${ARGN})
  set(target palpate_${name})
  if(name IN_LIST PALPATE_BUILT)
    # As another preset has built it: no source is compiled here but an empty one.
    file(CONFIGURE OUTPUT ${CMAKE_CURRENT_BINARY_DIR}/built.cpp CONTENT "")
    set(arg_SOURCES ${CMAKE_CURRENT_BINARY_DIR}/built.cpp)
    file(RELATIVE_PATH folder ${PROJECT_BINARY_DIR} ${CMAKE_CURRENT_BINARY_DIR})
    set(arg_PUBLIC ${PALPATE_BUILT_IN}/${folder}/lib${target}.a ${arg_PUBLIC})
  endif()
  add_library(${target} STATIC ${arg_SOURCES})
  add_library(palpate::${name} ALIAS ${target})
  target_sources(${target} PUBLIC
    FILE_SET HEADERS BASE_DIRS ${PROJECT_SOURCE_DIR} FILES ${arg_HEADERS})
  target_include_directories(${target} SYSTEM PRIVATE ${arg_INCLUDES})
  target_link_libraries(${target}
    PUBLIC ${arg_PUBLIC}
    PRIVATE $<BUILD_INTERFACE:palpate_flags> ${arg_PRIVATE})
  target_include_directories(${target} INTERFACE $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  if(NOT PROJECT_IS_TOP_LEVEL)
    target_include_directories(${target} INTERFACE $<BUILD_INTERFACE:${PROJECT_BINARY_DIR}/include>)
  endif()
  target_compile_features(${target} PUBLIC cxx_std_20)
  set_target_properties(${target} PROPERTIES
    EXPORT_NAME ${name}
    POSITION_INDEPENDENT_CODE ON
    VERIFY_INTERFACE_HEADER_SETS ${PALPATE_VERIFY_HEADERS})
  if(arg_WARM)
    target_compile_options(${target} PRIVATE ${PALPATE_WARM_OPTIONS})
  endif()
  if(arg_UNINSTALLED)
    target_compile_options(${target} PRIVATE ${PALPATE_COLD_OPTIONS})
  else()
    set_property(GLOBAL APPEND PROPERTY PALPATE_INSTALLED ${name})
    install(TARGETS ${target} EXPORT palpateTargets
      FILE_SET HEADERS DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/palpate)
  endif()
endfunction()

# A program in apps/ with its own install rule.
function(palpate_program name)
  cmake_parse_arguments(arg "" "" "SOURCES;PRIVATE" ${ARGN})
  add_executable(${name} ${arg_SOURCES} ${PROJECT_SOURCE_DIR}/apps/before_main.cpp)
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PRIVATE $<BUILD_INTERFACE:palpate_flags> ${arg_PRIVATE})
  target_compile_options(${name} PRIVATE ${PALPATE_COLD_OPTIONS})
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bin)
  install(TARGETS ${name})
endfunction()

# Puts text files into the program: generates <name>.cpp with a function
#   std::string_view <namespace>::<function>(std::string_view file) noexcept;
# that returns the file's text, or an empty view for a name that is not there. Declare it in a header of your own.
function(palpate_embed output)
  cmake_parse_arguments(arg "" "NAMESPACE;FUNCTION" "FILES" ${ARGN})
  set(body "// Generated from data files by palpate_embed().\n#include <string_view>\nnamespace ${arg_NAMESPACE} {\n")
  string(APPEND body "std::string_view ${arg_FUNCTION}(std::string_view file) noexcept;\n")
  string(APPEND body "std::string_view ${arg_FUNCTION}(std::string_view file) noexcept\n{\n")
  foreach(file IN LISTS arg_FILES)
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${file})
    file(READ ${file} hex HEX)
    string(REGEX REPLACE "([0-9a-f][0-9a-f])" "'\\\\x\\1'," bytes "${hex}")
    string(MAKE_C_IDENTIFIER ${file} identifier)
    string(APPEND body "  static constexpr char ${identifier}[] = {${bytes}'\\0'};\n")
    string(APPEND body "  if (file == \"${file}\") return {${identifier}, sizeof ${identifier} - 1};\n")
  endforeach()
  string(APPEND body "  return {};\n}\n}\n")
  file(CONFIGURE OUTPUT ${output} CONTENT "${body}" @ONLY)
endfunction()
