# Which tests may skip, and why. A skip for any other reason is a failure; ctest lists the others at its end.
#
# ctest reads this file when it runs, once for each test program, with
#   palpate_tests        names of tests, or a file of list_suites.py with those of a program of ours
#   palpate_properties   of these tests
#   palpate_data         the folder of real volumes
#   palpate_viewer       whether the viewer is built
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

list(JOIN reasons "|" reasons)

# A program of ours judges its skips itself (main.cpp): a suite may have a test that skips and one that fails.
if(palpate_tests MATCHES "_suites\\.cmake$")
  if(EXISTS "${palpate_tests}")
    include("${palpate_tests}")
    if(palpate_alone)
      set_tests_properties(${palpate_alone} PROPERTIES RUN_SERIAL ON LABELS alone)
    endif()
  else()
    add_test(${palpate_tests} NOT_BUILT)
  endif()
  set_tests_properties(${palpate_tests} PROPERTIES ${palpate_properties})
  # ctest adds to an environment.
  set_tests_properties(${palpate_tests} PROPERTIES SKIP_RETURN_CODE 77 ENVIRONMENT "PALPATE_SKIPS=${reasons}")
else()
  # Tests that are disabled are run.
  set_tests_properties(${palpate_tests} PROPERTIES
    SKIP_REGULAR_EXPRESSION "Skipped\n(${reasons})" FAIL_REGULAR_EXPRESSION "\\[  SKIPPED \\]" DISABLED FALSE)
endif()
