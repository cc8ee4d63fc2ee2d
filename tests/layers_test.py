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


good = {"octree/a.cpp": '#include "octree/a.h"\n', "octree/a.h": "#pragma once\n"}
assert check(good)[0] == 0
for path, text in (("octree/b.cpp", '#include "solver/cells/glue.h"\n'),
                   ("io/b.cpp", '#include "octree/a.h"\n'),
                   ("solver/b.cpp", '#include "solver/field/rbf.h"\n'),
                   ("solver/b.cpp", "#include <cholmod.h>\n"),
                   ("octree/b.cpp", "#include <CGAL/Surface_mesh.h>\n"),
                   ("octree/b.cpp", '#include "octree/wrap/wrap.h"\n'),
                   ("editor/cli/deform.cpp", '#include "editor/picture/picture.h"\n'),
                   ("editor/session/b.cpp", '#include "utils/x.h"\n')):
    code, message = check({**good, path: text})
    assert code == 1 and message, (path, text)
assert check({})[0] == 1
assert subprocess.run([sys.executable, SCRIPT]).returncode == 0
print("ok")
