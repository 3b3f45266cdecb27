# SPDX-License-Identifier: Apache-2.0
# Flags for our own code only: link PRIVATE to locfuse_warnings.
add_library(locfuse_warnings INTERFACE)
target_compile_options(
  locfuse_warnings
  INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wnon-virtual-dtor
)
if(LOCFUSE_WERROR)
  target_compile_options(locfuse_warnings INTERFACE -Werror)
endif()
if(LOCFUSE_SANITIZE)
  # Unoptimized, the tests take many times as long; optimized and sanitized, GCC 12 calls empty
  # optionals of Eigen's matrices uninitialized. The checks left out double the time of compiling
  # Eigen, and find what AddressSanitizer and Eigen's assertions find, too.
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
  # Counters that several threads write, and none in the headers of others: they take minutes a test.
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
