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
  target_compile_options(
    locfuse_warnings
    INTERFACE -fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer
  )
  target_link_options(locfuse_warnings INTERFACE -fsanitize=address,undefined)
endif()
