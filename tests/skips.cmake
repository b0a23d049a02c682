# Which tests may skip, and why. A skip for any other reason is a failure; ctest lists the others at its end.
#
# ctest reads this file when it runs, once for each test program, with
#   palpate_name, palpate_list   the target, and the file in which gtest_discover_tests() has listed its tests; or
#   palpate_tests                names of tests that are no program of ours
#   palpate_data                 the folder of real volumes
#   palpate_viewer               whether the viewer is built
#
# What scripts/install-packages installs is there, and a display is (Xvfb): neither is a reason.
set(reasons)

# The volumes are other people's and are no part of the repository: a fresh clone has none.
if(NOT EXISTS ${palpate_data})
  list(APPEND reasons "no test volumes in")
endif()

# A build without VTK, and those with sanitizers, have no viewer to try.
if(NOT palpate_viewer)
  list(APPEND reasons "there is no palpate-view")
endif()

# Processors from before 2013.
file(STRINGS /proc/cpuinfo avx2 REGEX "^flags.* avx2 " LIMIT_COUNT 1)
if(NOT avx2)
  list(APPEND reasons "needs AVX2")
endif()

# A user who is not root cannot try what another user could do.
execute_process(COMMAND id -u OUTPUT_VARIABLE user OUTPUT_STRIP_TRAILING_WHITESPACE)
if(NOT user EQUAL 0)
  list(APPEND reasons "only root can be a second user")
endif()

# The kernel of the virtual machine is Debian's and is downloaded once: not where there is no network.
list(APPEND reasons "there is no kernel for the virtual machine and none could be downloaded")

# gtest_discover_tests() tells ctest to take every skip for one; ctest only ever adds to such a property.
if(NOT palpate_tests)
  if(EXISTS "${palpate_list}")
    file(READ "${palpate_list}" code)
    string(REPLACE SKIP_REGULAR_EXPRESSION FAIL_REGULAR_EXPRESSION code "${code}")
    cmake_language(EVAL CODE "${code}")
    set(palpate_tests ${${palpate_name}_TESTS})
  else()
    add_test(${palpate_name}_NOT_BUILT ${palpate_name}_NOT_BUILT)
    set(palpate_tests ${palpate_name}_NOT_BUILT)
  endif()
endif()

list(JOIN reasons "|" reasons)
# Tests that are disabled are run.
set_tests_properties(${palpate_tests} PROPERTIES
  SKIP_REGULAR_EXPRESSION "Skipped\n(${reasons})" FAIL_REGULAR_EXPRESSION "\\[  SKIPPED \\]" DISABLED FALSE)
