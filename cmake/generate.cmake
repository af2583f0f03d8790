# SPDX-License-Identifier: MIT
# The generation step: parameter, robot and world tables, MAVLink dialect, version header.
set(OMNI_GENERATED "${CMAKE_BINARY_DIR}/generated")
set(generator_dir "${PROJECT_SOURCE_DIR}/shared/generate")
set(generator "${Python_EXECUTABLE}" "${generator_dir}/generate.py" --out "${OMNI_GENERATED}")

file(GLOB_RECURSE generator_sources CONFIGURE_DEPENDS "${generator_dir}/*.py")
file(GLOB robot_files CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/shared/robots/*.toml")
list(APPEND robot_files ${OMNI_ROBOTS})
set(robot_arguments "")
foreach(robot_file IN LISTS robot_files)
  list(APPEND robot_arguments --robot "${robot_file}")
endforeach()
set(OMNI_ROBOT_FILES ${robot_files})

set(controller_arguments "")
set(controller_files "")
if(OMNI_CONTROLLER)
  get_filename_component(OMNI_CONTROLLER_FOLDER "${OMNI_CONTROLLER}" ABSOLUTE BASE_DIR "${PROJECT_SOURCE_DIR}")
  set(controller_arguments --controller "${OMNI_CONTROLLER_FOLDER}")
  file(GLOB controller_files CONFIGURE_DEPENDS "${OMNI_CONTROLLER_FOLDER}/*.[ch]" "${OMNI_CONTROLLER_FOLDER}/*.toml")
endif()

set(OMNI_GENERATED_SOURCES "${OMNI_GENERATED}/src/params_gen.c" "${OMNI_GENERATED}/src/robots_gen.c"
                           "${OMNI_GENERATED}/src/controller_gen.c")
set(OMNI_SCHEMA "${OMNI_GENERATED}/params.toml")
set(OMNI_PARAMS_HEADER "${OMNI_GENERATED}/include/omni/params_gen.h" "${OMNI_GENERATED}/include/omni/modules_gen.h"
                       "${OMNI_GENERATED}/include/omni/input_readings_gen.h" "${OMNI_GENERATED}/include/omni/tick_readings_gen.h"
                       "${OMNI_GENERATED}/include/omni/board_readings_gen.h")
file(GLOB module_headers CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/shared/core/include/omni/*.h")
add_custom_command(
  OUTPUT ${OMNI_GENERATED_SOURCES} ${OMNI_PARAMS_HEADER} "${OMNI_SCHEMA}"
  COMMAND ${generator} --part tables --part schema ${robot_arguments} ${controller_arguments}
  DEPENDS ${generator_sources} ${robot_files} ${module_headers} ${controller_files} "${PROJECT_SOURCE_DIR}/shared/params.toml"
          "${PROJECT_SOURCE_DIR}/shared/world.toml"
  COMMENT "Generating parameter and robot tables"
  VERBATIM)

set(OMNI_WORLD_HEADERS "${OMNI_GENERATED}/include/hil_sim/world_gen.h" "${OMNI_GENERATED}/include/hil_sim/world_members_gen.h"
                       "${OMNI_GENERATED}/world/drivers_gen.h"
                       "${OMNI_GENERATED}/world/plants_gen.h" "${OMNI_GENERATED}/world/plant_sources_gen.h"
                       "${OMNI_GENERATED}/world/sensors_gen.h" "${OMNI_GENERATED}/world/sensor_sources_gen.h"
                       "${OMNI_GENERATED}/include/hil_sim/sensor_members_gen.h" "${OMNI_GENERATED}/world/take_readings_gen.h"
                       "${OMNI_GENERATED}/world/fill_readings_gen.h")
set(OMNI_WORLD_SOURCE "${OMNI_GENERATED}/world/world_gen.c")
add_custom_command(
  OUTPUT ${OMNI_WORLD_HEADERS} "${OMNI_WORLD_SOURCE}"
  COMMAND ${generator} --part world
  DEPENDS ${generator_sources} "${PROJECT_SOURCE_DIR}/shared/world.toml" "${PROJECT_SOURCE_DIR}/shared/params.toml"
  COMMENT "Generating the simulated world's tables"
  VERBATIM)

set(OMNI_MAVLINK_HEADER "${OMNI_GENERATED}/mavlink/omni/mavlink.h")
set(OMNI_PYTHON_DIALECT "${OMNI_GENERATED}/dialects/omni.py")
set(OMNI_PYTHON_TELEMETRY "${OMNI_GENERATED}/python/telemetry_gen.py")
add_custom_command(
  OUTPUT "${OMNI_MAVLINK_HEADER}" "${OMNI_PYTHON_DIALECT}" "${OMNI_PYTHON_TELEMETRY}"
  COMMAND ${generator} --part mavlink-c --part mavlink-python
  DEPENDS ${generator_sources} "${PROJECT_SOURCE_DIR}/shared/link/omni.xml"
          "${PROJECT_SOURCE_DIR}/shared/link/standard.toml" "${PROJECT_SOURCE_DIR}/shared/link/telemetry.toml"
          "${PROJECT_SOURCE_DIR}/shared/world.toml"
  COMMENT "Generating MAVLink dialect"
  VERBATIM)

# Runs in every build; the header changes only if the version or the state of the work tree did.
add_custom_target(
  omni_version
  COMMAND ${generator} --part version
  BYPRODUCTS "${OMNI_GENERATED}/include/omni/version_gen.h"
  COMMENT "Checking version header"
  VERBATIM)
add_custom_target(omni_tables DEPENDS ${OMNI_GENERATED_SOURCES} ${OMNI_PARAMS_HEADER} "${OMNI_SCHEMA}")
add_custom_target(omni_world DEPENDS ${OMNI_WORLD_HEADERS} "${OMNI_WORLD_SOURCE}")
add_custom_target(omni_mavlink ALL DEPENDS "${OMNI_MAVLINK_HEADER}" "${OMNI_PYTHON_DIALECT}"
                                      "${OMNI_PYTHON_TELEMETRY}")

# MAVLink's generated headers, as system headers because they do not compile without warnings.
add_library(omni_mavlink_headers INTERFACE)
target_include_directories(omni_mavlink_headers SYSTEM INTERFACE "${OMNI_GENERATED}/mavlink")
add_dependencies(omni_mavlink_headers omni_mavlink)

# The source comes along: other languages' generators read it.
install(FILES "${OMNI_PYTHON_DIALECT}" "${PROJECT_SOURCE_DIR}/shared/link/omni.xml" DESTINATION omniwheel/dialects)
# The mark lets mypy look for types beside the generated module, too.
install(FILES "${OMNI_PYTHON_TELEMETRY}" "${PROJECT_SOURCE_DIR}/host/omniwheel/py.typed" DESTINATION omniwheel)
install(FILES "${OMNI_SCHEMA}" "${PROJECT_SOURCE_DIR}/shared/world.toml" DESTINATION omniwheel)
install(FILES ${OMNI_ROBOT_FILES} DESTINATION omniwheel/robots)
file(GLOB preset_files CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/shared/presets/*.toml")
install(FILES ${preset_files} DESTINATION omniwheel/presets)

# What `make studio-page` brought from npm goes into a wheel; an editable install finds it in the source.
set(studio_vendor "${PROJECT_SOURCE_DIR}/host/omni/studio/vendor")
if(EXISTS "${studio_vendor}" AND NOT SKBUILD_STATE STREQUAL "editable")
  install(DIRECTORY "${studio_vendor}" DESTINATION omni/studio)
endif()

# What this build was made from and when it began, for `omni` (host/omniwheel/build_record.py). A wheel has no source beside it.
set(record_source "")
set(record_began 0)
if(SKBUILD_STATE STREQUAL "editable")
  set(record_source "${PROJECT_SOURCE_DIR}")
  string(TIMESTAMP record_began "%s")
endif()
file(GLOB controller_source "${OMNI_CONTROLLER_FOLDER}/*.c")
set(record_controller "")
if(OMNI_CONTROLLER AND controller_source)
  get_filename_component(record_controller "${controller_source}" NAME_WE)
endif()
file(WRITE "${OMNI_GENERATED}/build.json" "{\"source\": \"${record_source}\", \"began_s\": ${record_began}, "
     "\"controller\": \"${record_controller}\", \"controller_folder\": \"${OMNI_CONTROLLER_FOLDER}\"}\n")
install(FILES "${OMNI_GENERATED}/build.json" DESTINATION omniwheel)
