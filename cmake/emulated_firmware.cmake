# SPDX-License-Identifier: MIT
# Builds firmware/boards/mps2_an500 with its own compiler and installs it beside the PC firmware. Without arm-none-eabi-g++ and
# its C++ library nothing is built, and `omni sitl --board cortex-m7` says what to install.
find_program(OMNI_ARM_CXX arm-none-eabi-g++)
set(arm_usable OFF)
if(OMNI_ARM_CXX AND NOT OMNI_SANITIZE)
  execute_process(
    COMMAND "${OMNI_ARM_CXX}" -fsyntax-only -x c++ -include atomic /dev/null
    RESULT_VARIABLE arm_failed OUTPUT_QUIET ERROR_QUIET)
  if(arm_failed EQUAL 0)
    set(arm_usable ON)
  endif()
endif()
if(NOT arm_usable)
  message(STATUS "emulated firmware: not built (Debian: apt-get install gcc-arm-none-eabi libstdc++-arm-none-eabi-newlib)")
  return()
endif()

include(ExternalProject)
set(mps2_dir "${CMAKE_CURRENT_BINARY_DIR}/mps2")
ExternalProject_Add(
  omni_firmware_mps2
  SOURCE_DIR "${PROJECT_SOURCE_DIR}/firmware/boards/mps2_an500"
  BINARY_DIR "${mps2_dir}"
  CMAKE_ARGS "-DCMAKE_TOOLCHAIN_FILE=${PROJECT_SOURCE_DIR}/cmake/arm-none-eabi.cmake" "-DOMNI_GENERATED=${OMNI_GENERATED}"
             "-DOMNI_WERROR=${OMNI_WERROR}"
             "-DCMAKE_MAKE_PROGRAM=${CMAKE_MAKE_PROGRAM}" # pip's Ninja is not on the PATH
  INSTALL_COMMAND ""
  DEPENDS omni_tables omni_mavlink omni_version
  BUILD_ALWAYS ON)
install(FILES "${mps2_dir}/omni-firmware-mps2.elf" DESTINATION omniwheel/bin)
