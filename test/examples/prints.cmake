# Runs PROGRAM and compares what it prints with the file EXPECTED.
execute_process(COMMAND ${PROGRAM} RESULT_VARIABLE failed OUTPUT_VARIABLE output)
file(READ ${EXPECTED} expected)
if(failed OR NOT output STREQUAL expected)
  message(FATAL_ERROR "${PROGRAM} ended with ${failed} and printed\n${output}where this was due:\n${expected}")
endif()
