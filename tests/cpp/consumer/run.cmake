# SPDX-License-Identifier: Apache-2.0
# cmake -D WAY=<installed|as_subdirectory> ... -P run.cmake: configures, builds and runs the consumer.
function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ECHO STDOUT COMMAND_ERROR_IS_FATAL ANY)
endfunction()

file(REMOVE_RECURSE ${WORK_DIR})
if(WAY STREQUAL "installed")
  run(${CMAKE_COMMAND} --install ${LOCFUSE_BINARY_DIR} --prefix ${WORK_DIR}/built --component cpp)
  file(RENAME ${WORK_DIR}/built ${WORK_DIR}/prefix) # absolute paths of the first prefix must not be used
  set(where -D CMAKE_PREFIX_PATH=${WORK_DIR}/prefix)
elseif(WAY STREQUAL "as_subdirectory")
  # With the options of this build and the same depth below the sources, the whole library is in the
  # compiler cache.
  set(
    where
    -DCONSUMER_SOURCE_DIR=${LOCFUSE_SOURCE_DIR}
    -DLOCFUSE_SANITIZE=${SANITIZE}
    -DLOCFUSE_BUILD_FUZZERS=${FUZZERS}
    -DLOCFUSE_WERROR=${WERROR}
  )
else()
  message(FATAL_ERROR "WAY is '${WAY}', expected installed or as_subdirectory")
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
run(${CMAKE_COMMAND} --build ${WORK_DIR})
run(${WORK_DIR}/consumer)
