# Flags that every target of ours shares. Third-party headers come in as SYSTEM and stay silent.
include(CTest)

if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "" FORCE)
endif()

find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM)
  set(CMAKE_C_COMPILER_LAUNCHER ${CCACHE_PROGRAM})
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CCACHE_PROGRAM})
endif()

# Links in a quarter of the time of the system's linker, which links what is shipped.
option(PALPATE_MOLD "Link with mold, where it is installed" OFF)
find_program(MOLD_PROGRAM mold)
if(PALPATE_MOLD AND MOLD_PROGRAM)
  add_link_options(-fuse-ld=mold)
endif()

add_library(palpate_flags INTERFACE)
# No fused multiply-add and no fast-math: a replay must give the same bits.
target_compile_options(palpate_flags INTERFACE
  -ffp-contract=off -Wall -Wextra -Wpedantic -Wnon-virtual-dtor -Wold-style-cast)
if(CMAKE_UNITY_BUILD)
  # Several sources in one unit: the names of one are global to the next, and none is the main file.
  target_compile_options(palpate_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wshadow=local;-Wno-subobject-linkage>)
else()
  target_compile_options(palpate_flags INTERFACE -Wshadow)
endif()
if(PALPATE_WERROR)
  target_compile_options(palpate_flags INTERFACE -Werror)
endif()
if(PALPATE_SANITIZE)
  # What the undefined-behaviour sanitizer finds ends the program: a line on a terminal would fail no test.
  add_compile_options(-fsanitize=${PALPATE_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
  add_link_options(-fsanitize=${PALPATE_SANITIZE})
  if(CMAKE_CXX_COMPILER_ID STREQUAL Clang)
    add_compile_options(-fsanitize-ignorelist=${CMAKE_CURRENT_LIST_DIR}/sanitize_not_headers.txt)
    # Functions with more accesses than this, by default 7000, check them by calls: kernels compile in half the time and run as fast.
    add_compile_options("SHELL:-mllvm -asan-instrumentation-with-call-threshold=200")
  endif()
  if(PALPATE_SANITIZE_NOT)
    add_compile_options(-fno-sanitize=${PALPATE_SANITIZE_NOT})
    if(CMAKE_CXX_COMPILER_ID STREQUAL Clang)
      add_compile_options(-fsanitize-ignorelist=${CMAKE_CURRENT_LIST_DIR}/sanitize_quick.txt)
    endif()
  endif()
else()
  # GCC's -Wconversion fires under -fsanitize on code that is clean without it.
  target_compile_options(palpate_flags INTERFACE -Wconversion)
endif()
