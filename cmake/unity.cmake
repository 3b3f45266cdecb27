# SPDX-License-Identifier: Apache-2.0
# With LOCFUSE_UNITY_BUILD, compiles the sources of a target together, up to `count` of one folder as
# one: no two sources of a folder define the same name. Sources with options of their own stay alone,
# and so do those with SKIP_UNITY_BUILD_INCLUSION.
function(locfuse_compile_together target count)
  get_target_property(sources ${target} SOURCES)
  list(FILTER sources EXCLUDE REGEX "^\\$<")
  foreach(source IN LISTS sources)
    get_filename_component(folder ${source} DIRECTORY)
    string(MAKE_C_IDENTIFIER "in_${folder}" folder)
    math(EXPR group "0${${folder}} / ${count}")
    math(EXPR ${folder} "0${${folder}} + 1")
    set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${folder}_${group})
  endforeach()
  set_target_properties(
    ${target}
    PROPERTIES UNITY_BUILD ${LOCFUSE_UNITY_BUILD} UNITY_BUILD_MODE GROUP
  )
endfunction()
