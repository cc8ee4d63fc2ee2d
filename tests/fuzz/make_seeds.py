#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes small well-formed files for a fuzz target to start from.

usage: make_seeds.py TARGET FOLDER
"""
import base64
import json
import os
import struct
import sys
import zlib

OBJ = b"o a\ng b c\nv 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nvt 0 0\nf 1/1/1 2/1/1 3/1/1\nf -3 -2 \\\n -1\n"
PLY = (b"ply\nformat %s 1.0\ncomment c\nelement vertex 3\nproperty float x\nproperty float y\n"
       b"property float z\nproperty uchar red\nelement face 1\n"
       b"property list uchar int vertex_indices\nend_header\n")
BODY = b"".join(struct.pack("<3fB", *v) for v in ((0, 0, 0, 1), (1, 0, 0, 2), (0, 1, 0, 3)))
BIG = b"".join(struct.pack(">3fB", *v) for v in ((0, 0, 0, 1), (1, 0, 0, 2), (0, 1, 0, 3)))
FACET = (b"facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n"
         b"endfacet\n")
PCD = (b"VERSION .7\nFIELDS x y z rgb normal_x normal_y normal_z _\nSIZE 4 4 4 4 4 4 4 1\n"
       b"TYPE F F F F F F F U\nCOUNT 1 1 1 1 1 1 1 2\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA %s\n")
CLOUD = (0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 2, 0, 0, 1)
CLOUD_COLUMNS = struct.pack("<14f4B", *(CLOUD[k] for i in range(7) for k in (i, i + 7)), 1, 2, 3, 4)
GLTF = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"children": [1], "scale": [2, 1, -1]}, {"mesh": 0, "translation": [1, 2, 3]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": 5}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                       "min": [0, 0, 0], "max": [1, 1, 0]},
                      {"bufferView": 0, "byteOffset": 36, "componentType": 5121, "count": 3,
                       "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteLength": 39}]}
JOINED = b"""{"cellwarp": 1, "rods": [{"name": "a", "through": [[0, 0, 0], [1, 0, 0]], "spans": 2,
    "on": [{"at": "sliding", "point": [0.3, 0, 0], "friction": [0.3, 0.2], "end": "release",
    "inertia": 1, "keys": [{"time": 0}]}, {"at": 1, "rod": "a", "other": "sliding"}]}],
    "bodies": [{"name": "b", "mass": 2, "inertia": [1, 1, 1], "at": [1, 0, 0], "spin": [1, 0, 0]}],
    "nets": [{"name": "n", "points": [[0, 0, 0], [0, 1, 0]], "springs": [[0, 1, 5]], "fixed": [1]}],
    "connections": [{"a": "rod a sliding", "b": "body b 0 0 0", "apart": 0.1, "range": [0.5, 1]},
    {"a": "rod a 0", "b": "net n 0", "what": ["point"]}], "simulate": {"dt": 0.001}}"""
ROPE = json.dumps({
    "cellwarp": 1,
    "rods": [{"name": "a", "through": [[0, 0, 0], [1, 0, 0], [1, 1, 0]], "spans": 2, "radius": [0.01, 0.02],
              "fixed": [{"at": 0, "what": ["point", "tangent", "twist"],
                         "keys": [{"time": 0.1, "translate": [0, 1, 0], "rotate": [0, 0, 1, 30]}]}],
              "on": [{"at": 0.5, "plane": [0, 1, 0, 0]}], "loads": [{"at": 1, "force": [0, 1, 0]}]},
             {"points": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], "closed": True, "spline": "uniform",
              "rest": "straight", "link": 2, "elasticity": "discrete"}],
    "simulate": {"dt": 0.001, "duration": 0.003, "integrator": "midpoint", "viscosity": 0.1}}).encode()
TRIANGLE = struct.pack("<9f3Bx", 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 2)


BVH = b"""HIERARCHY
ROOT a
{
  OFFSET 0 1 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT b
  {
    OFFSET 1 0 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 1 0 0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.1
0 0 0 0 0 0 0 0 0
1 0 0 10 20 30 40 50 60
"""
JOINTS = (b"cellwarp-handles 1\njoint a at 0 0 0 radius 0.1\njoint \"b c\" at 1 0 0 parent a hinge 0 0 1 "
          b"twist -5 100\njoint d at 2 0 0 parent \"b c\" swing 40\nframe 1\nmove a translate 0 1 0 "
          b"rotate 0 0 1 20\nmove d to 1 1 0 from a\nframe 2\nrelease d\n")
BONES = (b'{"cellwarp": 1, "model": "m.obj", "skeleton": {"joints": [{"name": "a", "parent": null, "at": '
         b'[0, 0, 0]}, {"name": "b", "parent": "a", "at": [1, 0, 0], "limits": {"hinge": [0, 0, 1], '
         b'"twist": [0, 90], "swing": 5}}], "keys": [{"time": 0, "joint": "b", "rotate": [0, 0, 1, 5]}, '
         b'{"time": 1, "joint": "a", "translate": [1, 0, 0]}], "interpolation": "squad", "every": 0.1}}')


def skin():
    """Two joints, bound and turned by keys."""
    one = struct.pack("<16f", 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1)
    two = struct.pack("<16f", 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -1, 0, 0, 1)
    body = one + two + struct.pack("<2f", 0, 1) + struct.pack("<8f", 0, 0, 0, 1, 0, 0, 1, 0)
    uri = "data:;base64," + base64.b64encode(body).decode()
    views = [(0, 128), (128, 8), (136, 32)]
    kinds = [(2, "MAT4"), (2, "SCALAR"), (2, "VEC4")]
    return json.dumps({
        "asset": {"version": "2.0"}, "nodes": [{"children": [1]}, {"translation": [1, 0, 0]}],
        "skins": [{"joints": [0, 1], "inverseBindMatrices": 0}],
        "animations": [{"samplers": [{"input": 1, "output": 2, "interpolation": "STEP"}],
                        "channels": [{"sampler": 0, "target": {"node": 1, "path": "rotation"}}]}],
        "accessors": [{"bufferView": k, "componentType": 5126, "count": n, "type": kind}
                      for k, (n, kind) in enumerate(kinds)],
        "bufferViews": [{"buffer": 0, "byteOffset": at, "byteLength": size} for at, size in views],
        "buffers": [{"byteLength": len(body), "uri": uri}]}).encode()


def gltf():
    uri = "data:;base64," + base64.b64encode(TRIANGLE).decode()
    return json.dumps(dict(GLTF, buffers=[{"byteLength": 40, "uri": uri}])).encode()


def glb():
    text = json.dumps(dict(GLTF, buffers=[{"byteLength": 40}])).encode()
    text += b" " * (-len(text) % 4)
    chunks = (struct.pack("<I4s", len(text), b"JSON") + text +
              struct.pack("<I4s", len(TRIANGLE), b"BIN\0") + TRIANGLE)
    return b"glTF" + struct.pack("<2I", 2, 12 + len(chunks)) + chunks


HANDLES = (b"cellwarp-handles 1\nunits relative\nfixed a box 0 0 0 1 1 1\nhandle b sphere 0 0 0 1\n"
           b"pin c indices 1 2-3\nstiff g indices 4 factor 2\nstiff d capsule 0 0 0 1 1 1 0.1 20\nfixed e labels \"x y\" 2\n"
           b"frame 1\nmove b rotate 0 0 1 45 about 0 0 0 translate 0 1 0\nmove c to 0 0 0\ncommit\n"
           b"handle f halfspace 0 0 1 2\nframe 3\nmove f matrix 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n")
RODS = (b"cellwarp-handles 1\nrod a through 0 0 0 1 0 0 1 1 0 closed spans 2 radius 0.1 exact\n"
        b"rod b points 0 0 0 1 0 0 2 0 0 3 0 0 stiffness 2\nrod c from skeleton near \"x y\"\n"
        b"curve d through 0 0 0 1 0 0\npin e indices 1\non e d at 0.5\nframe 1\n"
        b"move a point 1 to 0 0 1 turn 30 tangent 0 1 0\nrelease a start twist\n"
        b"move b end translate 0 0 1\nmove d rotate 0 0 1 3\n")
SCENE = (b'{"cellwarp": 1, "model": "a.obj", "handles": "b", "cells": {"fill": "shell", "across": 3,'
         b'"frame": {"origin": [0,0,0], "axes": [[1,0,0],[0,1,0],[0,0,1]], "size": [1,1,1]}},'
         b'"field": {"release": "rbf"}}')



def journal():
    text = b"about"
    length = struct.pack("<I", len(text))
    data = b"cwjourn\n" + struct.pack("<2I", 1, 7) + length + struct.pack("<I", zlib.crc32(length + text)) + text
    for number, payload in enumerate((b"first", b"", b"third" * 300), 1):
        head = struct.pack("<I", len(payload)), struct.pack("<Q", number)
        data += head[0] + struct.pack("<I", zlib.crc32(b"".join(head) + payload)) + head[1] + payload
    return data


def counted(count, step):
    return bytes(step * i % 256 for i in range(count))


SEEDS = {
    "fuzz_obj": [OBJ, OBJ.replace(b"\n", b"\r\n")],
    "fuzz_ply": [PLY % b"ascii" + b"0 0 0 1\n1 0 0 2\n0 1 0 3\n3 0 1 2\n",
                 PLY % b"binary_little_endian" + BODY + struct.pack("<B3i", 3, 0, 1, 2),
                 PLY % b"binary_big_endian" + BIG + struct.pack(">B3i", 3, 0, 1, 2)],
    "fuzz_stl": [b"solid a\n" + FACET + b"endsolid\n",
                 b"x" * 80 + struct.pack("<I12fH", 1, *range(12), 7)],
    "fuzz_off": [b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
                 b"CNOFF\n3 1 0\n0 0 0 0 0 1 9 9 9 9\n1 0 0 0 0 1\n0 1 0 0 0 1\n3 0 1 2 0.5 0 0\n"],
    "fuzz_pcd": [PCD % b"ascii" + b"0 0 0 1 0 0 1 1 2\n1 0 0 2 0 0 1 3 4\n",
                 PCD % b"binary" + b"".join(struct.pack("<7f2B", *p, 1, 2) for p in (CLOUD[:7], CLOUD[7:])),
                 # Packed as literals: two runs, of 32 bytes and of the rest.
                 PCD % b"binary_compressed" + struct.pack("<2I", 62, 60) + b"\x1f" +
                 CLOUD_COLUMNS[:32] + b"\x1b" + CLOUD_COLUMNS[32:]],
    "fuzz_gltf": [gltf()],
    "fuzz_glb": [glb()],
    "fuzz_xyz": [b"0 0 0 0 0 1\n1 0 0 0 0 1\n", b"//X Y Z R G B\n0 0 0 1 2 3\n", b"1;2;3\n"],
    "fuzz_csv": [b"id,x,y,z,\"na,me\"\n1,0,0,0,\"a,b\"\n2,1,0,0,c\n"],
    "fuzz_session_files": [b"\0" + HANDLES, b"\0" + RODS, b"\0" + JOINTS, b"\1" + SCENE, b"\1" + BONES, b"\2# c\n0\n1\n2\n", b"\0031 3\n0\n-1\n2\n",
                           b"\0030 0\n1 1\n" + struct.pack("<d", 3.0)],
    # A flag, a place, a mask; then the file, or the records to write.
    "fuzz_journal": [b"\0\0\0\0\0" + journal(), b"\0\0\0\0\0" + journal()[:-3],
                     b"\1\x50\0\0\0\x01abcdefgh\0\x40" + bytes(600),
                     b"\1\x50\0\x01\0\x01abcdefgh\0\x40" + bytes(600)],
    "fuzz_skeleton": [b"\0" + b"1 0 0 0\n2 1 0 0\n3 1 1 0\n#\n1 2 1 0 0\n2 3 1 0 0\n", b"\1" + BVH,
                      b"\2" + skin(), b"\3" + glb()],
    # A choice of everything; then samples, leaves to split, motions, what holds each cell.
    "fuzz_solve": [bytes([choice]) + counted(400, 37) for choice in (0, 6, 38, 94, 158, 222)],
    # 0 and the file; else choices.
    "fuzz_rods": [b"\0" + ROPE, b"\0" + JOINED] + [bytes([1]) + counted(80, step) for step in (7, 37, 59, 91)],
    # Scales; then centres with displacements.
    "fuzz_rbf": [bytes([0, 2]) + counted(120, 41), bytes([7, 0]) + counted(200, 59)],
}


def main():
    target, folder = sys.argv[1:3]
    for number, seed in enumerate(SEEDS[target]):
        with open(os.path.join(folder, "seed-%d" % number), "wb") as file:
            file.write(seed)


if __name__ == "__main__":
    main()
