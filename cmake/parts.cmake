# SPDX-License-Identifier: GPL-3.0-or-later
# What every part of the program is built with.

# A room: a static library cellwarp::NAME from the files named.
function(cellwarp_part name)
  add_library(cellwarp_${name} STATIC ${ARGN})
  add_library(cellwarp::${name} ALIAS cellwarp_${name})
  target_link_libraries(cellwarp_${name} PUBLIC Eigen3::Eigen)
  cellwarp_compile(cellwarp_${name})
  set_target_properties(cellwarp_${name} PROPERTIES
    UNITY_BUILD ${CELLWARP_UNITY} UNITY_BUILD_BATCH_SIZE 8)
  if(CELLWARP_UNITY)
    # What is local to a file is taken for what a header would hand to others.
    target_compile_options(cellwarp_${name} PRIVATE
      $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
  endif()
endfunction()

# Inner loops of a part, compiled for each instruction set; which one runs is chosen at run
# time (octree/base/instruction_set.h).
function(cellwarp_lanes part)
  cellwarp_lanes_for(${part} plain "" ${ARGN})
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
    cellwarp_lanes_for(${part} avx2 -mavx2 ${ARGN})
    cellwarp_lanes_for(${part} avx512 -mavx512f ${ARGN})
  endif()
endfunction()

function(cellwarp_lanes_for part set option)
  set(name cellwarp_${part}_${set})
  add_library(${name} OBJECT ${ARGN})
  target_compile_definitions(${name} PRIVATE CELLWARP_LANES_FOR=${set})
  cellwarp_compile(${name})
  target_compile_options(${name} PRIVATE -fno-math-errno ${option})
  target_sources(cellwarp_${part} PRIVATE $<TARGET_OBJECTS:${name}>)
endfunction()

function(cellwarp_program name)
  add_executable(${name} ${ARGN})
  target_compile_definitions(${name} PRIVATE CELLWARP_VERSION="${CELLWARP_VERSION_TEXT}")
  cellwarp_compile(${name})
  if(CELLWARP_INSTALL)
    install(TARGETS ${name})
  endif()
endfunction()

# A program that only others start (octree/base/helper.h).
function(cellwarp_helper name)
  add_executable(${name} ${ARGN})
  cellwarp_compile(${name})
  if(CELLWARP_INSTALL)
    install(TARGETS ${name} DESTINATION ${CMAKE_INSTALL_LIBEXECDIR}/cellwarp)
  endif()
endfunction()

function(cellwarp_compile target)
  target_compile_features(${target} PUBLIC cxx_std_20)
  target_include_directories(${target} PUBLIC ${PROJECT_SOURCE_DIR})
  # No contraction: the same sum gives the same bits in every function.
  # -Wno-restrict: gcc 12 sees overlaps inside std::string that are none.
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wshadow -ffp-contract=off
    $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict> -fstack-protector-strong $<$<BOOL:${CELLWARP_STRICT}>:-Werror>)
  target_compile_definitions(${target} PRIVATE
    $<$<CONFIG:Release,RelWithDebInfo,MinSizeRel>:_FORTIFY_SOURCE=2> _GLIBCXX_ASSERTIONS)
  target_link_options(${target} PRIVATE LINKER:-z,relro,-z,now)
  if(CELLWARP_SANITIZE)
    # clang has no macros that say so.
    target_compile_definitions(${target} PRIVATE CELLWARP_SANITIZED)
    if(CELLWARP_SANITIZE STREQUAL "thread")
      target_compile_definitions(${target} PRIVATE CELLWARP_SANITIZED_THREAD)
    endif()
    # Lines for reports, and half the time to compile.
    target_compile_options(${target} PRIVATE -O1 -g1 -fsanitize=${CELLWARP_SANITIZE}
      -fno-sanitize-recover=all -fno-omit-frame-pointer)
    target_link_options(${target} PUBLIC -fsanitize=${CELLWARP_SANITIZE})
  endif()
  if(CELLWARP_FUZZ)
    target_compile_options(${target} PRIVATE -g -fno-omit-frame-pointer
      -fsanitize=fuzzer-no-link,address,undefined -fno-sanitize-recover=all)
    # Sanitizers keep clang from inlining; numbers that are compared in a solver lead to no
    # new input, and tracing them takes most of its time.
    if("${CMAKE_CURRENT_SOURCE_DIR}" MATCHES "/solver/")
      target_compile_options(${target} PRIVATE -fno-sanitize-coverage=trace-cmp
        -mllvm -inline-threshold=2000)
    endif()
  endif()
endfunction()
