# SPDX-License-Identifier: Apache-2.0
# cmake -D WAY=<installed|as_subdirectory|with_other_options|without_pcl_and_ceres> ... -P run.cmake: configures,
# builds and runs the consumer.
cmake_minimum_required(VERSION 3.22)

function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ECHO STDOUT COMMAND_ERROR_IS_FATAL ANY)
endfunction()

file(REMOVE_RECURSE ${WORK_DIR})
if(WAY MATCHES "^(installed|with_other_options)$")
  run(${CMAKE_COMMAND} --install ${LOCFUSE_BINARY_DIR} --prefix ${WORK_DIR}/built --component cpp)
  file(RENAME ${WORK_DIR}/built ${WORK_DIR}/prefix) # absolute paths of the first prefix must not be used
  set(where -D CMAKE_PREFIX_PATH=${WORK_DIR}/prefix)
elseif(WAY MATCHES "^(as_subdirectory|without_pcl_and_ceres)$")
  # With the options of this build and the same depth below the sources, the whole library is in the
  # compiler cache.
  set(
    where
    -DCONSUMER_SOURCE_DIR=${LOCFUSE_SOURCE_DIR}
    -DLOCFUSE_SANITIZE=${SANITIZE}
    -DLOCFUSE_BUILD_FUZZERS=${FUZZERS}
    -DLOCFUSE_WERROR=${WERROR}
  )
  if(WAY STREQUAL "without_pcl_and_ceres")
    list(APPEND where -DLOCFUSE_WITH_PCL=OFF -DLOCFUSE_WITH_CERES=OFF)
  endif()
else()
  message(
    FATAL_ERROR
    "WAY is '${WAY}', expected installed, as_subdirectory, with_other_options or without_pcl_and_ceres"
  )
endif()

run(
  ${CMAKE_COMMAND}
  -S ${CMAKE_CURRENT_LIST_DIR}
  -B ${WORK_DIR}
  -G ${GENERATOR}
  -D CMAKE_BUILD_TYPE=${BUILD_TYPE}
  -D CMAKE_CXX_COMPILER=${CXX_COMPILER}
  -D CMAKE_CXX_FLAGS=${CXX_FLAGS}
  -D CONSUMER_OPTIONS=${CONSUMER_OPTIONS}
  -D CMAKE_CXX_COMPILER_LAUNCHER=${CXX_LAUNCHER}
  ${where}
)
if(NOT WAY STREQUAL "with_other_options")
  run(${CMAKE_COMMAND} --build ${WORK_DIR})
  run(${WORK_DIR}/consumer)
  return()
endif()

set(refusal ThisCodeAndLocfuseAreCompiledWithDifferentEigenAlignment)
file(STRINGS ${WORK_DIR}/option_sets.txt option_sets)
set(index 0)
set(refused)
foreach(options IN LISTS option_sets)
  set(target consumer_with_${index})
  execute_process(
    COMMAND ${CMAKE_COMMAND} --build ${WORK_DIR} --target ${target}
    RESULT_VARIABLE failed
    OUTPUT_VARIABLE output
    ERROR_VARIABLE output
  )
  if(NOT failed)
    execute_process(COMMAND ${WORK_DIR}/${target} RESULT_VARIABLE failed)
    message(STATUS "${options}: links, and returns ${failed}")
    if(failed)
      message(SEND_ERROR "a consumer compiled with ${options} is wrong")
    endif()
  elseif(output MATCHES "undefined reference[^\n]*${refusal}")
    message(STATUS "${options}: refused by the linker")
    list(APPEND refused "${options}")
  else()
    message(SEND_ERROR "a consumer compiled with ${options} does not build:\n${output}")
  endif()
  math(EXPR index "${index} + 1")
endforeach()
foreach(options IN ITEMS -DEIGEN_MAX_ALIGN_BYTES=32 -DEIGEN_DONT_ALIGN -D_GLIBCXX_DEBUG)
  if(NOT options IN_LIST refused)
    message(SEND_ERROR "a consumer compiled with ${options} was not refused")
  endif()
endforeach()
