# cmake --install: the program, the libraries for the CPU with their headers, and a package for find_package(traceflow).
# Its target traceflow::traceflow links all libraries but those of the command line; examples/train_balls uses it.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

function(traceflow_install)
  get_property(libraries GLOBAL PROPERTY TRACEFLOW_LIBRARIES)
  list(FILTER libraries EXCLUDE REGEX "^traceflow_cli")
  add_library(traceflow_everything INTERFACE)
  set_target_properties(traceflow_everything PROPERTIES EXPORT_NAME traceflow)
  target_link_libraries(traceflow_everything INTERFACE ${libraries})
  set_target_properties(traceflow_settings PROPERTIES EXPORT_NAME settings)

  install(TARGETS traceflow RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
  install(TARGETS traceflow_everything traceflow_settings ${libraries} EXPORT traceflow
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}/traceflow)
  install(DIRECTORY ${CMAKE_SOURCE_DIR}/src/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/traceflow
    FILES_MATCHING PATTERN "*.h" PATTERN "cli" EXCLUDE PATTERN "emulation" EXCLUDE)
  set(package ${CMAKE_INSTALL_LIBDIR}/cmake/traceflow)
  install(EXPORT traceflow NAMESPACE traceflow:: DESTINATION ${package} FILE traceflow-targets.cmake)
  write_basic_package_version_file(${CMAKE_BINARY_DIR}/traceflow-config-version.cmake COMPATIBILITY ExactVersion)
  install(FILES ${CMAKE_SOURCE_DIR}/cmake/traceflow-config.cmake ${CMAKE_BINARY_DIR}/traceflow-config-version.cmake
    DESTINATION ${package})
endfunction()
