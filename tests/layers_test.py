#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks that scripts/check_layers.py sees what it must see.

usage: layers_test.py SOURCE_FOLDER
"""
import os
import subprocess
import sys
import tempfile

SCRIPT = os.path.join(sys.argv[1], "scripts", "check_layers.py")


def check(files):
    with tempfile.TemporaryDirectory() as root:
        for path, text in files.items():
            full = os.path.join(root, path)
            os.makedirs(os.path.dirname(full), exist_ok=True)
            with open(full, "w") as file:
                file.write(text)
        run = subprocess.run([sys.executable, SCRIPT, root], capture_output=True, text=True)
        return run.returncode, run.stderr


good = {"octree/a.cpp": '#include "octree/a.h"\n', "octree/a.h": "#pragma once\n",
        "tests/CMakeLists.txt": "add_executable(octree_tests\n  octree/a_test.cpp)\n",
        "tests/octree/CMakeLists.txt": "cellwarp_room_tests(octree SLOW\n  A.b\n  Many/A.c/one)\n",
        "tests/octree/a_test.cpp": '#include "octree/wrap/wrap.h"\nTEST(A, b)\nTEST_P(A,\n       c)\n',
        "tests/support/high.h": '#include "library/session/session.h"\n',
        "library/include/cellwarp/a.h": "#include <stop_token>\n#include <cellwarp/export.h>\n",
        "tests/editor/a.cpp": '#include "tests/support/high.h"\n'}
assert check(good)[0] == 0
for path, text, words in (
        ("octree/b.cpp", '#include "solver/cells/glue.h"\n', "may not include solver/cells"),
        ("io/formats/b.cpp", '#include "octree/a.h"\n', "may not include octree"),
        ("solver/cells/b.cpp", '#include "solver/field/rbf.h"\n', "may not include solver/field"),
        ("solver/linear/b.cpp", '#include "octree/a.h"\n', "may not include octree"),
        ("solver/rods/b.cpp", '#include "octree/cells.h"\n', "may not include octree"),
        ("editor/cli/deform.cpp", '#include "solver/rods/spline.h"\n',
         "may not include solver/rods"),
        ("solver/cells/b.cpp", "#include <cholmod.h>\n", "may not include <cholmod.h>"),
        ("octree/b.cpp", "#include <CGAL/Surface_mesh.h>\n", "may not include <CGAL/"),
        ("tests/io/base/b_test.cpp", "", "tests/io/base/b_test.cpp is no part of the tests"),
        ("tests/io/CMakeLists.txt", "cellwarp_room_tests(io SLOW\n  A.d)\n",
         "there is no test A.d"),
        ("tests/octree/b.cpp", '#include "solver/cells/glue.h"\n',
         "tests/octree may not include solver/cells/glue.h"),
        ("tests/octree/b.cpp", '#include "tests/support/high.h"\n',
         "tests/octree may not include tests/support/high.h, which includes library/session"),
        ("octree/b.cpp", '#include "octree/wrap/wrap.h"\n', "names the optional part octree/wrap"),
        ("editor/cli/deform.cpp", '#include "library/picture/picture.h"\n',
         "names the optional part library/picture"),
        ("solver/b.cpp", "#include <vector>\n", "stands in no room"),
        ("library/include/cellwarp/b.h", "#include <Eigen/Core>\n", "the standard library alone"),
        ("library/include/cellwarp/b.h", '#include "library/a.h"\n', "the standard library alone"),
        ("library/session/b.cpp", '#include "utils/x.h"\n', "which is in no room")):
    code, message = check({**good, path: text})
    assert code == 1 and words in message, (path, text, message)
assert check({})[0] == 1
assert subprocess.run([sys.executable, SCRIPT]).returncode == 0
print("ok")
