# SPDX-License-Identifier: MIT
# One set of flags for all of this project's code. No contraction to fused multiply-add: the core must give the same bits on
# every machine.
add_library(omni_flags INTERFACE)
target_compile_options(omni_flags INTERFACE $<IF:$<BOOL:${OMNI_SANITIZE}>,-O1,-O3> -ffp-contract=off -fno-math-errno)
# CMAKE_C_FLAGS and CMAKE_CXX_FLAGS cannot do it: they come before the level above, and the last one counts.
set(OMNI_LEVEL "" CACHE STRING "Level of optimisation in place of the products' own")
target_compile_options(omni_flags INTERFACE ${OMNI_LEVEL})

# As for PlatformIO: with OMNI_WERROR=1 in the environment, as in CI. Every compiler has other warnings.
option(OMNI_WERROR "Treat warnings in this project's own code as errors" "$ENV{OMNI_WERROR}")
add_library(omni_warnings INTERFACE)
target_compile_options(omni_warnings INTERFACE -Wall -Wextra -Wconversion)
if(OMNI_WERROR)
  target_compile_options(omni_warnings INTERFACE -Werror)
endif()

option(OMNI_ASSERTS "Check the core's invariants while it runs (shared/core/src/math/invariant.h)" OFF)
if(OMNI_ASSERTS OR OMNI_SANITIZE OR OMNI_FUZZ)
  target_compile_definitions(omni_flags INTERFACE OMNI_ASSERTS)
endif()

if(OMNI_FUZZ AND OMNI_FUZZ_WITH STREQUAL "sanitizers")
  set(fuzz_sanitizers -fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all)
  # Lines are enough for a trace. Clang 14 crashes over a debugger's variables in vectors of sixteen.
  target_compile_options(omni_flags INTERFACE ${fuzz_sanitizers} -fsanitize=fuzzer-no-link -fno-omit-frame-pointer
                                              -gline-tables-only)
  target_link_options(omni_flags INTERFACE ${fuzz_sanitizers})
elseif(OMNI_FUZZ AND OMNI_FUZZ_WITH STREQUAL "coverage")
  set(fuzz_coverage -fprofile-instr-generate -fcoverage-mapping)
  target_compile_options(omni_flags INTERFACE ${fuzz_coverage} -gline-tables-only)
  target_link_options(omni_flags INTERFACE ${fuzz_coverage})
elseif(OMNI_FUZZ AND NOT OMNI_FUZZ_WITH STREQUAL "nothing")
  message(FATAL_ERROR "OMNI_FUZZ_WITH is ${OMNI_FUZZ_WITH}; it can be sanitizers, coverage or nothing")
endif()

if(OMNI_SANITIZE)
  set(sanitizers -fsanitize=address,undefined -fno-sanitize-recover=all)
  target_compile_options(omni_flags INTERFACE ${sanitizers} -fno-omit-frame-pointer -g)
  target_link_options(omni_flags INTERFACE ${sanitizers})
  if(CMAKE_C_COMPILER_ID MATCHES "Clang" AND NOT APPLE)
    # clang links its runtime statically into programs only; a Python extension needs the shared one.
    target_link_options(omni_flags INTERFACE -shared-libasan)
  endif()
endif()
