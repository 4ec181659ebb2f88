# Rooms, warnings, sanitizers and tests: one function each, so that every target is made the same way.

add_library(heft_warnings INTERFACE)
target_compile_options(heft_warnings INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
  # GCC 12 finds overlapping copies where a literal and a string are joined (GCC bug 105651).
  target_compile_options(heft_warnings INTERFACE -Wno-restrict)
endif()
if(CMAKE_UNITY_BUILD)
  # What is hidden in a source file is in "a header" where several sources are compiled at once.
  target_compile_options(heft_warnings INTERFACE -Wno-subobject-linkage)
endif()
add_library(heft_precompiled_warnings INTERFACE)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
  # Strings from a precompiled header are taken for the 32 bytes of an empty one (akin to GCC bug 105651).
  target_compile_options(heft_precompiled_warnings INTERFACE
    -Wno-array-bounds -Wno-stringop-overflow -Wno-stringop-overread)
endif()
if(HEFT_WERROR)
  target_compile_options(heft_warnings INTERFACE -Werror)
endif()

add_library(heft_core_warnings INTERFACE)
target_compile_options(heft_core_warnings INTERFACE -Wconversion -Wdouble-promotion)

if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # The compiler spends an eighth of its time on collecting garbage as soon as it holds more than 128 MB, which is
  # every file that includes Eigen; a heap of 1 GB before it starts costs a fifth more memory.
  add_compile_options(--param=ggc-min-heapsize=1000000)
endif()

if(PROJECT_IS_TOP_LEVEL AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND NOT CMAKE_CROSSCOMPILING)
  # Links 120 programs in half the time.
  find_program(HEFT_GOLD ld.gold)
  if(HEFT_GOLD)
    add_link_options(-fuse-ld=gold)
  endif()
endif()

if(HEFT_SANITIZE)
  add_compile_options(-fsanitize=${HEFT_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=undefined)
  add_link_options(-fsanitize=${HEFT_SANITIZE})
endif()

if(HEFT_FUZZ)
  add_compile_options(-fsanitize=fuzzer-no-link,address,undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer)
  add_link_options(-fsanitize=address,undefined)
endif()

# What most files of the host's rooms and of the command include.
set(heft_common_headers
  <algorithm> <array> <cmath> <functional> <limits> <memory> <string> <vector> <Eigen/Core> <fmt/format.h>)

# heft_effort(TARGET LEVEL)
# What the compiler is to take pains with, instead of -O3.
function(heft_effort target level)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:${level}>)
  endif()
endfunction()

# heft_precompiled(NAME [EFFORT level] LIBRARIES libs ... HEADERS <a> ...)
# Headers of other projects, parsed once for all targets that call heft_reuse_headers(TARGET NAME): a second or two a
# file. GCC compiles a file with the optimisation of its precompiled header, whatever the command line says: sources of
# another effort do without (SKIP_PRECOMPILE_HEADERS). A file still includes what it uses:
# -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON builds too.
function(heft_precompiled name)
  cmake_parse_arguments(ARG "" "EFFORT" "LIBRARIES;HEADERS" ${ARGN})
  if(TARGET ${name})
    return()
  endif()
  add_library(${name} OBJECT ${PROJECT_SOURCE_DIR}/tools/cmake/precompiled_headers.cpp)
  target_compile_features(${name} PRIVATE cxx_std_20)
  target_link_libraries(${name} PRIVATE ${ARG_LIBRARIES} heft_warnings)
  target_precompile_headers(${name} PRIVATE ${ARG_HEADERS})
  if(ARG_EFFORT)
    heft_effort(${name} ${ARG_EFFORT})
  endif()
endfunction()

function(heft_reuse_headers target name)
  target_precompile_headers(${target} REUSE_FROM ${name})
  target_link_libraries(${target} PRIVATE $<BUILD_INTERFACE:heft_precompiled_warnings>)
endfunction()

# heft_reuse_cold_headers(TARGET)
# For a target whose speed nobody notices (options, words, tables, JSON): light optimisation, headers to match.
function(heft_reuse_cold_headers target)
  heft_effort(${target} -Og)
  heft_precompiled(heft_cold_headers EFFORT -Og LIBRARIES Eigen3::Eigen fmt::fmt nlohmann_json::nlohmann_json
                   HEADERS ${heft_common_headers} <nlohmann/json.hpp>)
  heft_reuse_headers(${target} heft_cold_headers)
endfunction()

# heft_optimised(TARGET LEVEL)
# Optimisation of a target, with precompiled headers to match.
function(heft_optimised target level)
  heft_effort(${target} ${level})
  heft_precompiled(heft_headers${level} EFFORT ${level} LIBRARIES Eigen3::Eigen fmt::fmt HEADERS ${heft_common_headers})
  heft_reuse_headers(${target} heft_headers${level})
endfunction()

# heft_add_room(NAME SOURCES a.cpp ... PUBLIC libs ... PRIVATE libs ... [COLD | FAST])
# A room is a static library heft_NAME, alias heft::NAME, exported as heft::NAME. COLD: nobody notices its speed. The host's
# rooms are compiled with -O2: a diagnosis takes as long as with -O3 and the compiler a tenth less. FAST: with -O3, where that
# is a tenth of the time, as in core, a sample of which takes 5 to 35 % longer with -O2.
function(heft_add_room name)
  cmake_parse_arguments(ARG "COLD;FAST" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  add_library(heft_${name} STATIC ${ARG_SOURCES})
  add_library(heft::${name} ALIAS heft_${name})
  set_target_properties(heft_${name} PROPERTIES EXPORT_NAME ${name})
  file(GLOB_RECURSE headers CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/include/heft/${name}/*.hpp)
  target_sources(heft_${name} PUBLIC FILE_SET HEADERS BASE_DIRS ${PROJECT_SOURCE_DIR}/include FILES ${headers})
  target_compile_features(heft_${name} PUBLIC cxx_std_20)
  target_link_libraries(heft_${name} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE} $<BUILD_INTERFACE:heft_warnings>)
  if(ARG_COLD)
    heft_reuse_cold_headers(heft_${name})
  elseif(NOT name STREQUAL "core")  # which is built as firmware builds it
    set(effort -O2)
    if(ARG_FAST)
      set(effort -O3)
    endif()
    heft_optimised(heft_${name} ${effort})
  endif()
  set_property(GLOBAL APPEND PROPERTY HEFT_ROOMS ${name})
endfunction()

# heft_cold_sources(a.cpp ...)
# Options, tables, JSON and other files whose speed nobody notices: light optimisation halves the time to compile
# them. Call it in the folder of the sources.
function(heft_cold_sources)
  heft_source_effort(-Og ${ARGN})
endfunction()

# heft_steering_sources(a.cpp ...)
# Files beside which others take the time: they say what to compute and weigh the results, while decompositions, rows
# of the regressor and simulated arms are elsewhere. Call it in the folder of the sources.
function(heft_steering_sources)
  heft_source_effort(-O1 ${ARGN})
endfunction()

# heft_alone(a.cpp ...)
# Files that a unity build (CMAKE_UNITY_BUILD, which tools/test and tools/quickstart turn on: files of a target compiled
# several at once, so that what they share is parsed and instantiated once) is not to join, since names that are
# theirs alone clash.
function(heft_alone)
  set_source_files_properties(${ARGN} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()

# Files of a library become a part of it that is compiled with this effort: an object library, so that they have headers
# precompiled to match and can be joined in a unity build. Elsewhere, and alone, a file gets a property.
function(heft_source_effort level)
  get_property(targets DIRECTORY PROPERTY BUILDSYSTEM_TARGETS)
  foreach(target IN LISTS targets)
    get_target_property(kind ${target} TYPE)
    get_target_property(sources ${target} SOURCES)
    if(kind STREQUAL "STATIC_LIBRARY" AND "${ARGV1}" IN_LIST sources)
      string(REPLACE "-" "_" part ${target}${level})
      list(REMOVE_ITEM sources ${ARGN})
      set_target_properties(${target} PROPERTIES SOURCES "${sources}")
      add_library(${part} OBJECT ${ARGN})
      target_compile_features(${part} PRIVATE cxx_std_20)
      get_target_property(libraries ${target} LINK_LIBRARIES)
      target_link_libraries(${part} PRIVATE ${libraries})
      target_include_directories(${part} PRIVATE $<TARGET_PROPERTY:${target},INCLUDE_DIRECTORIES>)
      target_compile_definitions(${part} PRIVATE $<TARGET_PROPERTY:${target},COMPILE_DEFINITIONS>)
      if(level STREQUAL "-Og")
        heft_reuse_cold_headers(${part})
      else()
        heft_optimised(${part} ${level})
      endif()
      target_sources(${target} PRIVATE $<TARGET_OBJECTS:${part}>)
      return()
    endif()
  endforeach()
  set_source_files_properties(${ARGN} PROPERTIES COMPILE_OPTIONS "$<$<CONFIG:Release>:${level}>"
                                                 SKIP_PRECOMPILE_HEADERS ON)
endfunction()

# heft_add_test(NAME SOURCES a.cpp ... LIBRARIES libs ... LABELS unit ... [OPTIMISED | LIGHT] [WHOLE] [SLOW filter])
# One googletest binary; every TEST becomes a ctest entry NAME.Suite.Test with the labels given; those that the
# googletest filter SLOW matches are labelled slow too. WHOLE makes one entry of the binary, where its tests share what
# takes long to make. What is tested is compiled as it ships; the test around it with less effort, which is a third of
# its compile time, unless OPTIMISED; LIGHT is for tests that run the command and read what it writes.
function(heft_add_test name)
  cmake_parse_arguments(ARG "OPTIMISED;LIGHT;WHOLE" "TIMEOUT;SLOW" "SOURCES;LIBRARIES;LABELS;DEFINITIONS" ${ARGN})
  if(NOT ARG_LABELS)
    set(ARG_LABELS unit)
  endif()
  if("slow" IN_LIST ARG_LABELS AND NOT HEFT_SLOW)
    return()
  endif()
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 300)
  endif()
  add_executable(test_${name} ${ARG_SOURCES})
  target_link_libraries(test_${name} PRIVATE ${ARG_LIBRARIES} GTest::gtest GTest::gtest_main GTest::gmock heft_warnings)
  if(ARG_LIGHT)
    heft_precompiled(heft_light_test_headers EFFORT -O0
                     LIBRARIES GTest::gtest GTest::gmock Eigen3::Eigen nlohmann_json::nlohmann_json
                     HEADERS <gmock/gmock.h> <gtest/gtest.h> <Eigen/Core> <filesystem> <fstream> <string> <vector>
                             <nlohmann/json.hpp>)
    heft_effort(test_${name} -O0)
    target_link_libraries(test_${name} PRIVATE Eigen3::Eigen nlohmann_json::nlohmann_json)
    heft_reuse_headers(test_${name} heft_light_test_headers)
  elseif(NOT ARG_OPTIMISED)
    heft_precompiled(heft_test_headers EFFORT -Og LIBRARIES GTest::gtest GTest::gmock Eigen3::Eigen
                     HEADERS <gmock/gmock.h> <gtest/gtest.h> <Eigen/Dense> <string> <vector>)
    heft_effort(test_${name} -Og)
    target_link_libraries(test_${name} PRIVATE Eigen3::Eigen)
    heft_reuse_headers(test_${name} heft_test_headers)
  endif()
  target_compile_features(test_${name} PRIVATE cxx_std_20)
  target_include_directories(test_${name} PRIVATE ${PROJECT_SOURCE_DIR}/test)
  target_compile_definitions(test_${name} PRIVATE
    HEFT_DATA_DIR="${HEFT_DATA_DIR}" HEFT_REFERENCE_DIR="${HEFT_REFERENCE_DIR}"
    HEFT_URDF_DIR="${PROJECT_SOURCE_DIR}/urdf" HEFT_SOURCE_DIR="${PROJECT_SOURCE_DIR}" ${ARG_DEFINITIONS})
  if(ARG_WHOLE)
    add_test(NAME ${name} COMMAND test_${name})
    set_tests_properties(${name} PROPERTIES LABELS "${ARG_LABELS}" TIMEOUT ${ARG_TIMEOUT})
  elseif(ARG_SLOW)
    heft_discover_tests(${name} ${name}_slow "${ARG_SLOW}" ${ARG_TIMEOUT} ${ARG_LABELS} slow)
    heft_discover_tests(${name} ${name} "-${ARG_SLOW}" ${ARG_TIMEOUT} ${ARG_LABELS})
  else()
    heft_discover_tests(${name} ${name} "*" ${ARG_TIMEOUT} ${ARG_LABELS})
  endif()
endfunction()

# heft_discover_tests(NAME LIST FILTER TIMEOUT labels ...)
# Makes ctest entries of those tests of test_NAME that a googletest filter matches. LIST names the group.
function(heft_discover_tests name list filter timeout)
  gtest_discover_tests(test_${name} TEST_PREFIX "${name}." TEST_FILTER "${filter}" TEST_LIST ${list}_tests
                       DISCOVERY_TIMEOUT 60 PROPERTIES TIMEOUT ${timeout})
  # gtest_discover_tests takes one label for a list and the next word for a property: labels are set behind it.
  set(labels_file ${CMAKE_CURRENT_BINARY_DIR}/${list}_labels.cmake)
  file(WRITE ${labels_file} "foreach(each IN LISTS ${list}_tests)
  set_tests_properties(\"\${each}\" PROPERTIES LABELS \"${ARGN}\")
endforeach()
")
  set_property(DIRECTORY APPEND PROPERTY TEST_INCLUDE_FILES ${labels_file})
endfunction()
