# traceflow_embed(TARGET NAMESPACE FILE...): the bytes of the files (absolute paths) as a table in the target,
#   namespace NAMESPACE { std::span<const EmbeddedFile> embedded_files(); }     (base/embedded_file.h)
# so that the program reads them without a path at run time. Made anew when a file changes.
function(traceflow_embed target namespace)
  set(made ${CMAKE_CURRENT_BINARY_DIR}/${target}_embedded.cpp)
  add_custom_command(
    OUTPUT ${made}
    COMMAND ${CMAKE_COMMAND} -DMADE=${made} -DNAMESPACE=${namespace} "-DFILES=${ARGN}" -P ${CMAKE_SOURCE_DIR}/cmake/embed.cmake
    DEPENDS ${ARGN} ${CMAKE_SOURCE_DIR}/cmake/embed.cmake
    VERBATIM)
  target_sources(${target} PRIVATE ${made})
endfunction()
