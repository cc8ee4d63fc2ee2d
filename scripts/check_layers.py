#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks the arrows between the rooms and from their tests, that every library keeps to its
place, that every test is built, and that those that are labelled slow exist.

usage: check_layers.py [ROOT]     exit 1 and a line for each include that is not allowed
"""
import os
import re
import sys

# Room -> rooms that it may include. The longest prefix of a path is its room.
ROOMS = {
    "io/base": {"io/base"},
    "io/formats": {"io/formats", "io/import", "io/base"},
    "io/import": {"io/import", "io/formats", "io/base", "octree/base"},
    "io/scene": {"io/scene", "io/formats", "io/base", "octree/base"},
    "io/journal": {"io/journal", "io/base"},
    "octree/base": {"octree/base"},
    "octree": {"octree", "octree/wrap", "octree/base"},
    "octree/wrap": {"octree/wrap", "octree", "octree/base"},
    "solver/linear": {"solver/linear", "octree/base"},
    "solver/dynamics": {"solver/dynamics", "solver/linear", "octree/base"},
    "solver/rods": {"solver/rods", "solver/dynamics", "solver/linear", "octree/base"},
    "solver/contact": {"solver/contact", "solver/rods", "solver/dynamics",
                       "solver/linear", "octree/wrap", "octree/base"},
    "solver/skeleton": {"solver/skeleton", "octree/base"},
    "solver/flesh": {"solver/flesh", "solver/linear", "octree", "octree/base"},
    "solver/joined": {"solver/joined", "solver/flesh", "solver/dynamics", "solver/linear",
                      "octree/base"},
    "solver/minimize": {"solver/minimize", "solver/linear", "octree/base"},
    "solver/cells": {"solver/cells", "solver/minimize", "solver/linear", "octree",
                     "octree/base"},
    "solver/coupled": {"solver/coupled", "solver/cells", "solver/rods", "solver/minimize",
                       "solver/linear", "octree/base"},
    "solver/field": {"solver/field", "solver/cells", "solver/linear", "octree",
                     "octree/base"},
    "library/session": {"library/session", "io/scene", "io/formats", "io/base", "octree",
                        "octree/base", "solver/minimize", "solver/linear", "solver/dynamics",
                        "solver/rods", "solver/coupled", "solver/skeleton", "solver/cells",
                        "solver/field"},
    "library/time": {"library/time", "library/session", "io/scene", "io/formats", "io/base",
                     "octree", "octree/base", "solver/joined", "solver/flesh",
                     "solver/skeleton", "solver/contact", "solver/rods", "solver/dynamics",
                     "solver/cells", "solver/field"},
    "library/stream": {"library/stream", "library/session", "io/scene", "io/formats",
                       "io/base", "octree/base"},
    "library/study": {"library/study", "library/session", "io/scene", "io/formats",
                      "io/base", "octree", "octree/base", "solver/minimize",
                      "solver/cells", "solver/field"},
    "library/picture": {"library/picture", "library/session", "io/scene", "io/formats",
                        "io/base", "octree", "octree/base", "solver/cells",
                        "solver/field"},
    "library": {"library", "library/study", "library/stream", "library/time",
                "library/session", "io/scene", "io/formats", "io/base", "octree",
                "octree/base", "solver/minimize", "solver/cells", "solver/field"},
    "editor/process": {"editor/process", "library/session", "io/base", "solver/linear"},
    "editor/cli": {"editor/cli", "editor/process", "library/time", "library/picture",
                   "library/stream", "library/study", "library/session", "io/scene",
                   "io/formats", "io/base", "octree", "octree/base", "solver/minimize",
                   "solver/linear", "solver/cells", "solver/flesh"},
    "editor/document": {"editor/document", "library/session", "io/journal", "io/scene",
                        "io/formats", "io/base", "octree", "octree/base",
                        "solver/minimize", "solver/cells", "solver/field"},
    "editor/tools": {"editor/tools", "editor/document", "library/picture",
                     "library/session", "io/scene", "io/formats", "io/base", "octree",
                     "octree/base", "solver/cells"},
    "editor/window": {"editor/window", "editor/tools", "editor/document",
                      "editor/process", "library/time", "library/picture",
                      "library/session", "io/scene", "io/formats", "io/base", "octree",
                      "octree/base", "solver/linear", "solver/cells", "solver/field"},
    "editor/mpi": {"editor/mpi", "library/session", "io/scene", "io/formats", "io/base",
                   "octree/base"},
}
# Tests -> rooms that they may include, with all those that these stand on.
TESTS = {
    "tests/io": {"io"},
    "tests/octree": {"octree", "io/formats"},  # some models are read from files
    "tests/solver": {"solver"},
    "tests/library": {"library"},
    "tests/editor": {"editor"},
    "tests/bench": {"library"},
    "tests/fuzz": {"library", "io/journal"},
    "tests/support": {"library"},
}
# Third-party header -> the files or rooms that may include it.
LIBRARIES = {
    "cholmod.h": {"solver/linear/cholesky.cpp"},
    "lapacke.h": {"solver/field/rbf.cpp"},
    "tbb/": {"octree/base/parallel.cpp", "octree/base/thread_share.cpp"},
    "xxhash.h": {"octree/base/hash.cpp"},
    "nanoflann.hpp": {"octree/base/point_tree.cpp"},
    "assimp/": {"io/import"},
    "embree3/": {"library/picture/ray_tree.cpp"},
    "embree4/": {"library/picture/ray_tree.cpp"},
    "stb/": {"library/picture/image.cpp", "library/picture/lettering.cpp"},
    "CLI/": {"editor/cli", "editor/mpi", "editor/window", "tests/bench"},
    "GLFW/": {"editor/window"},
    "imgui": {"editor/window"},
    "backends/imgui": {"editor/window"},
    "GL/": {"editor/window"},
    "mpi.h": {"editor/mpi"},
    "zlib.h": {"io/base/checksum.cpp"},
    "lzf.h": {"io/base/lzf.cpp"},
    "draco/": {"io/formats/draco_mesh.cpp", "tests"},
    "meshoptimizer.h": {"io/formats/meshopt_view.cpp", "tests"},
    "nlohmann/": {"io/scene/json_object.h", "io/scene/scene_file.cpp", "io/formats/gltf_json.h", "io/formats/gltf_rebuild.cpp", "io/formats/animation_file.cpp", "io/scene/skinned_file.cpp", "library/session/json.h", "editor/cli", "editor/document/edit_text.cpp",
                  "editor/window", "tests"},
    "gtest/": {"tests"},
    "benchmark/": {"tests/bench"},
    "gmp.h": {"editor/process/exact_numbers.cpp", "tests"},
    "CGAL/": {"octree/wrap/wrap.cpp", "octree/wrap/side.cpp", "octree/wrap/triangle_pair.cpp",
              "octree/wrap/triangle_tree.cpp",
              "octree/wrap/skeleton_main.cpp",
              "tests/bench/arap_peer.cpp", "tests/bench/edits_peer.cpp",
              "tests/bench/tet_fill.cpp"},
}
# Optional parts may be named only here, outside their own room.
OPTIONAL = {"library/picture": {"editor/cli/render.cpp", "editor/tools", "editor/window"},
            "io/import": {"io/formats/geometry_file.cpp"},
            "octree/wrap": {"octree/winding.cpp", "octree/curve_graph.h",
                            "octree/closed_surface.cpp", "octree/curve_graph.cpp",
                            "octree/self_intersections.cpp",
                            "solver/contact/obstacle.cpp"}}

# Headers that other programs include.
PUBLIC = "library/include/"

INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]', re.M)


def below(tops):
    """The rooms of these names or in these folders, and all that they stand on."""
    found, left = set(), [r for r in ROOMS for top in tops if (r + "/").startswith(top + "/")]
    while left:
        room = left.pop()
        if room not in found:
            found.add(room)
            left += ROOMS[room]
    return found


ALLOWED = {**ROOMS, **{tests: below(tops) | {tests, "tests/support"}
                       for tests, tops in TESTS.items()}}


def room_of(path):
    rooms = [r for r in ALLOWED if path.startswith(r + "/")]
    return max(rooms, key=len) if rooms else None


def included_by(root, header, seen):
    """What a header of tests/support includes, and what those of them that it includes do."""
    path = os.path.join(root, header)
    if header in seen or not os.path.exists(path):
        return
    seen.add(header)
    with open(path, encoding="utf-8") as file:
        names = INCLUDE.findall(file.read())
    for mark, name in names:
        if mark == '"':
            yield name
            if name.startswith("tests/support/"):
                yield from included_by(root, name, seen)


def problems_of(root, path, text):
    room = room_of(path)
    if room is None:
        yield "%s stands in no room" % path
        return
    for mark, name in INCLUDE.findall(text):
        target = room_of(name) if mark == '"' else None
        if mark == '"' and target is None:
            yield "%s includes \"%s\", which is in no room" % (path, name)
        elif target and target not in ALLOWED[room]:
            yield "%s may not include %s" % (room, name)
        elif target == "tests/support":
            for further in included_by(root, name, set()):
                if room_of(further) not in ALLOWED[room]:
                    yield "%s may not include %s, which includes %s" % (room, name, further)
        for optional, allowed in OPTIONAL.items():
            if target == optional and room != optional and room not in TESTS and not any(
                    path == p or path.startswith(p + "/") for p in allowed):
                yield "%s names the optional part %s" % (path, optional)
        if path.startswith(PUBLIC) and (
                mark == '"' or not re.fullmatch(r"[a-z_]+|cellwarp/[a-z_]+\.h", name)):
            yield "%s may include the standard library alone, not %s" % (path, name)
        for library, places in LIBRARIES.items():
            if mark == "<" and name.startswith(library) and not any(
                    path == p or path.startswith(p + "/") for p in places):
                yield "%s may not include <%s>" % (path, name)


def problems_of_tests(root):
    """Test files that the build does not name, and slow tests that it names and are none."""
    built, slow, files, tests = set(), [], [], set()
    for folder, _, names in os.walk(os.path.join(root, "tests")):
        for name in sorted(names):
            path = os.path.join(folder, name)
            if name == "CMakeLists.txt":
                with open(path, encoding="utf-8") as file:
                    text = file.read()
                built |= {os.path.normpath(os.path.join(folder, source))
                          for source in re.findall(r"[\w./]+\.cpp", text)}
                # As CTest has them: Suite.test, or Many/Suite.test/one of values.
                slow += re.findall(r"^\s+(?:\w+/)?([A-Z]\w*)\.([a-z]\w*)(?:/\w+)?\)?$", text, re.M)
            elif name.endswith("_test.cpp"):
                files.append(path)
                with open(path, encoding="utf-8") as file:
                    tests |= set(re.findall(r"^TEST(?:_[FP])?\((\w+),\s*(\w+)\)", file.read(), re.M))
    for path in files:
        if os.path.normpath(path) not in built:
            yield "%s is no part of the tests" % os.path.relpath(path, root).replace(os.sep, "/")
    for suite, test in slow:
        if (suite, test) not in tests:
            yield "there is no test %s.%s that could be slow" % (suite, test)


def main():
    root = sys.argv[1] if len(sys.argv) > 1 else os.path.join(
        os.path.dirname(os.path.abspath(__file__)), "..")
    problems, count = [], 0
    for top in ("io", "octree", "solver", "library", "editor", "tests"):
        for folder, _, names in os.walk(os.path.join(root, top)):
            for name in sorted(names):
                if not name.endswith((".h", ".cpp")):
                    continue
                path = os.path.relpath(os.path.join(folder, name), root).replace(os.sep, "/")
                with open(os.path.join(folder, name), encoding="utf-8") as file:
                    problems += problems_of(root, path, file.read())
                count += 1
    problems += problems_of_tests(root)
    for problem in problems:
        print(problem, file=sys.stderr)
    if count == 0:
        print("no source file found", file=sys.stderr)
    sys.exit(1 if problems or count == 0 else 0)


if __name__ == "__main__":
    main()
