#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks that a project which takes cellwarp in as a part keeps its own settings, build type
and rules to install.

usage: subproject_test.py SOURCE_FOLDER CMAKE COMPILER
"""
import glob
import json
import os
import subprocess
import sys
import tempfile

SOURCE, CMAKE, COMPILER = sys.argv[1:]
PARENT = """cmake_minimum_required(VERSION 3.25)
project(parent LANGUAGES CXX)
function(write_settings file)
  get_cmake_property(names VARIABLES)
  list(FILTER names INCLUDE REGEX "^(CMAKE_(BUILD_TYPE|CXX_FLAGS|CXX_STANDARD|CXX_VISIBILITY|VISIBILITY|POSITION|INSTALL|.*_OUTPUT_DIR).*|BLA_.*)$")
  set(text "")
  foreach(name ${names})
    string(APPEND text "${name}=${${name}}\\n")
  endforeach()
  file(WRITE ${CMAKE_BINARY_DIR}/${file} "${text}")
endfunction()
write_settings(before)
add_subdirectory("%s" cellwarp)
write_settings(after)
add_executable(own own.cpp)
install(TARGETS own)
""" % SOURCE


def text_of(*path):
    with open(os.path.join(*path), encoding="utf-8") as file:
        return file.read()


with tempfile.TemporaryDirectory() as folder:
    build = os.path.join(folder, "build")
    for name, text in (("CMakeLists.txt", PARENT), ("own.cpp", "int main() {}\n")):
        with open(os.path.join(folder, name), "w", encoding="utf-8") as file:
            file.write(text)
    run = subprocess.run(
        [CMAKE, "-S", folder, "-B", build, "-DCMAKE_CXX_COMPILER=" + COMPILER,
         "-DCMAKE_EXPORT_COMPILE_COMMANDS=ON", "-DCELLWARP_WINDOW=OFF", "-DCELLWARP_PICTURE=OFF"],
        capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    before, after = text_of(build, "before"), text_of(build, "after")
    assert before == after, "settings were\n%s\nand are\n%s" % (before, after)
    assert "CMAKE_BUILD_TYPE=\n" in after, after
    commands = {os.path.basename(entry["file"]): entry["command"]
                for entry in json.loads(text_of(build, "compile_commands.json"))}
    assert " -f" not in commands["own.cpp"] and " -O" not in commands["own.cpp"], commands["own.cpp"]
    assert not any(name.endswith("_test.cpp") for name in commands)
    rules = [path for path in glob.glob(os.path.join(build, "**", "cmake_install.cmake"),
                                        recursive=True) if "file(INSTALL" in text_of(path)]
    assert rules == [os.path.join(build, "cmake_install.cmake")], rules
