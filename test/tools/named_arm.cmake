# Exports a robot and demands the header that is in the repository; HEFT_GOLDEN_UPDATE=1 writes that instead.
# -DHEFT= the command, -DROBOT= a name, -DWORK= a folder, -DHEADER= the header
set(written ${WORK}/${ROBOT}.hpp)
if(DEFINED ENV{HEFT_GOLDEN_UPDATE})
  set(written ${HEADER})
endif()
execute_process(COMMAND ${HEFT} export --urdf ${ROBOT} --namespace heft_robots -o ${written}
                RESULT_VARIABLE code ERROR_VARIABLE err OUTPUT_QUIET)
if(code)
  message(FATAL_ERROR "heft export --urdf ${ROBOT}: ${err}")
endif()
file(READ ${written} now)
file(READ ${HEADER} before)
if(NOT now STREQUAL before)
  message(FATAL_ERROR "${HEADER} is not what heft export writes for ${ROBOT} (${written}); where that is meant, run this "
                      "test with HEFT_GOLDEN_UPDATE=1")
endif()
