# Toolchain file: Cortex-M4F; its FPU is single precision, doubles are computed in software.
set(HEFT_CORTEX cortex_m4f)
set(HEFT_CORTEX_FLAGS "-mcpu=cortex-m4 -mfpu=fpv4-sp-d16")
include("${CMAKE_CURRENT_LIST_DIR}/cortex_m.cmake")
