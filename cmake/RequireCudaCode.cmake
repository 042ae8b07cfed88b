# Fails if a weak name of the project is undefined in PROGRAM: a call of it would jump to address 0.
execute_process(COMMAND ${NM} -C ${PROGRAM} OUTPUT_VARIABLE symbols COMMAND_ERROR_IS_FATAL ANY)
string(REGEX MATCHALL "\n +w traceflow::[^\n]*" missing "\n${symbols}")
if(missing)
  string(REPLACE "\n                 w " "\n  " missing "${missing}")
  message(FATAL_ERROR "${PROGRAM} lacks CUDA code that it calls; is an explicit instantiation missing in a .cu file?${missing}")
endif()
