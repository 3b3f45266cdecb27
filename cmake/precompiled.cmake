# SPDX-License-Identifier: Apache-2.0
# For targets with precompiled headers: link PRIVATE to locfuse_precompiled. Where ccache is the
# launcher, it keeps what they compile.
add_library(locfuse_precompiled INTERFACE)
if(CMAKE_CXX_COMPILER_LAUNCHER MATCHES "ccache$")
  set(
    CMAKE_CXX_COMPILER_LAUNCHER
    ${CMAKE_COMMAND}
    -E
    env
    CCACHE_SLOPPINESS=pch_defines,time_macros,include_file_mtime,include_file_ctime
    ${CMAKE_CXX_COMPILER_LAUNCHER}
  )
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    target_compile_options(locfuse_precompiled INTERFACE -fpch-preprocess)
  else()
    target_compile_options(locfuse_precompiled INTERFACE "SHELL:-Xclang -fno-pch-timestamp")
  endif()
endif()
