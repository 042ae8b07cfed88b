# The Python module: found or left out. TRACEFLOW_PYTHON: AUTO builds it where Python's headers, NumPy and pybind11 are, ON
# asks for it, OFF leaves it out. Python_EXECUTABLE names the Python to build for.

set(TRACEFLOW_PYTHON AUTO CACHE STRING "Build the Python module: AUTO (where Python, NumPy and pybind11 are), ON or OFF")
set(TRACEFLOW_PYTHON_FOUND OFF)

# Sets Python_EXECUTABLE to the first Python with NumPy: the first one in PATH may be without.
function(traceflow_choose_python)
  if(Python_EXECUTABLE)
    return()
  endif()
  find_program(TRACEFLOW_PYTHON_IN_PATH python3)
  foreach(python ${TRACEFLOW_PYTHON_IN_PATH} /usr/bin/python3)
    execute_process(COMMAND ${python} -c "import numpy" RESULT_VARIABLE lacks_numpy OUTPUT_QUIET ERROR_QUIET)
    if(NOT lacks_numpy)
      set(Python_EXECUTABLE ${python} CACHE FILEPATH "The Python to build the module for")
      return()
    endif()
  endforeach()
endfunction()

# A sanitizer's module would need a Python that is linked with the sanitizer.
if(TRACEFLOW_PYTHON STREQUAL "ON" OR (TRACEFLOW_PYTHON STREQUAL "AUTO" AND NOT TRACEFLOW_SANITIZE))
  traceflow_choose_python()
  if(Python_EXECUTABLE)
    find_package(Python 3.9 QUIET COMPONENTS Interpreter Development.Module)
    if(Python_FOUND)
      find_package(pybind11 2.10 QUIET CONFIG)
    endif()
  endif()
  if(Python_FOUND AND pybind11_FOUND)
    set(TRACEFLOW_PYTHON_FOUND ON)
  elseif(TRACEFLOW_PYTHON STREQUAL "ON")
    message(FATAL_ERROR "TRACEFLOW_PYTHON is ON, but there is no Python with headers, NumPy and pybind11: "
      "scripts/setup --python installs them, or name one with Python_EXECUTABLE")
  else()
    message(STATUS "no Python with headers, NumPy and pybind11: built without the Python module")
  endif()
endif()
