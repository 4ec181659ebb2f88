# install and find_package(heft COMPONENTS ...); core asks for Eigen only.
include(CMakePackageConfigHelpers)
get_property(rooms GLOBAL PROPERTY HEFT_ROOMS)
foreach(room IN LISTS rooms)
  install(TARGETS heft_${room} EXPORT heft-${room} FILE_SET HEADERS
          ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
  install(EXPORT heft-${room} NAMESPACE heft:: FILE heft-${room}.cmake
          DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/heft)
endforeach()
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/heftConfig.cmake.in
  ${PROJECT_BINARY_DIR}/heftConfig.cmake INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/heft)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/heftConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/heftConfig.cmake ${PROJECT_BINARY_DIR}/heftConfigVersion.cmake
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/heft)
