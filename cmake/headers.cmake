# SPDX-License-Identifier: GPL-3.0-or-later
# `ninja headers` compiles every header alone: each includes all that it names. Without code in the
# end, so that most of the time is the compiler's look at it.
foreach(room io octree solver library editor tests)
  list(APPEND rooms ${PROJECT_SOURCE_DIR}/${room}/*.h)
endforeach()
file(GLOB_RECURSE headers RELATIVE ${PROJECT_SOURCE_DIR} CONFIGURE_DEPENDS ${rooms})
foreach(header ${headers})
  set(alone ${PROJECT_BINARY_DIR}/headers/${header}.cpp)
  file(CONFIGURE OUTPUT ${alone} CONTENT "#include \"${header}\"\n")
  list(APPEND sources ${alone})
endforeach()
add_library(headers OBJECT EXCLUDE_FROM_ALL ${sources})
target_compile_features(headers PRIVATE cxx_std_20)
target_include_directories(headers PRIVATE ${PROJECT_SOURCE_DIR}
  $<TARGET_PROPERTY:cellwarp_shared,INTERFACE_INCLUDE_DIRECTORIES>)
target_include_directories(headers SYSTEM PRIVATE ${CHOLMOD_INCLUDE} ${IMGUI_INCLUDE})
target_link_libraries(headers PRIVATE Eigen3::Eigen fmt::fmt nlohmann_json::nlohmann_json CLI11::CLI11)
target_compile_options(headers PRIVATE -O0 -Wall -Wextra $<$<BOOL:${CELLWARP_STRICT}>:-Werror>)
