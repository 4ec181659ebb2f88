# install and find_package(heft COMPONENTS ...); core asks for Eigen only.
include(CMakePackageConfigHelpers)
get_property(rooms GLOBAL PROPERTY HEFT_ROOMS)

# Packages that are found for a library, in this order, where its name does not say it (PACKAGE::library).
set(heft_packages_of_fcl ccd octomap fcl)
set(heft_packages_of_urdfdom::urdfdom_model console_bridge urdfdom)
set(heft_packages_of_SQLite::SQLite3 SQLite3)
# Linked by name: the linker finds them, no package does.
foreach(library lz4 zstd)
  set(heft_packages_of_${library} "")
endforeach()
# The oldest version that serves.
set(heft_version_of_Eigen3 3.4)
set(heft_version_of_SUNDIALS 6.4)

# heft_read_needs(ROOM ROOMS_VARIABLE PACKAGES_VARIABLE)
# What a room links, directly or through others, read from its target: rooms, itself last, and packages.
function(heft_read_needs room rooms_variable packages_variable)
  set(needs "")
  set(packages "")
  get_target_property(libraries heft_${room} LINK_LIBRARIES)
  foreach(library IN LISTS libraries)
    if(library MATCHES "^\\$<BUILD_INTERFACE:")
      continue()
    endif()
    string(REGEX REPLACE "^heft(::|_)" "" other "${library}")
    if(other IN_LIST rooms)
      heft_read_needs(${other} other_needs other_packages)
      list(APPEND needs ${other_needs})
      list(APPEND packages ${other_packages})
    elseif(DEFINED "heft_packages_of_${library}")
      list(APPEND packages ${heft_packages_of_${library}})
    elseif(library MATCHES "^([A-Za-z0-9_]+)::")
      list(APPEND packages ${CMAKE_MATCH_1})
    else()
      message(FATAL_ERROR "HeftInstall.cmake: heft_${room} links '${library}', whose name does not say which package "
                          "brings it; set heft_packages_of_${library}")
    endif()
  endforeach()
  list(APPEND needs ${room})
  list(REMOVE_DUPLICATES needs)
  list(REMOVE_DUPLICATES packages)
  set(${rooms_variable} "${needs}" PARENT_SCOPE)
  set(${packages_variable} "${packages}" PARENT_SCOPE)
endfunction()

set(heft_needs "")
foreach(room IN LISTS rooms)
  heft_read_needs(${room} needs packages)
  string(APPEND heft_needs "set(heft_needs_${room} ${needs})\nset(heft_packages_${room} ${packages})\n")
  # For those who want the libraries without the command: cmake --install build --component development
  install(TARGETS heft_${room} EXPORT heft-${room} FILE_SET HEADERS COMPONENT development
          ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development
          RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT development)
  install(EXPORT heft-${room} NAMESPACE heft:: FILE heft-${room}.cmake
          DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/heft COMPONENT development)
endforeach()
get_cmake_property(variables VARIABLES)
foreach(variable IN LISTS variables)
  if(variable MATCHES "^heft_version_of_")
    string(APPEND heft_needs "set(${variable} ${${variable}})\n")
  endif()
endforeach()

configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/heftConfig.cmake.in
  ${PROJECT_BINARY_DIR}/heftConfig.cmake INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/heft)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/heftConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/heftConfig.cmake ${PROJECT_BINARY_DIR}/heftConfigVersion.cmake
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/heft COMPONENT development)
