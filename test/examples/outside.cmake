# Installs the libraries of the build tree, configures the outside project against them, builds and runs its programs.
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE failed OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(failed)
    message(FATAL_ERROR "failed: ${ARGN}\n${output}")
  endif()
  set(output "${output}" PARENT_SCOPE)
endfunction()
string(REPLACE "," ";" components "${COMPONENTS}")
file(REMOVE_RECURSE ${WORK})
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${WORK}/prefix --component development)
run(${CMAKE_COMMAND} -S ${SOURCE} -B ${WORK}/build -G ${GENERATOR} -DCMAKE_PREFIX_PATH=${WORK}/prefix
    -DHEFT_PREFIX=${WORK}/prefix "-DHEFT_COMPONENTS=${COMPONENTS}")
run(${CMAKE_COMMAND} --build ${WORK}/build)
foreach(component IN LISTS components)
  run(${WORK}/build/${component}/outside_${component})
endforeach()
run(${WORK}/build/torque)
if(NOT output MATCHES "-9\\.810")
  message(FATAL_ERROR "unexpected torque: ${output}")
endif()
# A component that does not exist is named, with those that do.
execute_process(COMMAND ${CMAKE_COMMAND} -S ${SOURCE} -B ${WORK}/unknown -G ${GENERATOR}
                        -DCMAKE_PREFIX_PATH=${WORK}/prefix -DHEFT_PREFIX=${WORK}/prefix -DHEFT_COMPONENTS=levitate
                RESULT_VARIABLE failed OUTPUT_VARIABLE output ERROR_VARIABLE output)
if(NOT failed OR NOT output MATCHES "heft has no installed component[ \n]+'levitate'")
  message(FATAL_ERROR "an unknown component is not refused by name: ${output}")
endif()
