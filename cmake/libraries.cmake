# SPDX-License-Identifier: GPL-3.0-or-later
# The libraries, each with the room that it is for; scripts/check_layers.py keeps them there.
find_package(Eigen3 3.4 REQUIRED)
find_package(fmt 9 REQUIRED)
find_package(nlohmann_json 3.11 REQUIRED)
find_package(CLI11 2.1 REQUIRED)
find_package(ZLIB REQUIRED)                                             # io
find_path(LZF_INCLUDE lzf.h PATH_SUFFIXES liblzf REQUIRED)              # io
find_library(LZF_LIBRARY lzf REQUIRED)
find_package(draco 1.5 REQUIRED)                                        # io
find_package(meshoptimizer REQUIRED)                                    # io
find_package(TBB REQUIRED)                                              # octree/base
find_package(nanoflann REQUIRED)                                        # octree/base
find_path(XXHASH_INCLUDE xxhash.h REQUIRED)                             # octree/base
find_library(XXHASH_LIBRARY xxhash REQUIRED)
set(BLA_VENDOR OpenBLAS)  # one BLAS thread is set by its own call
find_package(BLAS REQUIRED)                                             # solver/linear
find_package(LAPACK REQUIRED)                                           # solver/field
find_path(CHOLMOD_INCLUDE cholmod.h PATH_SUFFIXES suitesparse REQUIRED) # solver/linear
find_library(CHOLMOD_LIBRARY cholmod REQUIRED)
if(CELLWARP_IMPORT)
  find_package(assimp 5.2 REQUIRED)                                     # io/import
endif()
if(CELLWARP_CGAL OR CELLWARP_BENCH)
  find_package(CGAL 5.5 REQUIRED)                                       # octree/wrap
endif()
if(CELLWARP_WINDOW OR CELLWARP_PICTURE)
  find_package(embree 3.13 QUIET)                                       # library/picture
  if(NOT embree_FOUND)
    find_package(embree 4 REQUIRED)  # Debian 13, Ubuntu 24.04
  endif()
endif()
if(CELLWARP_WINDOW)                                                     # editor/window
  find_package(glfw3 3.3 REQUIRED)
  find_package(OpenGL REQUIRED)
  find_path(IMGUI_INCLUDE imgui.h PATH_SUFFIXES imgui REQUIRED)
  find_library(IMGUI_LIBRARY imgui REQUIRED)
  find_library(STB_LIBRARY stb REQUIRED)  # Debian's imgui needs it
endif()
if(CELLWARP_MPI)
  find_package(MPI REQUIRED COMPONENTS CXX)                             # editor/mpi
endif()
if(CELLWARP_TESTS)
  find_package(GTest 1.12 REQUIRED)
  find_package(Python3 REQUIRED COMPONENTS Interpreter)
endif()
if(CELLWARP_BENCH)
  find_package(benchmark 1.7 REQUIRED)
endif()
