# SPDX-License-Identifier: Apache-2.0
# Warning flags for locfuse itself: link PRIVATE to locfuse_warnings.
add_library(locfuse_warnings INTERFACE)
target_compile_options(
  locfuse_warnings
  INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wnon-virtual-dtor
)
if(LOCFUSE_WERROR)
  target_compile_options(locfuse_warnings INTERFACE -Werror)
endif()
if(LOCFUSE_SANITIZE)
  # The tests are many times slower without optimization; with optimization and sanitizers, GCC 12
  # reports empty optionals of Eigen matrices as uninitialized. The disabled checks double the compile
  # time of Eigen and only find errors that AddressSanitizer and Eigen's assertions find as well.
  target_compile_options(
    locfuse_warnings
    INTERFACE
      -fsanitize=address,undefined
      -fno-sanitize=alignment,null,object-size,pointer-overflow,vptr
      -fno-sanitize-recover=all
      -fno-omit-frame-pointer
      -O1
      -g1
      $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>
  )
  target_link_options(locfuse_warnings INTERFACE -fsanitize=address,undefined)
endif()
if(LOCFUSE_BUILD_FUZZERS)
  target_compile_options(
    locfuse_warnings
    INTERFACE -fsanitize=fuzzer-no-link,float-cast-overflow -fno-sanitize-recover=all
  )
endif()
if(LOCFUSE_SANITIZE_THREADS)
  target_compile_options(locfuse_warnings INTERFACE -fsanitize=thread -O1 -g1)
  target_link_options(locfuse_warnings INTERFACE -fsanitize=thread)
endif()
if(LOCFUSE_COVERAGE)
  # Atomic counters for threads, and none in third-party headers, which would take minutes per test.
  target_compile_options(
    locfuse_warnings
    INTERFACE
      --coverage
      -fprofile-update=atomic
      "-fprofile-filter-files=.*/cpp/(include|src)/.*"
      -O1
      -g1
  )
  target_link_options(locfuse_warnings INTERFACE --coverage)
endif()
