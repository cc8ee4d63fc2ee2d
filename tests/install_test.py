#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks that programs which were installed under another prefix find their helpers.

usage: install_test.py CMAKE BUILD_FOLDER HAS_IMPORT
"""
import os
import subprocess
import sys
import tempfile

CMAKE, BUILD, HAS_IMPORT = sys.argv[1:]
MODEL = """xof 0303txt 0032
Mesh a {
 3;
 0.0;0.0;0.0;,
 1.0;0.0;0.0;,
 0.0;1.0;0.0;;
 1;
 3;0,1,2;;
}
"""

with tempfile.TemporaryDirectory() as folder:
    subprocess.run([CMAKE, "--install", BUILD, "--prefix", folder], check=True,
                   capture_output=True)
    bin_folder = os.path.join(folder, "bin")
    helpers = {"cellwarp-import", "cellwarp-skeleton"}
    assert "cellwarp" in os.listdir(bin_folder)
    assert not helpers & set(os.listdir(bin_folder)), os.listdir(bin_folder)
    if HAS_IMPORT == "ON":
        model = os.path.join(folder, "model.x")
        with open(model, "w", encoding="utf-8") as file:
            file.write(MODEL)
        run = subprocess.run([os.path.join(bin_folder, "cellwarp"), "info", model],
                             capture_output=True, text=True)
        assert run.returncode == 0, run.stderr
