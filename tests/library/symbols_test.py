#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compares the names that the shared library shows with the list of its interface.

usage: symbols_test.py NM LIBRARY LIST        exit 1 and a line for each difference
       symbols_test.py NM LIBRARY LIST --write
"""
import subprocess
import sys

NM, LIBRARY, LIST = sys.argv[1:4]
HEAD = "# Names that libcellwarp shows, made by tests/library/symbols_test.py --write.\n"


def shown():
    lines = subprocess.run([NM, "-DC", "--defined-only", LIBRARY], check=True,
                           capture_output=True, text=True).stdout.splitlines()
    # Address, kind, name. A name may have several addresses: of one constructor two.
    return sorted({line.split(None, 2)[2] for line in lines})


names = shown()
if sys.argv[4:] == ["--write"]:
    with open(LIST, "w", encoding="utf-8") as file:
        file.write(HEAD + "".join(name + "\n" for name in names))
    sys.exit(0)
with open(LIST, encoding="utf-8") as file:
    listed = [line for line in file.read().splitlines() if not line.startswith("#")]
for name in sorted(set(names) - set(listed)):
    print("is new:     " + name)
for name in sorted(set(listed) - set(names)):
    print("is missing: " + name)
foreign = [name for name in names if not name.startswith(("cellwarp::", "typeinfo", "vtable"))
           or "cellwarp::core" in name.split("(")[0]]
for name in foreign:
    print("is no part of the interface: " + name)
sys.exit(1 if names != listed or foreign else 0)
