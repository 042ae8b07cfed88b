# The CUDA code: found or left out, and how it is compiled. TRACEFLOW_CUDA: AUTO takes it where nvcc is, ON asks for
# it, OFF leaves it out.

set(TRACEFLOW_CUDA AUTO CACHE STRING "Build the CUDA code: AUTO (where nvcc is), ON or OFF")
set(TRACEFLOW_CUDA_FOUND OFF)

# Before project languages are enabled, so that no GPU is asked for: machine code for the families of chips that both CUDA
# 12.4 and 13 know (8.0's runs on 8.6 and 8.9 too), and PTX for those that come.
if(NOT DEFINED CMAKE_CUDA_ARCHITECTURES AND NOT DEFINED ENV{CUDAARCHS})
  set(CMAKE_CUDA_ARCHITECTURES 75-real 80-real 90)
endif()

if(NOT TRACEFLOW_CUDA STREQUAL "OFF")
  if(NOT DEFINED CMAKE_CUDA_COMPILER AND NOT DEFINED ENV{CUDACXX})
    find_program(TRACEFLOW_NVCC nvcc HINTS /usr/local/cuda/bin)
    if(TRACEFLOW_NVCC)
      set(CMAKE_CUDA_COMPILER ${TRACEFLOW_NVCC})
    endif()
  endif()
  include(CheckLanguage)
  check_language(CUDA)
  if(CMAKE_CUDA_COMPILER)
    enable_language(CUDA)
    find_package(CUDAToolkit 12.4 REQUIRED)
    if(CCACHE_PROGRAM)
      set(CMAKE_CUDA_COMPILER_LAUNCHER ${CCACHE_PROGRAM})
    endif()
    set(TRACEFLOW_CUDA_FOUND ON)
  elseif(TRACEFLOW_CUDA STREQUAL "ON")
    message(FATAL_ERROR "TRACEFLOW_CUDA is ON, but there is no nvcc: install CUDA 12.4 or later, or name it with CUDACXX")
  else()
    message(STATUS "no nvcc: built without CUDA")
  endif()
endif()

# A unity build for CUDA, which CMake's UNITY_BUILD does for C++ alone: replaces a list of .cu files by fewer that include them. Most of
# the time that nvcc takes for a file goes into the same headers.
function(traceflow_join_sources list)
  set(files_each 6)
  set(joined)
  set(text)
  set(count 0)
  foreach(source IN LISTS ${list} ITEMS end)
    if(text AND (source STREQUAL "end" OR count EQUAL files_each))
      list(LENGTH joined number)
      set(file ${CMAKE_BINARY_DIR}/cuda_unity/unity_${number}.cu)
      file(CONFIGURE OUTPUT ${file} CONTENT "${text}" @ONLY)
      list(APPEND joined ${file})
      set(text)
      set(count 0)
    endif()
    string(APPEND text "#include \"${source}\"\n")
    math(EXPR count "${count} + 1")
  endforeach()
  set(${list} ${joined} PARENT_SCOPE)
endfunction()

# The build of a program that is linked with the CUDA code, or its emulation, fails if code that the libraries call by a
# weak name is missing.
function(traceflow_require_cuda_code target)
  add_custom_command(TARGET ${target} POST_BUILD VERBATIM
    COMMAND ${CMAKE_COMMAND} -D NM=${CMAKE_NM} -D PROGRAM=$<TARGET_FILE:${target}> -P ${PROJECT_SOURCE_DIR}/cmake/RequireCudaCode.cmake)
endfunction()

# traceflow_cuda: the .cu files of all libraries as objects, so that each of their names finds the weak ones that call it.
# Programs link it; where CUDA is left out it is empty.
function(traceflow_cuda_library)
  add_library(traceflow_cuda INTERFACE)
  if(NOT TRACEFLOW_CUDA_FOUND)
    return()
  endif()
  get_property(sources GLOBAL PROPERTY TRACEFLOW_DEVICE_SOURCES)
  if(CMAKE_UNITY_BUILD)
    traceflow_join_sources(sources)
  endif()
  add_library(traceflow_cuda_objects OBJECT ${sources})
  target_include_directories(traceflow_cuda_objects PRIVATE ${CMAKE_SOURCE_DIR}/src)
  target_compile_definitions(traceflow_cuda_objects PRIVATE GLM_FORCE_SILENT_WARNINGS GLM_FORCE_XYZW_ONLY)
  # cuBLASLt is opened when it is needed (primitives/cublas_lt.h).
  target_compile_definitions(traceflow_cuda_objects PRIVATE TRACEFLOW_CUDA_LIBRARIES="${CUDAToolkit_LIBRARY_DIR}")
  # The standard is named as an option because CMake 3.25 does not know that nvcc has it.
  set_target_properties(traceflow_cuda_objects PROPERTIES CUDA_EXTENSIONS ON CXX_STANDARD_REQUIRED OFF UNITY_BUILD OFF
    POSITION_INDEPENDENT_CODE ON)
  set_property(TARGET traceflow_cuda_objects PROPERTY CXX_STANDARD)
  # 20012: GLM marks its defaulted constructors for the device, which needs no mark.
  target_compile_options(traceflow_cuda_objects PRIVATE
    -std=c++20 --expt-relaxed-constexpr --extended-lambda -diag-suppress=20012 -Xcompiler=-Wall,-Wextra,-Wno-unknown-pragmas)
  # A weak name, which may be null elsewhere, may stand beside what it names.
  if(CMAKE_UNITY_BUILD)
    target_compile_options(traceflow_cuda_objects PRIVATE -Xcompiler=-Wno-address)
  endif()
  if(TRACEFLOW_WERROR)
    target_compile_options(traceflow_cuda_objects PRIVATE -Werror=all-warnings)
  endif()
  target_link_libraries(traceflow_cuda INTERFACE $<TARGET_OBJECTS:traceflow_cuda_objects> CUDA::cudart_static ${CMAKE_DL_LIBS})
endfunction()
