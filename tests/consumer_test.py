#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds a program of ten lines with the library, as others do, and runs it.

usage: consumer_test.py WAY SOURCE_FOLDER BUILD_FOLDER CMAKE COMPILER
WAY: find_package or pkg-config, with the library installed into a folder of its own; or
add_subdirectory, which builds it anew.
"""
import os
import subprocess
import sys
import tempfile

WAY, SOURCE, BUILD, CMAKE, COMPILER = sys.argv[1:]
PROGRAM = os.path.join(SOURCE, "samples", "library", "bend.cpp")
MODEL = os.path.join(SOURCE, "samples", "bar.obj")
PROJECT = """cmake_minimum_required(VERSION 3.25)
project(consumer LANGUAGES CXX)
%s
add_executable(bend "%s")
target_link_libraries(bend PRIVATE cellwarp::cellwarp)
"""


def run(*command, **more):
    done = subprocess.run(command, capture_output=True, text=True, **more)
    assert done.returncode == 0, "%s\n%s%s" % (command, done.stdout[-4000:], done.stderr[-4000:])
    return done.stdout


def configured(folder, package, *flags):
    """Exit code of CMake for a project that has the library by this command."""
    os.makedirs(folder, exist_ok=True)
    with open(os.path.join(folder, "CMakeLists.txt"), "w", encoding="utf-8") as file:
        file.write(PROJECT % (package, PROGRAM))
    return subprocess.run([CMAKE, "-S", folder, "-B", os.path.join(folder, "build"), "-G", "Ninja",
                           "-DCMAKE_CXX_COMPILER=" + COMPILER, *flags],
                          capture_output=True, text=True)


def build(folder, package, *flags):
    done = configured(folder, package, *flags)
    assert done.returncode == 0, done.stderr
    run(CMAKE, "--build", os.path.join(folder, "build"), "--target", "bend")
    return os.path.join(folder, "build", "bend")


with tempfile.TemporaryDirectory() as work:
    prefix, own = os.path.join(work, "prefix"), os.path.join(work, "own")
    environment = dict(os.environ)
    if WAY == "add_subdirectory":
        program = build(own, 'add_subdirectory("%s" cellwarp)' % SOURCE, "-DCMAKE_BUILD_TYPE=Release",
                        "-DCELLWARP_WINDOW=OFF", "-DCELLWARP_PICTURE=OFF", "-DCELLWARP_UNITY=ON")
        if not os.path.exists(program):  # programs of cellwarp are all in one folder
            program = os.path.join(own, "build", "cellwarp", "bend")
    else:
        run(CMAKE, "--install", BUILD, "--prefix", prefix, "--component", "library")
        for folder, _, names in os.walk(prefix):
            if "cellwarp.pc" in names:
                environment["PKG_CONFIG_PATH"] = folder
                environment["LD_LIBRARY_PATH"] = os.path.dirname(folder)
    if WAY == "find_package":
        program = build(own, "find_package(cellwarp 0.2 REQUIRED)", "-DCMAKE_PREFIX_PATH=" + prefix)
        for version in ("0.1", "0.3", "1.0"):
            other = configured(os.path.join(work, version), "find_package(cellwarp %s REQUIRED)" % version,
                               "-DCMAKE_PREFIX_PATH=" + prefix)
            assert other.returncode != 0, version + " was found"
            assert "compatible" in other.stderr, other.stderr
    if WAY == "pkg-config":
        program = os.path.join(work, "bend")
        flags = run("pkg-config", "--cflags", "--libs", "cellwarp", env=environment).split()
        run(COMPILER, PROGRAM, "-o", program, *flags)
    result, expected = os.path.join(work, "result.obj"), os.path.join(work, "expected.obj")
    run(program, MODEL, result, env=environment)
    run(os.path.join(BUILD, "cellwarp-bend"), MODEL, expected)
    with open(result, "rb") as one, open(expected, "rb") as other:
        assert one.read() == other.read(), "another result"
