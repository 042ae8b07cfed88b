# How every target of the project is built, said once: the standard, the warnings, the sanitizers, ccache.

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR})
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()

find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CCACHE_PROGRAM})
endif()

find_package(OpenMP REQUIRED COMPONENTS CXX)

# traceflow_settings: what users of the libraries need too. traceflow_build: how the project itself is compiled.
add_library(traceflow_settings INTERFACE)
add_library(traceflow_build INTERFACE)
# -ffp-contract=off: a sum must not change its bytes because a compiler fused it in one build and not in another.
target_compile_options(traceflow_build INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Wconversion -Wno-sign-conversion -ffp-contract=off -fno-math-errno)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  target_compile_options(traceflow_build INTERFACE $<$<COMPILE_LANGUAGE:CXX>:-Wduplicated-cond -Wlogical-op -Wsuggest-override>)
  # GCC 12 sees overlapping copies in std::string's operator+ that are not there (GCC bug 105651).
  target_compile_options(traceflow_build INTERFACE -Wno-restrict)
  # GCC 13 sees copies beyond the end in fmt 9's buffers, references that dangle wherever a function that returns one is
  # given a temporary (GCC bug 109642), and vectors of floats in memory that was not allocated.
  if(CMAKE_CXX_COMPILER_VERSION VERSION_GREATER_EQUAL 13)
    target_compile_options(traceflow_build INTERFACE
      -Wno-array-bounds -Wno-stringop-overflow -Wno-dangling-reference -Wno-free-nonheap-object)
  endif()
endif()
# A file's own names would hide those of the files that are compiled with it.
set(unity $<BOOL:$<TARGET_PROPERTY:UNITY_BUILD>>)
target_compile_options(traceflow_build INTERFACE
  $<${unity}:-Wno-shadow> $<$<AND:${unity},$<CXX_COMPILER_ID:GNU>>:-Wno-subobject-linkage>)
if(TRACEFLOW_WERROR)
  target_compile_options(traceflow_build INTERFACE -Werror)
endif()
target_compile_definitions(traceflow_settings INTERFACE GLM_FORCE_SILENT_WARNINGS GLM_FORCE_XYZW_ONLY)
target_compile_features(traceflow_settings INTERFACE cxx_std_20)
target_include_directories(traceflow_settings INTERFACE
  $<BUILD_INTERFACE:${CMAKE_SOURCE_DIR}/src> $<INSTALL_INTERFACE:include/traceflow>)
target_link_libraries(traceflow_settings INTERFACE OpenMP::OpenMP_CXX $<BUILD_INTERFACE:traceflow_build>)
if(TRACEFLOW_SANITIZE)
  target_compile_options(traceflow_build INTERFACE -fsanitize=${TRACEFLOW_SANITIZE} -fno-omit-frame-pointer
    -fno-sanitize-recover=all)
  target_link_options(traceflow_build INTERFACE -fsanitize=${TRACEFLOW_SANITIZE})
  # Of Highway's copies of each step, one for each instruction set, AVX2's alone, which all else may use as well: they are
  # one source, and the fallback of which there would be one besides takes Clang minutes a file.
  target_compile_options(traceflow_build INTERFACE -mavx2 -mfma -mf16c -mbmi -mbmi2 -mpclmul -maes)
  target_compile_definitions(traceflow_build INTERFACE "HWY_DISABLED_TARGETS=(HWY_AVX3|HWY_AVX3_DL)")
endif()

# traceflow_library(ops_raster LINKS base math scene [SYSTEM packages...])
# One library per folder: all .cpp files beside the CMakeLists.txt, in cpu/, in cuda/ and in FOLDERS. LINKS are the libraries that it may include; SYSTEM
# are outside packages. The compiler still finds the headers of other libraries, but their code does not link.
# Its .cu files are noted for the CUDA code, which is one library for all (traceflow_cuda): a library's
# own library calls it by weak names, which stay null in programs that are not linked with it.
function(traceflow_library name)
  cmake_parse_arguments(ARG "" "" "LINKS;SYSTEM;FOLDERS" ${ARGN})
  list(TRANSFORM ARG_FOLDERS APPEND "/*.cpp")
  file(GLOB sources CONFIGURE_DEPENDS *.cpp cpu/*.cpp cuda/*.cpp ${ARG_FOLDERS})
  # Highway compiles these once for each instruction set, by including them again: no file can stand before or after.
  foreach(source IN LISTS sources)
    file(STRINGS ${source} vectorised REGEX "foreach_target" LIMIT_COUNT 1)
    if(vectorised)
      set_source_files_properties(${source} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
    endif()
  endforeach()
  file(GLOB device_sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/*.cu ${CMAKE_CURRENT_SOURCE_DIR}/cuda/*.cu)
  set_property(GLOBAL APPEND PROPERTY TRACEFLOW_DEVICE_SOURCES ${device_sources})
  list(TRANSFORM ARG_LINKS PREPEND traceflow_)
  if(sources)
    add_library(traceflow_${name} STATIC ${sources})
    target_link_libraries(traceflow_${name} PUBLIC traceflow_settings ${ARG_LINKS} ${ARG_SYSTEM})
    # The Python module is a shared object. Nothing replaces a function of a library when the program is loaded, so that calls
    # within it stay direct.
    set_target_properties(traceflow_${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
    target_compile_options(traceflow_${name} PRIVATE $<$<COMPILE_LANGUAGE:CXX>:-fno-semantic-interposition>)
  else()
    add_library(traceflow_${name} INTERFACE)
    target_link_libraries(traceflow_${name} INTERFACE traceflow_settings ${ARG_LINKS} ${ARG_SYSTEM})
  endif()
  set_target_properties(traceflow_${name} PROPERTIES EXPORT_NAME ${name})
  if(TRACEFLOW_SEPARATE_FILES AND sources)
    set_target_properties(traceflow_${name} PROPERTIES UNITY_BUILD OFF)
  endif()
  set_property(GLOBAL APPEND PROPERTY TRACEFLOW_LIBRARIES traceflow_${name})
endfunction()
