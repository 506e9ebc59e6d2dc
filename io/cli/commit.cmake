# Writes the commit of SOURCE into the header TARGET, if it has changed.
cmake_minimum_required(VERSION 3.25)
execute_process(COMMAND git -C ${SOURCE} rev-parse --short=12 HEAD OUTPUT_VARIABLE commit ERROR_QUIET
  OUTPUT_STRIP_TRAILING_WHITESPACE RESULT_VARIABLE failed)
if(failed)
  set(commit "unknown")
else()
  execute_process(COMMAND git -C ${SOURCE} status --porcelain --untracked-files=no OUTPUT_VARIABLE changes ERROR_QUIET)
  if(changes)
    set(commit "${commit}, modified")
  endif()
endif()
file(CONFIGURE OUTPUT ${TARGET} CONTENT "#pragma once\n#define MORAINE_COMMIT \"@commit@\"\n" @ONLY)
