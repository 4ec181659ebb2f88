# Toolchain file: Cortex-M7 with the double-precision FPU.
set(HEFT_CORTEX cortex_m7)
set(HEFT_CORTEX_FLAGS "-mcpu=cortex-m7 -mfpu=fpv5-d16")
include("${CMAKE_CURRENT_LIST_DIR}/cortex_m.cmake")
