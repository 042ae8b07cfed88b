# cmake --install: the program with its manual pages and completions (component `program`), the libraries for the CPU with
# their headers, and a package for find_package(traceflow) (component `development`). Its target traceflow::traceflow links
# all libraries but those of the command line; examples/train_balls uses it.
# cpack makes a .deb of the program.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

# The program writes its manual pages and completions when it is installed.
function(traceflow_install_pages)
  set(pages ${CMAKE_BINARY_DIR}/pages)
  get_property(verbs GLOBAL PROPERTY TRACEFLOW_VERBS)
  install(CODE "
    function(write_page file)
      execute_process(COMMAND \"$<TARGET_FILE:traceflow>\" \${ARGN} OUTPUT_FILE \"${pages}/\${file}\" COMMAND_ERROR_IS_FATAL ANY)
    endfunction()
    file(REMOVE_RECURSE \"${pages}\")
    file(MAKE_DIRECTORY \"${pages}/man\")
    write_page(traceflow --completion bash)
    write_page(_traceflow --completion zsh)
    write_page(traceflow.fish --completion fish)
    write_page(man/traceflow.1 --man traceflow)
    foreach(verb IN ITEMS ${verbs})
      write_page(man/traceflow-\${verb}.1 --man \${verb})
    endforeach()
    # Debian's zsh looks for a package's completions in a folder of its own.
    set(zsh_folder site-functions)
    if(CMAKE_INSTALL_PREFIX MATCHES \"/usr$\")
      set(zsh_folder vendor-completions)
    endif()
    file(INSTALL \"${pages}/_traceflow\" DESTINATION \"\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_DATADIR}/zsh/\${zsh_folder}\")"
    COMPONENT program)
  install(FILES ${pages}/traceflow DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT program)
  install(FILES ${pages}/traceflow.fish DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d COMPONENT program)
  install(DIRECTORY ${pages}/man/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT program)
endfunction()

# dpkg-shlibdeps lists the packages of the shared libraries, so the .deb is for the distribution that it was made on.
macro(traceflow_package)
  set(CPACK_GENERATOR DEB)
  set(CPACK_DEB_COMPONENT_INSTALL ON)
  set(CPACK_COMPONENTS_ALL program)
  set(CPACK_COMPONENTS_GROUPING ALL_COMPONENTS_IN_ONE)
  set(CPACK_PACKAGE_NAME traceflow)
  set(CPACK_PACKAGE_CONTACT "TraceFlow developers <traceflow@localhost>")
  set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "${PROJECT_DESCRIPTION}")
  set(CPACK_PACKAGE_DESCRIPTION "Reconstructs moving specular scenes from video with 2D Gaussian surfels, and shows them in a browser.")
  set(CPACK_RESOURCE_FILE_LICENSE ${PROJECT_SOURCE_DIR}/LICENSE)
  set(CPACK_STRIP_FILES ON)
  set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
  set(CPACK_DEBIAN_PACKAGE_SECTION graphics)
  set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
  set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "ffmpeg")
  set(CPACK_DEBIAN_PACKAGE_SUGGESTS "colmap")
  include(CPack)
endmacro()

function(traceflow_install)
  get_property(libraries GLOBAL PROPERTY TRACEFLOW_LIBRARIES)
  list(FILTER libraries EXCLUDE REGEX "^traceflow_cli")
  add_library(traceflow_everything INTERFACE)
  set_target_properties(traceflow_everything PROPERTIES EXPORT_NAME traceflow)
  target_link_libraries(traceflow_everything INTERFACE ${libraries})
  set_target_properties(traceflow_settings PROPERTIES EXPORT_NAME settings)

  install(TARGETS traceflow RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT program)
  install(FILES ${CMAKE_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} RENAME copyright COMPONENT program)
  traceflow_install_pages()
  set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME development)
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
