# Writes HEADER with the commit of SOURCE if it changed: from git, from .commit of a git archive, or from COMMIT.
file(READ ${SOURCE}/.commit archived)
string(STRIP "${archived}" archived)
set(commit unknown)
if(COMMIT)
  set(commit ${COMMIT})
elseif(NOT archived MATCHES Format)
  set(commit ${archived})
else()
  execute_process(COMMAND git -C ${SOURCE} rev-parse --show-prefix RESULT_VARIABLE failed OUTPUT_VARIABLE prefix
                  ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE)
  if(NOT failed AND prefix STREQUAL "")  # not a subfolder of another repository
    execute_process(COMMAND git -C ${SOURCE} describe --always --dirty --abbrev=12 --exclude=*
                    OUTPUT_VARIABLE described ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE)
    if(described)
      set(commit ${described})
    endif()
  endif()
endif()
file(CONFIGURE OUTPUT ${HEADER} CONTENT "#define CAIRN_COMMIT \"${commit}\"\n")
