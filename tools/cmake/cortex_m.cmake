# What the Cortex-M toolchain files share; each sets HEFT_CORTEX (name) and HEFT_CORTEX_FLAGS (processor, FPU)
# first.
# Eigen is the only host package firmware takes: pass -DEigen3_DIR=... if it is not found by itself.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR "${HEFT_CORTEX}")
# Nothing links before the image's own start-up code and linker script are there.
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)

find_program(HEFT_ARM_CXX arm-none-eabi-g++ REQUIRED)
set(CMAKE_CXX_COMPILER "${HEFT_ARM_CXX}")

set(CMAKE_CXX_FLAGS_INIT "${HEFT_CORTEX_FLAGS} -mthumb -mfloat-abi=hard -fno-exceptions -fno-rtti")
string(APPEND CMAKE_CXX_FLAGS_INIT " -ffunction-sections -fdata-sections -fstack-usage")
# The cache entry keeps CMake from appending its own -O3.
set(CMAKE_CXX_FLAGS_RELEASE "-O2 -DNDEBUG" CACHE STRING "")
