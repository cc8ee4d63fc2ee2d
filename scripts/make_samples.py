#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the sample models and their scenes from formulas.

usage: make_samples.py [FOLDER [NAME...]]
       (default: all, into samples/ beside this script's folder)

bar       a closed box, 1 x 1 x 4, twisted by 135 degrees
plate     a closed slab with bumps and normals; one edge is bent up
block     a cube; a knob is pulled out of its top, the rest hardly moves
creature  a smooth closed body with limbs, a head, ears and a tail; two frames
vase      an open shell of revolution; its rim is tilted and pulled
cloud     points with colours on a torus, no faces; one side is turned and lifted
hand      five fingers 1 % of the diagonal apart; three are bent
touch     the same hand; a finger leans on its neighbour, which leans on the next one
coil      a spring whose turns are 1 % apart; it is pulled up and tilted
chain     links that do not touch; one is bent
figure    a flat drawing that waves; nothing of it leaves its plane
soup      thousands of loose triangles in random order; a knot is pulled open
hose      a straight hose; a rod in it goes through eight points
ring      a ring that slides along a bent bar by three of its points
posed     scenes of the creature with rods: spine (bent and twisted), tail (curled);
          and of the bar: batten (a stiff rod that pushes back)
skeletons  an arm (two bones, bent by 90 and 120 degrees), and scenes with bones: walk (the
          creature, by keys), fingers (the hand), wave (the creature, by a BVH file that is
          made here as well), reach (the creature's hands and feet go to places); pull (the arm
          without bones, by a hand that finds its turn)
scan      a cloud with holes and noise, seen from three places; the creature bows
flesh     scenes for simulate whose flesh follows a skeleton, into flesh/: limb (bones on the
          edges of a lattice that is drawn), limb_halved, elbow (120 degrees), walk, belly, tail, and spin
          and spin_free (with and without the tube that holds flesh to its bone); joint_*
          (by law), press, flop, pulled, detail and drag (cells that are halved), rope and
          suture (with rods), reach (inverse kinematics)
carried   scenes for simulate whose rods carry a model, into rods/: tentacle, hung, stitch
rods      scenes for simulate, into rods/: cantilever, cable, pendulum, ring, stick, six, free,
          four, short, bundle, hole, thread, lace, suture, slipknot, swing, net, necklace,
          cut, knot, knot_fixed, pile, intestine, drape, patch, block,
          seam
"""
import json
import math
import os
import random
import struct
import sys


def write(folder, name, text):
    data = text if isinstance(text, bytes) else text.encode()
    with open(os.path.join(folder, name), "wb") as file:
        file.write(data)


def obj(points, faces, comment):
    lines = ["# " + comment]
    lines += ["v %.6g %.6g %.6g" % tuple(p) for p in points]
    lines += ["f " + " ".join(str(i + 1) for i in face) for face in faces]
    return "\n".join(lines) + "\n"


def scene(folder, name, model, handles, extra=""):
    write(folder, name + ".handles", handles)
    write(folder, name + ".json",
          '{\n  "cellwarp": 1,\n  "model": "%s",\n  "handles": "%s.handles"%s\n}\n'
          % (model, name, extra))


def grid_box(counts, place):
    """Quads of a closed box surface; place maps grid numbers to a point."""
    numbers, points, faces = {}, [], []

    def vertex(i, j, k):
        if (i, j, k) not in numbers:
            numbers[i, j, k] = len(points)
            points.append(place(i, j, k))
        return numbers[i, j, k]

    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, counts[axis]):
            for a in range(counts[u]):
                for b in range(counts[v]):
                    quad = []
                    for da, db in ((0, 0), (1, 0), (1, 1), (0, 1)):
                        at = [0, 0, 0]
                        at[axis], at[u], at[v] = side, a + da, b + db
                        quad.append(vertex(*at))
                    faces.append(quad if side else quad[::-1])
    return points, faces


def check_closed(faces):
    """Every edge has exactly two, opposite faces."""
    edges = set()
    for face in faces:
        for edge in zip(face, face[1:] + face[:1]):
            assert edge not in edges, "an edge has two faces of one direction"
            edges.add(edge)
    assert all((b, a) in edges for a, b in edges), "an edge has one face"


def bar(folder):
    points, faces = grid_box((16, 16, 64),
                             lambda i, j, k: (i / 16 - 0.5, j / 16 - 0.5, k / 16))
    write(folder, "bar.obj", obj(points, faces, "closed box, 1 x 1 x 4"))
    scene(folder, "bar", "bar.obj", """cellwarp-handles 1
# The far end turns by 135 degrees about the bar's axis.
fixed  foot  box -1 -1 -1  1 1 0.25
handle head  box -1 -1 3.75  1 1 5
frame 1
move head rotate 0 0 1 135
""")


def block(folder):
    points, faces = grid_box((24, 24, 24), lambda i, j, k: (i / 24, j / 24, k / 24))
    write(folder, "block.obj", obj(points, faces, "closed cube, 1 x 1 x 1"))
    scene(folder, "block", "block.obj", """cellwarp-handles 1
# A small knob is pulled out of the top: an edit that asks for small cells in one place.
fixed  base  box -1 -1 -1  2 2 0.1
handle knob  sphere 0.5 0.5 1  0.1
frame 1
move knob translate 0 0 0.25
""", ',\n  "cells": {"across": 7, "max_depth": 3}')


def plate(folder):
    def height(x, y):
        return 0.06 + 0.03 * math.sin(9 * x) * math.sin(9 * y) + \
            0.05 * math.exp(-40 * ((x - 1.0) ** 2 + (y - 0.5) ** 2))

    nx, ny, nz = 120, 60, 3
    points, faces = grid_box((nx, ny, nz), lambda i, j, k:
                             (2 * i / nx, j / ny, height(2 * i / nx, j / ny) * k / nz))
    normals = [[0.0, 0.0, 0.0] for _ in points]
    for face in faces:
        a, b, c = (points[face[k]] for k in (0, 1, 2))
        u = [b[k] - a[k] for k in range(3)]
        v = [c[k] - a[k] for k in range(3)]
        n = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
        for corner in face:
            for k in range(3):
                normals[corner][k] += n[k]
    head = """ply
format binary_little_endian 1.0
comment a slab with bumps
element vertex %d
property float x
property float y
property float z
property float nx
property float ny
property float nz
element face %d
property list uchar int vertex_indices
end_header
""" % (len(points), len(faces))
    data = head.encode()
    for p, n in zip(points, normals):
        length = math.sqrt(sum(x * x for x in n))
        data += struct.pack("<6f", *p, *(x / length for x in n))
    for face in faces:
        data += struct.pack("<B4i", 4, *face)
    write(folder, "plate.ply", data)
    scene(folder, "plate", "plate.ply", """cellwarp-handles 1
# One edge is bent up and over by a quarter turn.
fixed  left   box -1 -1 -1  0.2 2 1
handle right  box 1.8 -1 -1  3 2 1
frame 1
move right rotate 0 1 0 -90 about 1.25 0.5 0.05  translate -0.25 0 0.55
""")


def smooth_union(distances, k):
    """Smooth minimum: exp-weighted, so that the order does not matter."""
    least = min(distances)
    return least - k * math.log(sum(math.exp((least - d) / k) for d in distances))


def capsule(p, a, b, ra, rb):
    ab = [b[k] - a[k] for k in range(3)]
    ap = [p[k] - a[k] for k in range(3)]
    t = sum(x * y for x, y in zip(ap, ab)) / max(1e-12, sum(x * x for x in ab))
    t = min(1.0, max(0.0, t))
    return math.dist(p, [a[k] + t * ab[k] for k in range(3)]) - (ra + t * (rb - ra))


def hose(folder, rings=121, around=24, name="hose"):
    """Straight; a rod in its axis poses it through eight points."""
    path = [(0.0, 0.0, 8.0 * i / (rings - 1)) for i in range(rings)]
    points, faces = tube(path, 0.3, around)
    check_closed(faces)
    write(folder, name + ".obj", obj(points, faces, "a hose, 8 long, straight"))
    rest = " ".join(" 0 0 %g" % (8.0 * k / 7) for k in range(8))
    # Of about the same length as at rest, from point to point.
    way = [(0, 0, 0), (0, 0.1, 1.1), (0.1, 0.9, 1.85), (0.45, 1.9, 1.6), (1.2, 2.15, 0.8),
           (1.9, 1.5, 0.25), (2.7, 0.8, 0.6), (3.1, 0.6, 1.7)]
    moves = "\n".join("move hose point %d to %g %g %g" % ((k,) + p)
                      for k, p in enumerate(way) if k)
    scene(folder, name, name + ".obj", """cellwarp-handles 1
# A rod in the hose's axis goes through eight points; its far end turns as it likes.
rod hose through%s
frame 1
%s
release hose end tangent twist
""" % (rest, moves))


def ring(folder):
    """A bent bar, and a ring that three of its inner points keep on it."""
    big, wire, hole, thick = 1.5, 0.2, 0.24, 0.1

    def on_bar(angle, off=0.0, turn=0.0):
        a = math.radians(angle)
        r = big + off * math.cos(turn)
        return [r * math.cos(a), r * math.sin(a), off * math.sin(turn)]

    points, faces = tube([on_bar(0.9 * i) for i in range(101)], wire, 16)
    start, rows, around, first = 12.0, 36, 16, len(points)
    for i in range(rows):
        turn = 2 * math.pi * i / rows
        for j in range(around):
            phi = 2 * math.pi * j / around
            off = hole + thick * (1 - math.cos(phi))
            points.append(on_bar(start + math.degrees(thick * math.sin(phi) / big), off, turn))
    for i in range(rows):
        for j in range(around):
            k, l = (i + 1) % rows, (j + 1) % around
            faces.append([first + i * around + j, first + k * around + j,
                          first + k * around + l, first + i * around + l])
    check_closed(faces)
    write(folder, "ring.obj", obj(points, faces, "a bent bar with a ring around it"))
    lines = ["cellwarp-handles 1",
             "# Three inner points of the ring slide along the bar; a fourth, outside, is",
             "# led: the ring follows, and stays around the bar.",
             "fixed bar indices 0-%d" % (first - 1)]
    for n in range(3):
        turn = 2 * math.pi * n / 3
        lines.append("pin inner%d indices %d" % (n, first + n * (rows // 3) * around))
        lines.append("curve rail%d through" % n + " ".join(
            "  %.6g %.6g %.6g" % tuple(on_bar(a, hole, turn)) for a in (2, 12, 30, 45, 60, 75, 88)))
    outer = first + (rows // 4) * around + around // 2
    lines.append("pin grip indices %d" % outer)
    lines += ["on inner%d rail%d" % (n, n) for n in range(3)]
    for n, angle in enumerate((40, 70)):
        lines.append("frame %d" % (n + 1))
        lines.append("move grip to %.6g %.6g %.6g"
                     % tuple(on_bar(angle, hole + 2 * thick, math.pi / 2)))
    scene(folder, "ring", "ring.obj", "\n".join(lines) + "\n",
          ',\n  "cells": {"gap": 0.006}')


def posed(folder):
    """The creature again, bent by rods."""
    scene(folder, "spine", "creature.obj", """cellwarp-handles 1
# A rod through the spine, bent aside and twisted; the legs stay.
fixed legs  box -2 -1 -1  2 0.62 0.6
rod   spine through 0 0.85 0  0 1.2 0  0 1.55 0  0 1.9 0.03  0 2.2 0.05  radius 0.1
frame 1
move spine end translate 0.75 -0.2 0.05  tangent 0.8 0.55 0.1  turn 50
frame 2
move spine end translate -0.45 -0.45 0.75  tangent -0.4 0.45 0.8  turn -35
""")
    scene(folder, "tail", "creature.obj", """cellwarp-handles 1
# Four points of the tail, and what lies between finds its place.
fixed body box -2 -1 -0.32  2 3 2
rod   tail through 0 0.78 -0.25  0 0.6 -0.52  0 0.58 -0.7  0 0.66 -0.87  0 0.75 -1.05  radius 0.03
frame 1
move tail point 1 to 0 0.72 -0.55
move tail point 2 to 0 0.85 -0.7
move tail point 3 to 0 1.04 -0.68
move tail point 4 to 0 1.12 -0.5
release tail end tangent twist
""")
    scene(folder, "batten", "bar.obj", """cellwarp-handles 1
# A stiff rod in the lower half of a bar that is bent: nothing but the cells holds it, and it stays straight.
fixed  foot   box -1 -1 -1  1 1 0.15
handle head   box -1 -1 3.85  1 1 5
rod    batten through 0 0 0.5  0 0 2.2  radius 0.15 stiffness 3000
frame 1
move head rotate 1 0 0 -90 about 0 0.546 2
release batten start
release batten end
""")


def quaternion(axis, degrees):
    size = math.sqrt(sum(x * x for x in axis))
    half = math.radians(degrees) / 2.0
    return (math.cos(half),) + tuple(math.sin(half) * x / size for x in axis)


def turned(*turns):
    """Rotations after each other, the first one first, as axis and degrees."""
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    for axis, degrees in turns:
        a, b, c, d = quaternion(axis, degrees)
        w, x, y, z = (a * w - b * x - c * y - d * z, a * x + b * w + c * z - d * y,
                      a * y - b * z + c * w + d * x, a * z + b * y - c * x + d * w)
    size = math.sqrt(x * x + y * y + z * z)
    if size < 1e-12:
        return [0, 0, 1, 0]
    angle = math.degrees(2.0 * math.atan2(size, w))
    return [round(v, 6) for v in (x / size, y / size, z / size, angle)]


CREATURE_BONES = [("hips", None, (0, 0.95, 0)), ("chest", "hips", (0, 1.45, 0)),
                  ("neck", "chest", (0, 1.78, 0.03)), ("crown", "neck", (0, 2.27, 0.06)),
                  ("tail", "hips", (0, 0.82, -0.2)), ("tail2", "tail", (0, 0.56, -0.58)),
                  ("tip", "tail2", (0, 0.75, -1.05))] + [
    bone for side, s in (("left", 1), ("right", -1)) for bone in (
        (side + " shoulder", "chest", (0.28 * s, 1.49, 0)),
        (side + " elbow", side + " shoulder", (0.68 * s, 1.36, 0.02)),
        (side + " wrist", side + " elbow", (1.08 * s, 1.436, 0.096)),
        (side + " fingers", side + " wrist", (1.27 * s, 1.476, 0.136)),
        (side + " thigh", "hips", (0.17 * s, 0.82, 0.01)),
        (side + " knee", side + " thigh", (0.24 * s, 0.46, 0.04)),
        (side + " ankle", side + " knee", (0.27 * s, 0.11, -0.02)),
        (side + " toes", side + " ankle", (0.29 * s, 0.07, 0.27)))]


def joint_list(bones, limits=None):
    limits = limits or {}
    return [dict(name=name, parent=parent, at=list(at),
                 **({"limits": limits[name]} if name in limits else {}))
            for name, parent, at in bones]


def blocks(lines, holds):
    """Quads around the boxes between lines along the axes whose middles `holds` takes."""
    count = [len(axis) - 1 for axis in lines]

    def is_in(box):
        if not all(0 <= box[a] < count[a] for a in range(3)):
            return False
        return holds(*(0.5 * (lines[a][box[a]] + lines[a][box[a] + 1]) for a in range(3)))
    number, faces = {}, []
    for box in ((i, j, k) for i in range(count[0]) for j in range(count[1]) for k in range(count[2])):
        if not is_in(box):
            continue
        for axis in range(3):
            for side in (0, 1):
                beside = list(box)
                beside[axis] += 1 if side else -1
                if is_in(beside):
                    continue
                u, v = (axis + 1) % 3, (axis + 2) % 3
                quad = []
                for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)):
                    corner = list(box)
                    corner[axis] += side
                    corner[u] += a
                    corner[v] += b
                    quad.append(number.setdefault(tuple(corner), len(number)))
                faces.append(quad if side else quad[::-1])
    return [tuple(lines[a][corner[a]] for a in range(3)) for corner in number], faces


def skeleton_scene(folder, name, model, bones, keys, extra=None, limits=None, **settings):
    lines = ["    " + json.dumps(joint) for joint in joint_list(bones, limits)]
    text = ['{', '  "cellwarp": 1,', '  "model": "%s",' % model]
    text += ['  "%s": %s,' % (key, json.dumps(value)) for key, value in (extra or {}).items()]
    text += ['  "skeleton": {', '   "joints": [', ",\n".join(lines) + "]"]
    for key, value in settings.items():
        text[-1] += ","
        text += ['   "%s": %s' % (key, json.dumps(value))]
    if keys:
        text[-1] += ","
        text += ['   "keys": [', ",\n".join("    " + json.dumps(key) for key in keys) + "]"]
    write(folder, name + ".json", "\n".join(text + ["  }", "}"]) + "\n")


def walk_keys():
    """A step with each leg in a second; arms hang and swing against the legs."""
    x, y, z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
    keys = []
    for k in range(9):
        time, phase = k / 8.0, 2.0 * math.pi * k / 8.0
        def key(joint, *turns, **more):
            keys.append(dict(time=time, joint=joint, rotate=turned(*turns), **more))
        key("hips", (y, 7 * math.sin(phase)),
            translate=[0, round(0.03 * math.cos(2 * phase) - 0.03, 6), 0])
        key("chest", (y, -12 * math.sin(phase)))
        key("neck", (y, 5 * math.sin(phase)))
        key("tail", (y, 18 * math.sin(phase - 0.6)))
        key("tail2", (y, 25 * math.sin(phase - 1.4)))
        for side, s in (("left", 1), ("right", -1)):
            swing = s * math.sin(phase)
            lift = max(0.0, s * math.cos(phase))
            key(side + " thigh", (x, -27 * swing))
            key(side + " knee", (x, 8 + 42 * lift))
            key(side + " ankle", (x, -6 - 12 * lift + 10 * swing))
            key(side + " shoulder", (z, -58 * s), (x, 24 * swing))
            key(side + " elbow", (y, -(22 + 14 * swing) * s))
    return keys


def bvh(folder):
    """The creature waves: centimetres, z up, channels in the order that motion capture has."""
    children = {}
    for name, parent, at in CREATURE_BONES:
        children.setdefault(parent, []).append((name, at))
    lines, channels = ["HIERARCHY"], []

    def joint(name, at, above, depth):
        pad = "  " * depth
        # y up to z up: (x, y, z) -> (x, -z, y).
        off = [100 * (at[k] - above[k]) for k in range(3)]
        offset = "OFFSET %.6g %.6g %.6g" % (off[0], -off[2], off[1])
        below = children.get(name, [])
        if not below:
            lines.extend([pad + "End Site", pad + "{", pad + "  " + offset, pad + "}"])
            return
        lines.extend([pad + ("ROOT " if depth == 0 else "JOINT ") + name.replace(" ", "_"),
                      pad + "{", pad + "  " + offset])
        if depth == 0:
            lines.append(pad + "  CHANNELS 6 Xposition Yposition Zposition "
                               "Zrotation Xrotation Yrotation")
        else:
            lines.append(pad + "  CHANNELS 3 Zrotation Xrotation Yrotation")
        channels.append(name)
        for child, place in below:
            joint(child, place, at, depth + 1)
        lines.append(pad + "}")

    joint("hips", CREATURE_BONES[0][2], (0, 0, 0), 0)
    frames = 25
    lines += ["MOTION", "Frames: %d" % frames, "Frame Time: 0.0833333333"]
    for f in range(frames):
        t = f / (frames - 1.0)
        rise = 0.5 - 0.5 * math.cos(2.0 * math.pi * t)
        wave = rise * math.sin(8.0 * math.pi * t)
        # In the file's axes: y of the body is z, z of the body is -y. (Z, X, Y)
        turns = {"left shoulder": (0, 0, -62 * rise), "left elbow": (0, 0, -35 * rise - 25 * wave),
                 "left wrist": (0, 0, -20 * wave), "right shoulder": (0, 0, 50 * rise),
                 "neck": (12 * rise, 0, 10 * wave), "chest": (0, 0, 6 * rise),
                 "tail": (20 * wave, 0, 0), "tail2": (25 * wave, 0, 0)}
        row = [0.0, 0.0, 2.0 * rise]
        for name in channels:
            row += turns.get(name, (0, 0, 0))
        lines.append(" ".join("%.5g" % v for v in row))
    write(folder, "wave.bvh", "\n".join(lines) + "\n")


def skeletons(folder):
    arm = [((0, 0, 0), (0.55, 0, 0.02), 0.25, 0.20), ((0.55, 0, 0.02), (1.2, 0, 0), 0.21, 0.155),
           ((1.2, 0, 0), (1.6, 0, 0.01), 0.16, 0.165), ((1.6, 0, 0.01), (2.25, 0, 0), 0.165, 0.10),
           ((2.3, 0, 0), (2.6, 0, 0), 0.12, 0.11)]
    points, faces = surface_nets(lambda p: smooth_union([capsule(p, *part) for part in arm], 0.05),
                                 (-0.35, -0.35, -0.35), (2.8, 0.35, 0.35), 0.03, 0.1)
    check_closed(faces)
    write(folder, "arm.obj", obj(points, faces, "an arm, quads"))
    skeleton_scene(folder, "arm", "arm.obj",
                   [("shoulder", None, (0, 0, 0)), ("elbow", "shoulder", (1.2, 0, 0)),
                    ("wrist", "elbow", (2.25, 0, 0)), ("tip", "wrist", (2.6, 0, 0))],
                   [dict(time=0, joint="elbow", rotate=[0, 0, 1, 90]),
                    dict(time=1, joint="elbow", rotate=[0, 0, 1, 120])],
                   limits={"elbow": {"hinge": [0, 0, 1], "twist": [0, 150]}})
    # The same arm without bones: two stiff parts and a hand that is pulled.
    scene(folder, "pull", "arm.obj", """cellwarp-handles 1
# Two stiff parts and a hand that is pulled: an elbow finds its angle, the hand its turn.
fixed shoulder halfspace -1 0 0  -0.3
stiff upper capsule 0.3 0 0  0.65 0 0  0.3  1000
stiff lower capsule 1.7 0 0  2.6 0 0  0.3  1000
pin   hand  halfspace 1 0 0  2.35
frame 1
move hand translate -0.35 0.85 0
frame 2
move hand translate -0.9 1.2 0
""")
    skeleton_scene(folder, "walk", "creature.obj", CREATURE_BONES, walk_keys(),
                   interpolation="squad")
    fingers = [("wrist", None, (0, 0.02, 0)), ("palm", "wrist", (0, 0.45, 0))]
    keys = []
    pitch = 2 * 0.088 + 0.0186
    for finger, (name, tip) in enumerate((("thumb", 1.12), ("index", 1.52), ("middle", 1.62),
                                          ("ring", 1.54), ("small", 1.36))):
        x = round((finger - 2) * pitch, 6)
        length = tip - 0.86
        fingers += [(name, "palm", (x, 0.86, 0)),
                    (name + " 2", name, (x, round(0.86 + 0.5 * length, 6), 0)),
                    (name + " tip", name + " 2", (x, round(tip + 0.06, 6), 0))]
        # A fist that closes from the small finger on; the thumb stays.
        for k, time in enumerate((0, 1)):
            bend = (0, 20, 30, 45, 60)[finger] if k == 0 else (0, 60, 70, 75, 80)[finger]
            keys.append(dict(time=time, joint=name, rotate=[1, 0, 0, bend]))
            keys.append(dict(time=time, joint=name + " 2", rotate=[1, 0, 0, 1.1 * bend]))
    skeleton_scene(folder, "fingers", "hand.ply", fingers, keys,
                   {"cells": {"across": 40, "gap": 0.005}})
    bvh(folder)
    write(folder, "wave.json", """{
  "cellwarp": 1,
  "model": "creature.obj",
  "skeleton": {"file": "wave.bvh", "scale": 0.01, "up": "z", "every": 0.25}
}
""")
    names = {name: '"%s"' % name if " " in name else name for name, parent, at in CREATURE_BONES}
    lines = ["cellwarp-handles 1",
             "# Feet stay where they are, a hand goes to a place, and the rest follows."]
    for name, parent, at in CREATURE_BONES:
        lines.append("joint %s at %g %g %g" % ((names[name],) + at) +
                     (" parent " + names[parent] if parent else "") +
                     (" hinge 1 0 0 twist 0 140" if name.endswith("knee") else "") +
                     (" swing 90 twist -60 60" if name == "chest" else ""))
    lines += ["frame 1", 'move hips translate 0 -0.16 -0.05',
              'move "left ankle" to 0.27 0.11 -0.02', 'move "right ankle" to -0.27 0.11 -0.02',
              'move "left wrist" to 0.72 1.86 0.3', "frame 2",
              "move chest rotate 0 0 1 18", 'move "left wrist" to 0.12 1.62 0.66',
              'move "right wrist" to -0.85 0.95 0.3']
    write(folder, "reach.handles", "\n".join(lines) + "\n")
    write(folder, "reach.json", """{
  "cellwarp": 1,
  "model": "creature.obj",
  "handles": "reach.handles"
}
""")


def medit(points, hexahedra, edges):
    """A lattice as a Medit mesh: hexahedra as two loops, and bones as edges."""
    lines = ["MeshVersionFormatted 2", "Dimension 3", "Vertices", str(len(points))]
    lines += ["%.6g %.6g %.6g 0" % p for p in points]
    lines += ["Hexahedra", str(len(hexahedra))]
    lines += [" ".join(str(i + 1) for i in h) + " 0" for h in hexahedra]
    lines += ["Edges", str(len(edges))]
    lines += ["%d %d 0" % (a + 1, b + 1) for a, b in edges]
    return "\n".join(lines + ["End"]) + "\n"


def limb_lattice(cells):
    """Cells along x and two by two across, wider than the limb; the axis lies on edges."""
    points, number = [], {}
    def node(i, j, k):
        if (i, j, k) not in number:
            number[i, j, k] = len(points)
            points.append((round(-0.25 + 2.5 * i / cells, 6), round(0.3 * (j - 1), 6),
                           round(0.3 * (k - 1), 6)))
        return number[i, j, k]
    hexahedra = [[node(i + a, j + b, k + c) for c in (0, 1)
                  for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
                 for i in range(cells) for j in range(2) for k in range(2)]
    first, last = cells // 10, cells - cells // 10
    return points, hexahedra, [(node(i, 1, 1), node(i + 1, 1, 1)) for i in range(first, last)]


def flesh(folder):
    """Flesh that follows a skeleton in time."""
    into = os.path.join(folder, "flesh")
    os.makedirs(into, exist_ok=True)
    def in_time(duration, **more):
        return {"simulate": dict(duration=duration, **more)}
    # A limb in a lattice that was drawn: bones are its edges.
    points, faces = surface_nets(
        lambda p: smooth_union([capsule(p, (0, 0, 0), (1, 0, 0), 0.2, 0.17),
                                capsule(p, (1, 0, 0), (2, 0, 0), 0.17, 0.13)], 0.03),
        (-0.3, -0.3, -0.3), (2.3, 0.3, 0.3), 0.035, 0.1)
    check_closed(faces)
    write(into, "limb.obj", obj(points, faces, "a limb, quads"))
    write(into, "limb.mesh", medit(*limb_lattice(20)))
    bones = [("shoulder", None, (0, 0, 0)), ("elbow", "shoulder", (1, 0, 0)),
             ("hand", "elbow", (2, 0, 0))]
    def bend(angle, seconds):
        return [dict(time=0, joint="elbow", rotate=[0, 0, 1, 0]),
                dict(time=seconds, joint="elbow", rotate=[0, 0, 1, angle])]
    skeleton_scene(into, "limb", "limb.obj", bones, bend(90, 0.5), in_time(1.0),
                   lattice="limb.mesh", E=3e4, nu=0.4, tube_radius=0.08)
    # The same, every cell halved, the upper arm stiffer.
    skeleton_scene(into, "limb_halved", "limb.obj", bones, bend(90, 0.5), in_time(1.0),
                   lattice="limb.mesh", max_depth=1, E=1e5, nu=0.4, tube_radius=0.08,
                   materials=[dict(region="box -1 -1 -1  0.9 1 1", E=3e5)])
    # The same arm as that which is posed, bent in half a second.
    arm = [("shoulder", None, (0, 0, 0)), ("elbow", "shoulder", (1.2, 0, 0)),
           ("wrist", "elbow", (2.25, 0, 0)), ("tip", "wrist", (2.6, 0, 0))]
    skeleton_scene(into, "elbow", "../arm.obj", arm, bend(120, 0.5), in_time(1.0),
                   E=3e4, across=32)
    # Flesh that spins about its bone, held to it by the tube, or not.
    def spin(name, **more):
        skeleton_scene(into, name, "limb.obj", bones[:1] + [("hand", "shoulder", (2, 0, 0))],
                       [dict(time=0, joint="shoulder", rotate=[1, 0, 0, 0]),
                        dict(time=0.25, joint="shoulder", rotate=[1, 0, 0, 170]),
                        dict(time=0.5, joint="shoulder", rotate=[1, 0, 0, 340])],
                       in_time(0.5, every=0.125), E=1e4, across=28, **more)
    spin("spin")
    spin("spin_free", tube=False)
    # The limb bent to 120 degrees by every law.
    for law in ("cells", "regions", "linear", "stvk", "neo-hookean"):
        skeleton_scene(into, "joint_" + law.split("-")[0], "limb.obj", bones, bend(120, 0.5),
                       in_time(0.75, every=0.25), E=3e4, across=28, law=law)
    # Half of the limb has a bone; the other half flops down on a slope.
    skeleton_scene(into, "flop", "limb.obj", bones[:1] + [("middle", "shoulder", (0.7, 0, 0))],
                   [dict(time=0, joint="shoulder", rotate=[0, 0, 1, 0])],
                   in_time(1.5, every=0.125), E=1.2e4, across=28, damping={"alpha": 1.0},
                   obstacles=[{"plane": [0.15, 1, 0, -0.35], "friction": 0.4}])
    # The creature walks; head, ears and belly swing.
    walk = walk_keys()
    steps = [dict(key, time=key["time"] + k) for k in range(2) for key in walk
             if k == 0 or key["time"] > 0]
    skeleton_scene(into, "walk", "../creature.obj", CREATURE_BONES, steps,
                   dict(in_time(2.0), cells={"across": 32}), interpolation="squad", E=4e4,
                   across=32)
    # The creature crouches and reaches up: its feet stay, a hand goes to places.
    skeleton_scene(into, "reach", "../creature.obj", CREATURE_BONES,
                   [dict(time=0, joint="hips", translate=[0, 0, 0]),
                    dict(time=0.4, joint="hips", translate=[0, -0.16, -0.05]),
                    dict(time=0.8, joint="hips", translate=[0, -0.02, 0]),
                    dict(time=0, joint="left ankle", to=[0.27, 0.11, -0.02]),
                    dict(time=0, joint="right ankle", to=[-0.27, 0.11, -0.02]),
                    dict(time=0, joint="left wrist", to=[1.08, 1.436, 0.096]),
                    dict(time=0.4, joint="left wrist", to=[0.75, 0.95, 0.4]),
                    dict(time=0.8, joint="left wrist", to=[0.72, 1.95, 0.3])],
                   in_time(1.2), {side + " knee": {"hinge": [1, 0, 0], "twist": [0, 140]}
                                  for side in ("left", "right")},
                   interpolation="squad", E=6e4, across=32)
    # A belly on a pelvis that walks, softer than the rest.
    belly = lambda p: smooth_union([
        capsule(p, (0, 0.1, 0), (0, 0.75, 0), 0.26, 0.22), capsule(p, (0, 0.3, 0.12), (0, 0.42, 0.16),
                                                              0.3, 0.28),
        capsule(p, (-0.17, 0.0, 0), (-0.2, -0.6, 0.02), 0.14, 0.1),
        capsule(p, (0.17, 0.0, 0), (0.2, -0.6, 0.02), 0.14, 0.1),
        capsule(p, (0, 0.95, 0), (0, 1.15, 0.02), 0.15, 0.13)], 0.05)
    points, faces = surface_nets(belly, (-0.6, -0.8, -0.5), (0.6, 1.4, 0.7), 0.03, 0.1)
    check_closed(faces)
    write(into, "belly.obj", obj(points, faces, "a body with a belly, quads"))
    keys = []
    for k in range(17):
        time, phase = k / 8.0, 2.0 * math.pi * k / 8.0
        keys.append(dict(time=time, joint="pelvis", rotate=turned(((0, 1, 0), 9 * math.sin(phase)),
                                                                  ((0, 0, 1), 4 * math.sin(phase))),
                         translate=[0, round(0.05 * math.cos(2 * phase) - 0.05, 6), 0]))
        keys.append(dict(time=time, joint="spine", rotate=turned(((0, 1, 0), -14 * math.sin(phase)))))
        for side, s in (("left", 1), ("right", -1)):
            keys.append(dict(time=time, joint=side + " hip",
                             rotate=turned(((1, 0, 0), -22 * s * math.sin(phase)))))
    skeleton_scene(into, "belly", "belly.obj",
                   [("pelvis", None, (0, 0.1, -0.05)), ("spine", "pelvis", (0, 0.35, -0.1)),
                    ("neck", "spine", (0, 0.85, -0.02)), ("crown", "neck", (0, 1.2, 0.02)),
                    ("left hip", "pelvis", (0.17, 0.0, 0)),
                    ("left foot", "left hip", (0.2, -0.65, 0.02)),
                    ("right hip", "pelvis", (-0.17, 0.0, 0)),
                    ("right foot", "right hip", (-0.2, -0.65, 0.02))],
                   keys, in_time(2.0), interpolation="squad", E=8e4, nu=0.45, across=28,
                   settle=True, damping={"alpha": 1.0},
                   materials=[{"region": "sphere 0 0.36 0.25 0.32", "E": 2.5e4}])
    # The same body at rest; a ball presses its belly and goes away again.
    body = [("pelvis", None, (0, 0.1, -0.05)), ("spine", "pelvis", (0, 0.35, -0.1)),
            ("neck", "spine", (0, 0.85, -0.02)), ("crown", "neck", (0, 1.2, 0.02)),
            ("left hip", "pelvis", (0.17, 0.0, 0)), ("left foot", "left hip", (0.2, -0.65, 0.02)),
            ("right hip", "pelvis", (-0.17, 0.0, 0)),
            ("right foot", "right hip", (-0.2, -0.65, 0.02))]
    ball = [(0.0, 0.0), (0.5, -0.38), (0.9, -0.38), (1.1, 0.0)]
    skeleton_scene(into, "press", "belly.obj", body,
                   [dict(time=0, joint="pelvis", rotate=[0, 0, 1, 0])],
                   in_time(1.5, every=0.125), E=8e4, nu=0.45, across=28, damping={"alpha": 1.0},
                   materials=[{"region": "sphere 0 0.36 0.25 0.32", "E": 2.5e4}],
                   obstacles=[{"sphere": [0, 0.38, 0.78, 0.25], "friction": 0.5,
                             "keys": [dict(time=t, translate=[0, 0, z]) for t, z in ball]}])
    # Much the same in large cells, which are halved as long as the ball is there.
    ball = [(0.0, 0.0), (0.5, -0.375), (0.9, -0.375), (1.1, 0.0)]
    skeleton_scene(into, "detail", "belly.obj", body,
                   [dict(time=0, joint="pelvis", rotate=[0, 0, 1, 0])],
                   in_time(2.25, every=0.125), E=8e4, nu=0.45, across=14, max_depth=2, detail=0.03,
                   damping={"alpha": 1.0},
                   materials=[{"region": "sphere 0 0.36 0.25 0.32", "E": 2.5e4}],
                   obstacles=[{"sphere": [0, 0.38, 0.78, 0.25], "friction": 0.5,
                             "keys": [dict(time=t, translate=[0, 0, z]) for t, z in ball]}])
    # A point of the belly is pulled, and let go.
    pulled = [(0.0, 0.0), (0.5, 0.3), (0.75, 0.3)]
    skeleton_scene(into, "pulled", "belly.obj", body,
                   [dict(time=0, joint="pelvis", rotate=[0, 0, 1, 0])],
                   in_time(0.75, every=0.125), E=8e4, nu=0.45, across=28,
                   damping={"alpha": 1.0},
                   held=[{"at": [0, 0.4, 0.38],
                          "keys": [dict(time=t, translate=[0.2 * z, 0.3 * z, z])
                                   for t, z in pulled]}])
    # The same in large cells: the drag adds detail.
    skeleton_scene(into, "drag", "belly.obj", body,
                   [dict(time=0, joint="pelvis", rotate=[0, 0, 1, 0])],
                   in_time(0.75, every=0.125), E=8e4, nu=0.45, across=14, max_depth=2,
                   detail=0.01, damping={"alpha": 1.0},
                   held=[{"at": [0, 0.4, 0.38],
                          "keys": [dict(time=t, translate=[0.2 * z, 0.3 * z, z])
                                   for t, z in pulled]}])
    # A rope round the belly slides through eyelets and is pulled tight by its ends.
    height, back = 0.36, 0.1066
    def eyelet(degrees, out):
        way = (math.cos(math.radians(degrees)), math.sin(math.radians(degrees)))
        low, high = 0.0, 0.6
        for _ in range(40):
            middle = 0.5 * (low + high)
            inside = belly((middle * way[0], height, back + middle * way[1])) < 0
            low, high = (middle, high) if inside else (low, middle)
        return [round(c, 5) for c in (out * low * way[0], height, back + out * low * way[1])]
    around = [-60 + 300 * k / 16 for k in range(17)]
    end = (0.3, 0.02, -0.62)
    pull = lambda s: [{"time": 0, "translate": [0, 0, 0]},
                      {"time": 0.75, "translate": [s * 0.2, 0, -0.14]}]
    rope = {"name": "rope", "radius": 0.018, "E": 2e7, "density": 800, "spans": 40,
            "through": [[-end[0], height - end[1], end[2]]] +
                       [eyelet(a, 1.02) for a in around] + [[end[0], height + end[1], end[2]]],
            "fixed": [{"at": 0, "what": ["point"], "keys": pull(-1)},
                      {"at": 1, "what": ["point"], "keys": pull(1)}]}
    skeleton_scene(into, "rope", "belly.obj", body,
                   [dict(time=0, joint="pelvis", rotate=[0, 0, 1, 0])],
                   dict(in_time(1.0, every=0.125), rods=[rope],
                        connections=[{"a": "rod rope sliding",
                                 "b": "flesh %g %g %g" % tuple(eyelet(a, 0.98))}
                                for a in around]),
                   E=8e4, nu=0.45, across=20, damping={"alpha": 1.0},
                   materials=[{"region": "sphere 0 0.36 0.25 0.32", "E": 2.5e4}])
    # A wound is sewn up: a thread goes to and fro through its lips, and is pulled.
    side = [round(-1 + 0.1 * i, 2) for i in range(9)] + [-0.12]
    lines = [side + [-x for x in reversed(side)],
             [0, 0.12, 0.24] + [round(0.35 + 0.65 * i / 6, 4) for i in range(7)],
             [round(0.1 * i, 2) for i in range(13)]]
    points, faces = blocks(lines, lambda x, y, z: not (abs(x) < 0.12 and y > 0.35))
    write(into, "wound.obj", obj(points, faces, "a block with a slot, quads"))
    holes = [(0.3 * (-1) ** (n + 1), 0.85, round(0.2 + 0.13 * n, 2)) for n in range(7)]
    thread = {"name": "thread", "radius": 0.012, "E": 2e7, "density": 1000,
              "through": [list(hole) for hole in holes] + [[0.1, 0.95, 1.6]],
              "fixed": [{"at": 1, "what": ["point"],
                         "keys": [{"time": 0, "translate": [0, 0, 0]},
                                  {"time": 1, "translate": [0, 0.15, 0.65]}]}]}
    skeleton_scene(into, "suture", "wound.obj",
                   [("base", None, (-0.8, 0.15, 0.6)), ("end", "base", (0.8, 0.15, 0.6))],
                   [dict(time=0, joint="base", rotate=[0, 0, 1, 0])],
                   {"simulate": {"duration": 1.25, "every": 0.125, "gravity": [0, 0, 0]},
                    "rods": [thread],
                    "connections": [{"a": "rod thread " + ("sliding" if n else "0"),
                                "b": "flesh %g %g %g" % hole} for n, hole in enumerate(holes)]},
                   E=2e4, across=16, damping={"alpha": 4.0})
    # Only the root of the tail has a bone: the rest is flicked.
    hips = [b for b in CREATURE_BONES if b[0] not in ("tip",)]
    flick = [(0.0, 0), (0.25, 40), (0.6, -40), (0.95, 40), (1.2, 0)]
    skeleton_scene(into, "tail", "../creature.obj", hips,
                   [dict(time=t, joint="tail", rotate=[0, 1, 0, a]) for t, a in flick],
                   in_time(2.0), interpolation="squad", E=6e4, across=32)


def creature_parts():
    parts = [((0, 0.95, 0), (0, 1.45, 0), 0.27, 0.30),      # trunk
             ((0, 1.45, 0), (0, 1.95, 0.04), 0.16, 0.14),   # neck
             ((0, 2.05, 0.02), (0, 2.05, 0.14), 0.27, 0.22),  # head
             ((0, 1.98, 0.2), (0, 1.95, 0.42), 0.13, 0.09),  # snout
             ((0, 0.85, -0.15), (0, 0.55, -0.6), 0.13, 0.09),  # tail
             ((0, 0.55, -0.6), (0, 0.75, -1.05), 0.09, 0.05)]
    for s in (-1, 1):
        parts += [((0.24 * s, 1.50, 0), (0.68 * s, 1.36, 0.02), 0.13, 0.11),  # arm
                  ((0.68 * s, 1.36, 0.02), (1.10 * s, 1.44, 0.10), 0.11, 0.09),
                  ((1.10 * s, 1.44, 0.10), (1.24 * s, 1.47, 0.13), 0.12, 0.10),  # hand
                  ((0.16 * s, 0.86, 0), (0.24 * s, 0.46, 0.04), 0.17, 0.14),  # leg
                  ((0.24 * s, 0.46, 0.04), (0.27 * s, 0.10, -0.02), 0.14, 0.11),
                  ((0.27 * s, 0.08, -0.02), (0.29 * s, 0.07, 0.24), 0.11, 0.10),  # foot
                  ((0.15 * s, 2.25, 0.0), (0.30 * s, 2.50, -0.04), 0.09, 0.04)]  # ear
    return parts


def surface_nets(value, low, high, h, slack):
    """Quads of the surface value = 0: a vertex in each cube of width h with a sign
    change, a quad across each edge with one; then the vertices move onto the surface.
    slack bounds how far value may differ from the distance."""
    n = [int(math.ceil((high[k] - low[k]) / h)) for k in range(3)]
    cache = {}

    def at(i, j, k):
        key = (i, j, k)
        if key not in cache:
            cache[key] = value((low[0] + i * h, low[1] + j * h, low[2] + k * h))
        return cache[key]

    # Blocks that are far from the surface are skipped.
    near = set()
    step = 6
    for i in range(0, n[0] + 1, step):
        for j in range(0, n[1] + 1, step):
            for k in range(0, n[2] + 1, step):
                if abs(at(i, j, k)) < 1.2 * step * h + slack:
                    near.add((i, j, k))
    numbers, points, faces = {}, [], []

    def vertex(cube):
        if cube not in numbers:
            crossings = []
            for axis in range(3):
                for a in (0, 1):
                    for b in (0, 1):
                        p = list(cube)
                        p[(axis + 1) % 3] += a
                        p[(axis + 2) % 3] += b
                        q = list(p)
                        q[axis] += 1
                        x, y = at(*p), at(*q)
                        if (x < 0) != (y < 0):
                            t = x / (x - y)
                            crossings.append([p[m] + t * (q[m] - p[m]) for m in range(3)])
            numbers[cube] = len(points)
            points.append([low[m] + h * sum(c[m] for c in crossings) / len(crossings)
                           for m in range(3)])
        return numbers[cube]

    for corner in sorted(near):
        for i in range(corner[0], min(corner[0] + step, n[0])):
            for j in range(corner[1], min(corner[1] + step, n[1])):
                for k in range(corner[2], min(corner[2] + step, n[2])):
                    inside = at(i, j, k) < 0
                    for axis in range(3):
                        q = [i, j, k]
                        q[axis] += 1
                        if inside == (at(*q) < 0):
                            continue
                        quad = []
                        for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)):
                            cube = [i, j, k]
                            cube[(axis + 1) % 3] -= a
                            cube[(axis + 2) % 3] -= b
                            quad.append(vertex(tuple(cube)))
                        faces.append(quad if inside else quad[::-1])
    for p in points:
        for _ in range(4):
            f = value(p)
            g = []
            for m in range(3):
                q = list(p)
                q[m] += 1e-4
                g.append((value(q) - f) / 1e-4)
            squared = max(1e-6, sum(x * x for x in g))
            for m in range(3):
                p[m] -= f * g[m] / squared
    return points, faces


def creature_value(parts):
    return lambda p: smooth_union([capsule(p, *part) for part in parts], 0.045)


def creature(folder):
    points, faces = surface_nets(creature_value(creature_parts()), (-1.5, -0.2, -1.3),
                                 (1.5, 2.7, 0.7), 0.0262, 0.15)
    check_closed(faces)
    write(folder, "creature.obj", obj(points, faces, "a creature, quads"))
    scene(folder, "creature", "creature.obj", """cellwarp-handles 1
# Standing on its feet it looks to the side and raises one arm, then waves it.
fixed  feet  box -2 -1 -1  2 0.2 0.6
handle head  sphere 0 2.08 0.08  0.30
handle hand  sphere 1.22 1.46 0.12  0.16
frame 1
move head rotate 0 1 0 40
move hand rotate 0 0 1 50  translate -0.15 0.6 0
frame 2
move hand rotate 0 0 1 95  translate -0.5 0.85 0.1
""")


def vase(folder):
    rings, around = 80, 120
    points, faces = [(0.0, 0.0, 0.0)], []
    for i in range(1, rings + 1):
        t = i / rings
        # A flat foot, then a belly, a neck and a rim.
        if t < 0.15:
            r, y = 0.45 * t / 0.15, 0.0
        else:
            s = (t - 0.15) / 0.85
            r = 0.45 + 0.28 * math.sin(math.pi * s ** 0.8) - 0.28 * s ** 2 + 0.22 * s ** 6
            y = 1.6 * s
        for a in range(around):
            phi = 2 * math.pi * a / around
            points.append((r * math.cos(phi), y, r * math.sin(phi)))

    def at(i, a):
        return 0 if i == 0 else 1 + (i - 1) * around + a % around

    for a in range(around):
        faces.append((0, at(1, a), at(1, a + 1)))
        for i in range(1, rings):
            faces.append((at(i, a), at(i + 1, a), at(i + 1, a + 1), at(i, a + 1)))
    write(folder, "vase.obj", obj(points, faces, "an open shell of revolution"))
    scene(folder, "vase", "vase.obj", """cellwarp-handles 1
units relative
# The foot stands, the rim is tilted and pulled to one side.
fixed  foot  box -0.1 -0.1 -0.1  1.1 0.06 1.1
handle rim   box -0.1 0.93 -0.1  1.1 1.1 1.1
frame 1
move rim rotate 0 0 1 -30  translate 0.2 0.1 0
""", ',\n  "cells": {"fill": "shell", "across": 28, "thickness": 0.03}')


def cloud(folder):
    rng = random.Random(7)
    big, small, count = 1.0, 0.28, 40000
    data = ("""ply
format binary_little_endian 1.0
comment points on a torus, coloured by their angle
element vertex %d
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
property float intensity
end_header
""" % count).encode()
    made = 0
    while made < count:
        a, b = rng.uniform(0, 2 * math.pi), rng.uniform(0, 2 * math.pi)
        if rng.random() * (big + small) > big + small * math.cos(b):
            continue  # keeps the points even by area
        r = big + small * math.cos(b)
        stripe = 0.5 + 0.5 * math.cos(6 * a + 2 * b)
        colour = [int(255 * (0.25 + 0.7 * x)) for x in
                  (stripe, 0.5 + 0.5 * math.sin(a), 0.5 + 0.5 * math.cos(a))]
        data += struct.pack("<3f3Bf", r * math.cos(a), small * math.sin(b), r * math.sin(a),
                            *colour, rng.random())
        made += 1
    write(folder, "cloud.ply", data)
    scene(folder, "cloud", "cloud.ply", """cellwarp-handles 1
# One side of the ring stays, the other is lifted and turned.
fixed  left   box -2 -1 -1  -0.9 1 1
handle right  box 0.9 -1 -1  2 1 1
frame 1
move right rotate 1 0 0 90  translate 0 0.5 0
""")


def binary_ply(points, faces, comment):
    head = """ply
format binary_little_endian 1.0
comment %s
element vertex %d
property float x
property float y
property float z
element face %d
property list uchar int vertex_indices
end_header
""" % (comment, len(points), len(faces))
    data = bytearray(head.encode())
    for p in points:
        data += struct.pack("<3f", *p)
    for face in faces:
        data += struct.pack("<B%di" % len(face), len(face), *face)
    return bytes(data)


def hand(folder):
    radius, gap = 0.088, 0.0186
    pitch = 2 * radius + gap
    tips = (1.12, 1.52, 1.62, 1.54, 1.36)

    def palm(p):
        # A box with round edges.
        half, r = (2.5 * pitch - 0.5 * gap - 0.08, 0.42, 0.075), 0.08
        q = [max(0.0, abs(p[k] - (0.0, 0.42, 0.0)[k]) - half[k]) for k in range(3)]
        inner = max(abs(p[k] - (0.0, 0.42, 0.0)[k]) - half[k] for k in range(3))
        return math.sqrt(sum(x * x for x in q)) + min(0.0, inner) - r

    def value(p):
        base = palm(p)
        # Each finger grows smoothly out of the palm, but not into its neighbours.
        best = base
        for finger, tip in enumerate(tips):
            x = (finger - 2) * pitch
            if abs(p[0] - x) > 2 * pitch:
                continue
            d = capsule(p, (x, 0.82, 0.0), (x, tip, 0.0), radius, 0.93 * radius)
            best = min(best, smooth_union([base, d], 0.02))
        return best

    points, faces = surface_nets(value, (-0.62, -0.15, -0.25), (0.62, 1.8, 0.25), 0.0145, 0.05)
    check_closed(faces)
    write(folder, "hand.ply", binary_ply(points, faces, "a hand, its fingers side by side"))
    scene(folder, "touch", "hand.ply", """cellwarp-handles 1
# A finger leans on its neighbour, which leans on the next one: none passes through another.
fixed  wrist box -2 -1 -1  2 0.25 1
handle index box -0.29 1.40 -1  -0.11 2 1
frame 1
move index rotate 0 0 1 -12  translate 0.15 0 0
""", ',\n  "cells": { "contact": true }')
    scene(folder, "hand", "hand.ply", """cellwarp-handles 1
# Fingers one percent of the diagonal apart: one is bent down, one up, one aside.
fixed  wrist   box -2 -1 -1  2 0.25 1
handle index   box -0.29 1.40 -1  -0.11 2 1
handle middle  box -0.09 1.50 -1   0.09 2 1
handle small   box  0.31 1.25 -1   0.6  2 1
frame 1
move index  rotate 1 0 0 75  translate 0 -0.33 0.40
move middle rotate 1 0 0 -40  translate 0 -0.13 -0.28
move small  rotate 0 0 1 -35  translate 0.28 -0.1 0
""", ',\n  "cells": {"across": 40, "gap": 0.005}')


def tube(path, radius, around, closed=False):
    """Quads around a path of points; its ends are closed by fans unless it is closed."""
    n = len(path)
    points, faces, normal = [], [], None
    frames = []
    for i in range(n):
        a, b = path[i - 1 if i or closed else 0], path[(i + 1) % n if closed else min(i + 1, n - 1)]
        t = [b[k] - a[k] for k in range(3)]
        length = math.sqrt(sum(x * x for x in t))
        t = [x / length for x in t]
        if normal is None:
            normal = [0.0, 0.0, 0.0]
            normal[min(range(3), key=lambda k: abs(t[k]))] = 1.0
        # Carried along the path: the part across the tangent of the last normal.
        along = sum(normal[k] * t[k] for k in range(3))
        normal = [normal[k] - along * t[k] for k in range(3)]
        length = math.sqrt(sum(x * x for x in normal))
        normal = [x / length for x in normal]
        frames.append((t, normal))
    # A closed path comes back turned: the turn is spread over all of it.
    spin = 0.0
    if closed:
        t, first = frames[0]
        last = frames[-1][1]
        other = [t[1] * first[2] - t[2] * first[1], t[2] * first[0] - t[0] * first[2],
                 t[0] * first[1] - t[1] * first[0]]
        spin = -math.atan2(sum(last[k] * other[k] for k in range(3)),
                           sum(last[k] * first[k] for k in range(3)))
    for i, (t, u) in enumerate(frames):
        v = [t[1] * u[2] - t[2] * u[1], t[2] * u[0] - t[0] * u[2], t[0] * u[1] - t[1] * u[0]]
        for a in range(around):
            phi = 2 * math.pi * a / around + spin * i / n
            points.append([path[i][k] + radius * (math.cos(phi) * u[k] + math.sin(phi) * v[k])
                           for k in range(3)])
    for i in range(n if closed else n - 1):
        for a in range(around):
            b, j = (a + 1) % around, (i + 1) % n
            faces.append([i * around + a, i * around + b, j * around + b, j * around + a])
    if not closed:
        for end in (0, n - 1):
            centre = len(points)
            points.append(list(path[end]))
            for a in range(around):
                pair = [end * around + a, end * around + (a + 1) % around]
                faces.append([centre] + (pair if end else pair[::-1]))
    return points, faces


def coil(folder):
    turns, wire, pitch, radius = 7, 0.06, 0.139, 0.5
    path = []
    for i in range(64 * turns + 1):
        phi = 2 * math.pi * i / 64
        path.append((radius * math.cos(phi), pitch * i / 64, radius * math.sin(phi)))
    points, faces = tube(path, wire, 14)
    check_closed(faces)
    write(folder, "coil.obj", obj(points, faces, "a coil spring, its turns side by side"))
    scene(folder, "coil", "coil.obj", """cellwarp-handles 1
units relative
# The lowest half turn stands; the highest is lifted, tilted and moved aside.
fixed  low   box -0.1 -0.1 -0.1  1.1 0.115 0.5
handle high  box -0.1 0.885 0.5  1.1 1.1 1.1
frame 1
move high rotate 0 0 1 -40  translate 0.45 0.9 0
""", ',\n  "cells": {"across": 28, "gap": 0.006}')


def chain(folder):
    lines, first = ["# a chain of five links that do not touch"], 1
    for link in range(5):
        path = []
        for i in range(96):
            # Two half circles and two straight sides.
            s = i / 96 * (4 * 0.35 + 2 * math.pi * 0.2)
            if s < 0.7:
                p = (0.2, s - 0.35)
            elif s < 0.7 + math.pi * 0.2:
                phi = (s - 0.7) / 0.2
                p = (0.2 * math.cos(phi), 0.35 + 0.2 * math.sin(phi))
            elif s < 1.4 + math.pi * 0.2:
                p = (-0.2, 0.35 - (s - 0.7 - math.pi * 0.2))
            else:
                phi = math.pi + (s - 1.4 - math.pi * 0.2) / 0.2
                p = (0.2 * math.cos(phi), -0.35 + 0.2 * math.sin(phi))
            y = p[1] + 0.79 * link
            path.append((p[0], y, 0.0) if link % 2 == 0 else (0.0, y, p[0]))
        points, faces = tube(path, 0.075, 16, closed=True)
        check_closed(faces)
        lines.append("g link%d" % (link + 1))
        lines += ["v %.6g %.6g %.6g" % tuple(p) for p in points]
        lines += ["f " + " ".join(str(i + first) for i in face) for face in faces]
        first += len(points)
    write(folder, "chain.obj", "\n".join(lines) + "\n")
    scene(folder, "chain", "chain.obj", """cellwarp-handles 1
# Only the middle link is bent; the two above go with its upper end.
fixed  below  group link1
fixed  below  group link2
fixed  low    box -0.4 1.0 -0.4  0.4 1.3 0.4
handle high   box -0.4 1.86 -0.4  0.4 2.2 0.4
handle above  group link4
handle above  group link5
frame 1
move high  rotate 0 1 0 70 about 0 1.58 0  rotate 0 0 1 -35 about 0 1.58 0
move above rotate 0 1 0 70 about 0 1.58 0  rotate 0 0 1 -35 about 0 1.58 0
""", ',\n  "cells": {"across": 64}')


def knot(t):
    return (math.sin(t) + 2 * math.sin(2 * t), math.cos(t) - 2 * math.cos(2 * t),
            -math.sin(3 * t))


def soup(folder):
    rng = random.Random(3)
    points, faces = tube([knot(2 * math.pi * i / 280) for i in range(280)], 0.5, 16,
                         closed=True)
    triangles = []
    for face in faces:
        a, b, c, d = (points[i] for i in face)
        for corners in ((a, b, c), (a, c, d)):
            turn = rng.randrange(3)
            triangles.append(corners[turn:] + corners[:turn])
    rng.shuffle(triangles)
    data = bytearray(b"loose triangles of a knot, in random order".ljust(80))
    data += struct.pack("<I", len(triangles))
    for a, b, c in triangles:
        u, v = ([q[k] - a[k] for k in range(3)] for q in (b, c))
        n = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
        length = math.sqrt(sum(x * x for x in n))
        data += struct.pack("<12fH", *(x / length for x in n), *a, *b, *c, 0)
    write(folder, "soup.stl", bytes(data))
    scene(folder, "soup", "soup.stl", """cellwarp-handles 1
# One lobe of the knot stays, the others are pulled out and turned.
fixed  low    halfspace 0 -1 0  2.2
handle right  sphere  2.35 1.75 0  0.9
handle left   sphere -2.35 1.75 0  0.9
frame 1
move right rotate 1 0 0 40  translate 1.0 0.7 0
move left  rotate 1 0 0 40  translate -1.0 0.7 0
""", ',\n  "cells": {"across": 40}')


def figure(folder):
    """Quads around the points of a grid that lie inside; at the rim their corners are
    where the outline passes."""
    parts = [((0, 1.72), (0, 1.74), 0.21, 0.21), ((0, 1.6), (0, 1.4), 0.08, 0.09),
             ((0, 1.22), (0, 0.85), 0.23, 0.18), ((-0.08, 0.8), (0.08, 0.8), 0.17, 0.17)]
    for s in (-1, 1):
        parts += [((0.12 * s, 1.33), (0.46 * s, 1.08), 0.10, 0.08),
                  ((0.46 * s, 1.08), (0.70 * s, 0.72), 0.08, 0.06),
                  ((0.70 * s, 0.72), (0.75 * s, 0.63), 0.08, 0.07),
                  ((0.11 * s, 0.75), (0.20 * s, 0.05), 0.12, 0.08),
                  ((0.20 * s, 0.05), (0.33 * s, 0.03), 0.07, 0.05)]

    def value(x, y):
        return smooth_union([capsule((x, y, 0.0), a + (0.0,), b + (0.0,), ra, rb)
                             for a, b, ra, rb in parts], 0.025)

    h, low, counts = 0.03, (-0.99, -0.12), (66, 72)
    at = [[value(low[0] + h * i, low[1] + h * j) for j in range(counts[1] + 1)]
          for i in range(counts[0] + 1)]
    points, number, faces = [], {}, []

    def corner(i, j):
        if (i, j) not in number:
            crossings = []
            for (a, b), (c, d) in (((0, 0), (1, 0)), ((0, 1), (1, 1)), ((0, 0), (0, 1)),
                                   ((1, 0), (1, 1))):
                u, v = at[i + a][j + b], at[i + c][j + d]
                if (u < 0) != (v < 0):
                    t = u / (u - v)
                    crossings.append((a + t * (c - a), b + t * (d - b)))
            x, y = (0.5, 0.5) if not crossings else [
                sum(p[k] for p in crossings) / len(crossings) for k in (0, 1)]
            number[i, j] = len(points)
            points.append((low[0] + h * (i + x), low[1] + h * (j + y), 0.0))
        return number[i, j]

    for i in range(1, counts[0]):
        for j in range(1, counts[1]):
            if at[i][j] < 0:
                faces.append([corner(i - 1, j - 1), corner(i, j - 1), corner(i, j),
                              corner(i - 1, j)])
    write(folder, "figure.obj", obj(points, faces, "a flat figure, quads"))
    scene(folder, "figure", "figure.obj", """cellwarp-handles 1
# The feet stand, one arm is raised and waves, the head looks after it.
fixed  left   box -0.5 -0.2 -1  -0.1 0.12 1
fixed  right  box  0.1 -0.2 -1   0.5 0.12 1
handle hand   sphere 0.74 0.65 0  0.13
handle head   sphere 0 1.74 0  0.19
frame 1
move hand rotate 0 0 1 115 about 0.2 1.3 0
move head rotate 0 0 1 8 about 0 1.5 0
frame 2
move hand rotate 0 0 1 85 about 0.2 1.3 0
move head rotate 0 0 1 -6 about 0 1.5 0
""")


def scan(folder):
    """What a scanner sees of the creature from three places: lines of points, noise,
    and holes where nothing is seen."""
    rng = random.Random(11)
    parts = creature_parts()
    value = creature_value(parts)
    lines = ["# x y z strength: seen from three places"]
    for yaw, height in ((25, 1.9), (150, 1.2), (265, 1.6)):
        eye = (4.5 * math.sin(math.radians(yaw)), height, 4.5 * math.cos(math.radians(yaw)))
        ahead = [(0.0, 1.2, -0.1)[k] - eye[k] for k in range(3)]
        length = math.sqrt(sum(x * x for x in ahead))
        ahead = [x / length for x in ahead]
        side = (-ahead[2], 0.0, ahead[0])
        length = math.hypot(side[0], side[2])
        side = [x / length for x in side]
        up = [side[1] * ahead[2] - side[2] * ahead[1], side[2] * ahead[0] - side[0] * ahead[2],
              side[0] * ahead[1] - side[1] * ahead[0]]
        for row in range(190):
            for column in range(230):
                if rng.random() < 0.04:
                    continue  # no echo
                x = (column - 115) * 0.0037 + rng.gauss(0, 2e-4)
                y = (row - 95) * 0.0042
                ray = [ahead[k] + x * side[k] + y * up[k] for k in range(3)]
                length = math.sqrt(sum(c * c for c in ray))
                ray = [c / length for c in ray]
                t = 2.2
                for _ in range(40):
                    d = value([eye[k] + t * ray[k] for k in range(3)])
                    t += d
                    if d < 1e-3 or t > 7:
                        break
                if t < 7 and d < 1e-3:
                    t += rng.gauss(0, 2e-3)
                    p = [eye[k] + t * ray[k] for k in range(3)]
                    lines.append("%.4f %.4f %.4f %d" % (*p, 1000 / t))
    write(folder, "scan.xyz", "\n".join(lines) + "\n")
    scene(folder, "scan", "scan.xyz", """cellwarp-handles 1
# The creature bows and lifts one arm.
fixed  feet  box -2 -1 -2  2 0.25 2
handle head  sphere 0 2.08 0.05  0.42
handle hand  sphere 1.22 1.46 0.12  0.2
frame 1
move head rotate 1 0 0 35  translate 0 -0.15 0.35
move hand rotate 0 0 1 50  translate -0.15 0.6 0.1
""")


def rounded(value):
    return round(value, 6)


def carried(folder):
    """Scenes in time whose rods carry a model."""
    folder = os.path.join(folder, "rods")
    os.makedirs(folder, exist_ok=True)
    clamp = ["point", "tangent", "twist"]

    # A tentacle with suckers, 1 m long, whose root is turned to and fro.
    rings, around = 120, 20
    path = [(0.0, -i / (rings - 1), 0.0) for i in range(rings)]
    points, faces = tube(path, 1.0, around)
    for i in range(rings):
        share = i / (rings - 1)
        thick = 0.075 * (1 - share) ** 0.8 + 0.012
        for j in range(around):
            p = points[i * around + j]
            # Suckers on the side z > 0: two rows of bumps.
            angle = math.atan2(p[0], p[2])
            bump = sum(math.exp(-((angle - side) / 0.35) ** 2) for side in (-0.55, 0.55))
            size = thick * (1 + 0.3 * bump * max(0.0, math.sin(20 * math.pi * share)) ** 2)
            points[i * around + j] = (size * p[0], p[1], size * p[2])
    check_closed(faces)
    write(folder, "tentacle.obj", obj(points, faces, "a tentacle, 1 long"))
    keys = [{"time": 0}] + [
        {"time": rounded(0.25 + 0.4 * k), "rotate": [0.2, 0, 1, (-1) ** k * 55]}
        for k in range(5)]
    rod_scene(folder, "tentacle", [
        {"name": "tentacle", "through": [[0, -0.02 - 0.24 * k, 0] for k in range(5)], "spans": 6,
         "radius": [0.05, 0.03, 0.012], "E": 5e4, "carries": True,
         "fixed": [{"at": 0, "what": clamp, "keys": keys}]}],
        {"dt": 0.004, "duration": 1.8, "every": 0.06, "viscosity": 0.05},
        model="tentacle.obj")

    # The creature hangs on a rope that ends in its back; a body has its weight.
    rod_scene(folder, "hung", [
        {"name": "rope", "through": [[0, 4.2, 0.02], [0, 2.6, 0.02], [0, 1.3, 0.02]], "spans": 10,
         "radius": 0.03, "E": 3e6, "carries": True,
         "fixed": [{"at": 0, "keys": [{"time": 0}, {"time": 0.35, "translate": [0.9, 0, 0]},
                                      {"time": 0.7, "translate": [0, 0, 0]}]}]}],
        {"dt": 0.004, "duration": 2.4, "every": 0.06},
        bodies=[{"name": "weight", "mass": 20, "inertia": [0.13, 0.13, 0.13], "at": [0, 1.1, 0.02]}],
        connections=[{"a": "rod rope 1", "b": "body weight 0 0.2 0", "what": ["point", "frame"]}],
        model="../creature.obj")

    # A sheet of tissue with a gaping slit: a thread through both lips draws them together.
    half, thick, slit, gap = (0.2, 0.15), 0.03, 0.12, 0.02
    around, rows, layers = 96, 14, 3

    def place(a, row, layer):
        turn = 2 * math.pi * a / around
        c, s = math.cos(turn), math.sin(turn)
        # The rim in the direction of the lip's point, both ends of the way between them.
        rim = min(half[0] / max(1e-9, abs(c)), half[1] / max(1e-9, abs(s)))
        share = (row / rows) ** 1.4
        return (slit * c + share * (rim * c - slit * c), thick * (layer / layers - 0.5),
                gap * s + share * (rim * s - gap * s))

    numbers, points, faces = {}, [], []

    def vertex(a, row, layer):
        key = (a % around, row, layer)
        if key not in numbers:
            numbers[key] = len(points)
            points.append(place(*key))
        return numbers[key]

    for a in range(around):
        for row in range(rows):
            for layer in (0, layers):
                quad = [vertex(a, row, layer), vertex(a, row + 1, layer),
                        vertex(a + 1, row + 1, layer), vertex(a + 1, row, layer)]
                faces.append(quad if layer == 0 else quad[::-1])
        for layer in range(layers):
            for row in (0, rows):
                quad = [vertex(a, row, layer), vertex(a + 1, row, layer),
                        vertex(a + 1, row, layer + 1), vertex(a, row, layer + 1)]
                faces.append(quad if row == 0 else quad[::-1])
    check_closed(faces)
    write(folder, "tissue.obj", obj(points, faces, "a sheet of tissue with a slit"))
    write(folder, "stitch.handles", """cellwarp-handles 1
# The sheet is held by its rim.
fixed left  box -1 -1 -1  -0.19 1 1
fixed right box 0.19 -1 -1  1 1 1
fixed near  box -1 -1 -1  1 1 -0.14
fixed far   box -1 -1 0.14  1 1 1
""")
    # Loops of thread, each through both lips; where its ends are drawn up it becomes narrow.
    stitches = []
    for k in range(5):
        x = rounded(0.044 * (k - 2))
        edge = gap * math.sqrt(1 - (x / slit) ** 2)
        loop = [(0.06, 0.004), (0.035, edge + 0.012), (0.0, edge + 0.02), (-0.012, edge)]
        way = ([[x, y, rounded(-z)] for y, z in loop] + [[x, -0.014, 0]] +
               [[x, y, rounded(z)] for y, z in loop[::-1]])
        up = [{"time": 0}, {"time": 0.9, "translate": [0, 0.03, 0]}]
        stitches.append({"name": "stitch%d" % k, "through": way, "spans": 2, "radius": 0.002,
                         "E": 1e7, "carries": True,
                         "fixed": [{"at": 0, "keys": up}, {"at": 1, "keys": up},
                                   {"at": 0.5, "what": clamp}]})
    rod_scene(folder, "stitch", stitches,
              {"dt": 0.005, "duration": 1, "every": 0.1, "gravity": [0, 0, 0],
               "viscosity": 0.5},
              model="tissue.obj", handles="stitch.handles")


def rod_scene(folder, name, rods, simulate, **more):
    write(folder, name + ".json",
          json.dumps({"cellwarp": 1, "rods": rods, **more, "simulate": simulate}, indent=1) +
          "\n")


def square_net(points, columns, stiffness):
    """Springs between neighbours in a grid, half as stiff along its diagonals."""
    springs = []
    for a in range(len(points)):
        across = a % columns + 1 < columns
        if across:
            springs.append([a, a + 1, stiffness])
        if a + columns < len(points):
            springs.append([a, a + columns, stiffness])
            if across:
                springs += [[a, a + columns + 1, stiffness / 2],
                            [a + 1, a + columns, stiffness / 2]]
    return springs


def rods(folder):
    folder = os.path.join(folder, "rods")
    os.makedirs(folder, exist_ok=True)
    clamp = ["point", "tangent", "twist"]
    # A metre of rubber, clamped, under its own weight.
    rod_scene(folder, "cantilever", [
        {"name": "cantilever", "through": [[0, 0, 0], [1, 0, 0]], "spans": 16,
         "radius": 0.02, "E": 2e6, "fixed": [{"at": 0, "what": clamp}]}],
        {"integrator": "static"})
    # A steel cable of 12 mm, half as long again as its span.
    cable = [[1.6 * (k / 8 - 0.5), -0.55 * (1 - (k / 4 - 1) ** 2), 0] for k in range(9)]
    rod_scene(folder, "cable", [
        {"name": "cable", "through": cable, "spans": 5, "radius": 0.006, "E": 2e8,
         "density": 7800, "rest": "straight", "fixed": [{"at": 0}, {"at": 1}]}],
        {"integrator": "static"})
    # A rope falls from level and swings.
    rod_scene(folder, "pendulum", [
        {"name": "rope", "through": [[0, 0, 0], [1, 0, 0]], "spans": 24, "radius": 0.01,
         "E": 1e6, "fixed": [{"at": 0}]}],
        {"dt": 0.002, "duration": 1.2, "every": 0.1})
    # A ring that is straight at rest, with four turns put in: beyond 2.25 it jumps.
    ring = [[math.cos(2 * math.pi * k / 48), math.sin(2 * math.pi * k / 48),
             0.01 * math.sin(4 * math.pi * k / 48)] for k in range(48)]
    rod_scene(folder, "ring", [
        {"name": "ring", "points": ring, "closed": True, "radius": 0.03, "E": 1e7,
         "rest": "straight", "link": 4}],
        {"dt": 0.002, "duration": 2.0, "every": 0.1, "gravity": [0, 0, 0], "viscosity": 1})
    # A curtain's upper edge: three places keep to a stick.
    edge = [[0.1 * k, 0.15 * math.sin(1.9 * k), 0.1 * math.cos(2.3 * k)] for k in range(16)]
    rod_scene(folder, "stick", [
        {"name": "edge", "points": edge, "radius": 0.01, "E": 1e6,
         "on": [{"at": at, "axis": [0, 0, 0, 1, 0, 0]} for at in (0, 0.5, 1)]}],
        {"dt": 0.002, "duration": 1.0, "every": 0.1, "viscosity": 0.5})
    # Thirty points, six scalar constraints.
    rod_scene(folder, "six", [
        {"name": "rope", "points": [[k / 29, 0.05 * math.sin(k), 0] for k in range(30)],
         "radius": 0.01, "E": 1e6,
         "on": [{"at": 0, "point": [0, 0, 0]},
                {"at": 0.5, "axis": [0.5, 0, 0, 1, 0, 0]},
                {"at": 1, "plane": [0, 1, 0, 0]}]}],
        {"dt": 0.002, "duration": 1.0, "every": 0.1})
    # Fifty points, thrown.
    rod_scene(folder, "free", [
        {"name": "rod", "points": [[k / 49, 0.1 * math.sin(k / 8), 0] for k in range(50)],
         "radius": 0.01, "E": 1e6, "rest": "straight", "velocity": [0.5, 4, 0]}],
        {"dt": 0.002, "duration": 0.8, "every": 0.1})
    # Four rods of 15 points, by springs, fall over a bar that holds their middles.
    rod_scene(folder, "four", [
        {"name": "rod%d" % k, "through": [[-0.5, 0, 0.12 * k], [0.5, 0, 0.12 * k]],
         "spans": 12, "radius": 0.012, "E": 2e5, "elasticity": "discrete",
         "fixed": [{"at": 0.5}]} for k in range(4)],
        {"dt": 0.002, "duration": 0.6, "every": 0.1, "viscosity": 0.2})
    # Four short ones of 10 points, Green strain.
    rod_scene(folder, "short", [
        {"name": "rod%d" % k, "through": [[0, 0, 0.12 * k], [0.3, 0, 0.12 * k]],
         "spans": 7, "radius": 0.01, "E": 1e5 * 2 ** k, "elasticity": "continuous",
         "fixed": [{"at": 0, "what": clamp}]} for k in range(4)],
        {"dt": 0.002, "duration": 0.6, "every": 0.1})
    # Eleven rods of 15 points from one row, by springs.
    rod_scene(folder, "bundle", [
        {"name": "rod%d" % k,
         "through": [[0, 0, 0.04 * k], [0.5 + 0.02 * k, 0.1 * math.sin(k), 0.04 * k]],
         "spans": 12, "radius": 0.008, "E": 3e5, "elasticity": "discrete",
         "fixed": [{"at": 0, "what": clamp}]} for k in range(11)],
        {"dt": 0.002, "duration": 0.9, "every": 0.15})
    # Two ropes through holes off their middles: one sticks, one runs off and falls.
    rod_scene(folder, "hole", [
        {"name": name, "through": [[-0.6, 0, z], [0.6, 0, z]], "spans": 44, "radius": 0.01,
         "E": 1e6,
         "on": [{"at": "sliding", "point": [0.08, 0, z], "end": "release",
                 "friction": friction}]}
        for name, z, friction in (("rough", 0, [0.5, 0.4]), ("smooth", 0.3, 0))],
        {"dt": 0.002, "duration": 1.25, "every": 0.25, "viscosity": 0.6})
    joined_rods(folder)
    touching_rods(folder)
    sheets(folder)


def sheets(folder):
    """Surfaces and volumes of splines."""
    cloth = {"counts": [8, 8], "E": 1e5, "thickness": 0.002, "density": 500, "viscosity": 2}
    # One cloth hangs from two corners, one slides off a nail.
    rod_scene(folder, "patch", [], {"dt": 0.005, "duration": 1.5, "every": 0.3}, sheets=[
        {"name": "hanging", "corner": [-0.5, 0, -0.5], "sides": [[1, 0, 0], [0, 0, 1]],
         "fixed": [[0, 0], [1, 0]], **cloth},
        {"name": "sliding", "corner": [0.8, 0, -0.5], "sides": [[1, 0, 0], [0, 0, 1]],
         "fixed": [[0, 0], [0, 1]], "over": [[1.35, 0, 0.02]], **cloth}])
    # A soft block from a wall.
    rod_scene(folder, "block", [], {"dt": 0.01, "duration": 1.5, "every": 0.3}, sheets=[
        {"name": "block", "sides": [[0.25, 0, 0], [0, 0.25, 0], [0, 0, 0.9]],
         "counts": [4, 4, 7], "E": 1e5, "density": 500, "viscosity": 1,
         "fixed": [[a / 3, b / 3, 0] for a in range(4) for b in range(4)]}])
    # A thread through six holes of two cloths pulls their edges together.
    points, joints = [[-0.45, 0.1, -0.06]], []
    for k in range(6):
        x, side = -0.25 + 0.1 * k, k % 2
        points.append([round(x, 6), 0, 0.08 if side else -0.08])
        joints.append({"a": "rod thread sliding", "b": "sheet %s %g %g" % (
            ("left", "right")[side], round((x + 0.4) / 0.8, 6),
            round(0.04 / 0.44 if side else 0.4 / 0.44, 6))})
    points.append([0.5, 0.1, 0.1])
    cloth.update(counts=[9, 6], E=3e4, thickness=0.004, viscosity=4)
    rod_scene(folder, "seam", [
        {"name": "thread", "through": points, "spans": 3, "radius": 0.006, "E": 1e6,
         "rest": "straight",
         "fixed": [{"at": 0}, {"at": 1, "keys": [
             {"time": 0}, {"time": 1.2, "translate": [0.35, 0.1, 0.02]}]}]}],
        {"dt": 0.002, "duration": 1.5, "every": 0.3, "viscosity": 0.3,
         "gravity": [0, -1, 0]},
        sheets=[{"name": "left", "corner": [-0.4, 0, -0.48], "sides": [[0.8, 0, 0],
                                                                      [0, 0, 0.44]],
                 "fixed": [[0, 0], [1, 0]], **cloth},
                {"name": "right", "corner": [-0.4, 0, 0.04], "sides": [[0.8, 0, 0],
                                                                      [0, 0, 0.44]],
                 "fixed": [[0, 1], [1, 1]], **cloth}],
        connections=joints)


def touching_rods(folder):
    # Bezier pieces whose handles are in line: a U that swings without a hinge.
    count, handle = 6, 4 / 3 * math.tan(math.pi / 24) * 0.2
    u = [[-0.2, 0.4, 0], [-0.2, 0.3, 0], [-0.2, 0.2, 0]]
    for k in range(count + 1):
        turn = math.pi * k / count
        at = [-0.2 * math.cos(turn), 0.1 - 0.2 * math.sin(turn)]
        along = [handle * math.sin(turn), -handle * math.cos(turn)]
        u += [[round(x + side * d, 6) for x, d in zip(at, along)] + [0]
              for side in (-1, 0, 1)
              if (k > 0 or side >= 0) and (k < count or side <= 0)]
    u += [[0.2, 0.2, 0], [0.2, 0.3, 0], [0.2, 0.4, 0]]
    rod_scene(folder, "u", [
        {"name": "u", "points": u, "spline": "bezier", "radius": 0.01, "E": 2e6,
         "EI": [0.002, 0.02], "GJ": 0.01, "normal": [0, 0, 1], "damping": 0.02,
         "fixed": [{"at": 0, "what": ["point", "tangent", "twist"]},
                   {"at": 1, "until": 0.1}]}],
        {"dt": 0.001, "duration": 0.6, "every": 0.1})
    # A hanging rope is cut, and once more on its way down.
    rod_scene(folder, "cut", [
        {"name": "rope", "through": [[0, 1.2, 0], [0.25, 0.9, 0], [0.5, 0.85, 0],
                                     [0.75, 0.9, 0], [1, 1.2, 0]],
         "spans": 5, "radius": 0.012, "E": 1e6, "rest": "straight",
         "fixed": [{"at": 0}, {"at": 1}],
         "cut": [{"at": 0.45, "time": 0.15}, {"at": 0.7, "time": 0.25}]}],
        {"dt": 0.001, "duration": 0.75, "every": 0.15},
        obstacles=[{"plane": [0, 1, 0, 0]}], rod_contact={"friction": 0.4})
    # An overhand knot is pulled tight and loosened again; knots of the spline come and go.
    def overhand(refine):
        points = []
        for k in range(11):
            t = -2.15 + 0.43 * k
            points.append([round(0.033 * x, 6) for x in (
                0.22 * (t ** 5 - 10 * t), 0.45 * (t ** 4 - 4 * t * t), t ** 3 - 3 * t)])

        def keys(side):
            return [{"time": 0}, {"time": 1.8, "translate": [0.17 * side, 0, 0]},
                    {"time": 2.2, "translate": [0.17 * side, 0, 0]},
                    {"time": 3.8, "translate": [-0.03 * side, 0, 0]}]
        rope = {"name": "rope", "through": points, "spans": 1, "radius": 0.004, "E": 1e6,
                "density": 1100, "rest": "straight",
                "fixed": [{"at": 0, "keys": keys(-1)}, {"at": 1, "keys": keys(1)}]}
        if refine:
            rope["refine"] = {"insert": 1.5, "remove": 1.2, "tolerance": 0.03}
        return rope
    for name, refine in (("knot", True), ("knot_fixed", False)):
        rod_scene(folder, name, [overhand(refine)],
                  {"dt": 0.002, "duration": 4.0, "every": 0.2, "gravity": [0, 0, 0],
                   "viscosity": 0.3},
                  rod_contact={"friction": 0.05})
    # Eleven rods of 15 points, by springs, fall on a heap.
    random.seed(3)
    rods = []
    for k in range(11):
        turn = math.pi * (k % 2) / 2 + 0.2 * (random.random() - 0.5)
        off = [0.06 * (random.random() - 0.5), 0.06 * (random.random() - 0.5)]
        c, s = 0.2 * math.cos(turn), 0.2 * math.sin(turn)
        height = round(0.05 + 0.035 * k, 6)
        rods.append({"name": "rod%d" % k,
                     "through": [[round(off[0] - c, 6), height, round(off[1] - s, 6)],
                                 [round(off[0] + c, 6), height, round(off[1] + s, 6)]],
                     "spans": 12, "radius": 0.008, "E": 5e5, "elasticity": "discrete"})
    rod_scene(folder, "pile", rods, {"dt": 0.001, "duration": 1.0, "every": 0.1},
              obstacles=[{"plane": [0, 1, 0, 0]}], rod_contact={"friction": 0.3})
    # A rod that keys lead pushes a free one.
    clamp = ["point", "tangent", "twist"]
    rod_scene(folder, "pushed", [
        {"name": "led", "through": [[0, 0, -0.2], [0, 0, 0], [0, 0, 0.2]], "radius": 0.01,
         "E": 1e8, "fixed": [{"at": at, "what": clamp, "keys": [
             {"time": 0}, {"time": 0.5, "translate": [1, 0, 0]}]} for at in (0, 1)]},
        {"name": "free", "through": [[0.1, -0.2, 0], [0.1, 0, 0], [0.1, 0.2, 0]],
         "radius": 0.01, "E": 1e6}],
        {"dt": 0.002, "duration": 0.2, "every": 0.05, "gravity": [0, 0, 0]}, rod_contact=True)
    # A rope is pulled over a ball against a load: a capstan of half a turn.
    rope = [[-0.105, round(-0.1 + 0.02 * k, 6), 0] for k in range(5)]
    for k in range(33):
        turn = math.pi * k / 32
        rope.append([round(-0.105 * math.cos(turn), 6), round(0.105 * math.sin(turn), 6), 0])
    rope += [[0.105, round(-0.02 * k, 6), 0] for k in range(1, 6)]
    rod_scene(folder, "capstan", [
        {"name": "rope", "through": rope, "spans": 3, "radius": 0.005, "E": 1e6,
         "EI": [1e-6, 1e-6], "GJ": 1e-6, "rest": "straight", "density": 500,
         "loads": [{"at": 0, "force": [0, -1, 0]}],
         "fixed": [{"at": 1, "keys": [{"time": 0}, {"time": 0.1},
                                      {"time": 0.6, "translate": [0, -0.06, 0]}]}]}],
        {"dt": 0.001, "duration": 0.6, "every": 0.2, "gravity": [0, 0, 0], "viscosity": 0.02,
         "report": ["forces", "sections"]},
        obstacles=[{"sphere": [0, 0, 0, 0.1]}], rod_contact={"friction": 0.3, "self": False})
    # Three ropes fall on the creature.
    rod_scene(folder, "drape", [
        {"name": "rope%d" % k,
         "through": [[-1.6, round(2.7 + 0.12 * k, 6), round(0.12 * k - 0.1, 6)],
                     [1.6, round(2.7 + 0.12 * k, 6), round(0.12 * k - 0.1, 6)]],
         "spans": 24, "radius": 0.045, "E": 3e5} for k in range(3)],
        {"dt": 0.001, "duration": 1.0, "every": 0.2, "viscosity": 1},
        obstacles=[{"mesh": "../creature.obj"}, {"plane": [0, 1, 0, -0.06]}],
        rod_contact={"friction": 0.5, "stiffness": 6e4})
    # A soft tube of 165 points falls together in a box.
    coil = []
    for k in range(55):
        t = k / 54
        turn = 2 * math.pi * 6.5 * t
        radius = 0.08 + 0.012 * math.sin(2.3 * turn)
        coil.append([round(radius * math.cos(turn), 6), round(0.04 + 0.26 * t, 6),
                     round(0.8 * radius * math.sin(turn), 6)])
    rod_scene(folder, "intestine", [
        {"name": "intestine", "through": coil, "spans": 3, "radius": 0.012, "E": 1.5e5,
         "density": 1050, "skin": True}],
        {"dt": 0.001, "duration": 1.0, "every": 0.1, "viscosity": 0.2},
        obstacles=[{"plane": plane} for plane in (
            [0, 1, 0, 0], [1, 0, 0, -0.11], [-1, 0, 0, -0.11], [0, 0, 1, -0.085],
            [0, 0, -1, -0.085])],
        rod_contact={"friction": 0.1})


def joined_rods(folder):
    # Rubber pulled through a hole: it sticks, stretches, slips.
    rod_scene(folder, "thread", [
        {"name": "thread", "through": [[-0.7, 0, 0], [0, 0, 0], [0, -0.9, 0]], "spans": 20,
         "radius": 0.01, "E": 5e4, "rest": "straight",
         "on": [{"at": "sliding", "point": [0, 0, 0], "friction": [0.6, 0.1]}],
         "fixed": [{"at": 0, "keys": [{"time": 0}, {"time": 2, "translate": [-0.7, 0, 0]}]}],
         "loads": [{"at": 1, "force": [0, -1.5, 0]}]}],
        {"dt": 0.002, "duration": 2.0, "every": 0.4, "viscosity": 0.3})
    # A shoelace through twelve eyelets of two flaps, pulled tight.
    middle = {"left": -0.055, "right": 0.055}
    down = [("right" if (5 - k) % 2 else "left", k) for k in range(5, -1, -1)]
    eyelets = down + [("left" if side == "right" else "right", k) for side, k in down[::-1]]
    points, at = [[-0.1, 0.24, 0.03]], None
    for side, k in eyelets:
        last, at = at, [0.04 if side == "right" else -0.04, rounded(0.03 * k), 0]
        if last:
            points.append([rounded((a + b) / 2) for a, b in zip(last, at)][:2] + [0.008])
        points.append(at)
    points.append([0.1, 0.24, 0.03])
    joints = [{"a": "rod lace sliding", "friction": 0.05,
               "b": "body %s %g %g 0" % (side, (0.04 if side == "right" else -0.04) -
                                         middle[side], 0.03 * k - 0.075)}
              for side, k in eyelets]
    joints += [{"a": "rod sole %d" % end, "b": "body %s 0 -0.09 0" % side,
                "what": ["point", "frame"]} for end, side in enumerate(middle)]
    mass, a, b, c = 0.05, 0.03, 0.18, 0.006
    inertia = [rounded(mass / 12 * (p * p + q * q)) for p, q in ((b, c), (a, c), (a, b))]
    inertia[2] = inertia[0] + inertia[1] - 3e-7
    rod_scene(folder, "lace", [
        {"name": "lace", "through": points, "spans": 1, "radius": 0.002, "E": 3e6,
         "loads": [{"at": 0, "force": [-0.5, 1.2, 0]}, {"at": 1, "force": [0.5, 1.2, 0]}]},
        {"name": "sole", "through": [[-0.055, -0.015, 0], [0.055, -0.015, 0]], "spans": 6,
         "radius": 0.004, "E": 4e6,
         "fixed": [{"at": 0.5, "what": ["point", "tangent", "twist"]}]}],
        {"dt": 0.001, "duration": 0.3, "every": 0.05, "gravity": [0, 0, 0],
         "viscosity": 0.3},
        bodies=[{"name": side, "mass": mass, "inertia": inertia,
                 "at": [middle[side], 0.075, 0]} for side in middle], connections=joints)
    # A thread through the edges of two nets, pulled by its needle.
    nets = []
    for name, side in (("left", -1), ("right", 1)):
        grid = [[rounded(side * (0.06 + 0.1 * i)), rounded(0.1 * j), 0]
                for j in range(5) for i in range(4)]
        nets.append({"name": name, "points": grid, "springs": square_net(grid, 4, 60),
                     "mass": 0.1, "fixed": [4 * j + 3 for j in range(5)]})
    holes = [(name, j) for j in range(5) for name in ("left", "right")]
    points = []
    for i, (name, j) in enumerate(holes):
        at = [-0.06 if name == "left" else 0.06, rounded(0.1 * j), 0]
        if i:
            points.append([rounded((points[-1][k] + at[k]) / 2) for k in (0, 1)] +
                          [0.03 if i % 2 else -0.03])
        points.append(at)
    points += [[0.05, 0.43, 0.1], [0.04, 0.44, 0.25], [0.04, 0.44, 0.4]]
    rod_scene(folder, "suture", [
        {"name": "thread", "through": points, "spans": 1, "radius": 0.004, "E": 2e7,
         "fixed": [{"at": 1, "keys": [{"time": 0},
                                      {"time": 1.2, "translate": [0, 0, 0.55]}]}]}],
        {"dt": 0.002, "duration": 1.2, "every": 0.24, "gravity": [0, 0, 0],
         "viscosity": 0.2}, nets=nets,
        connections=[{"a": "rod thread 0", "b": "net left 0"}] +
               [{"a": "rod thread sliding", "b": "net %s %d" % (name, 4 * j)}
                for name, j in holes[1:]])
    # A rope's end on the rope itself, its noose round something that holds it.
    points = [[rounded(-0.6 + 0.2 * k), 0, 0] for k in range(4)]
    for k in range(1, 9):
        turn = math.pi * (2 * k / 9 - 0.5)
        points.append([rounded(0.22 * math.cos(turn) + 0.02),
                       rounded(0.22 + 0.22 * math.sin(turn)),
                       rounded(0.02 * math.sin(turn))])
    points.append([-0.05, 0, 0])
    rod_scene(folder, "slipknot", [
        {"name": "rope", "through": points, "spans": 2, "radius": 0.012, "E": 4e5,
         "fixed": [{"at": 0, "keys": [{"time": 0}, {"time": 1.5,
                                                    "translate": [-0.75, 0, 0]}]},
                   {"at": 0.62}],
         "on": [{"at": 1, "rod": "rope", "other": "sliding"}]}],
        {"dt": 0.002, "duration": 1.5, "every": 0.3, "gravity": [0, 0, 0], "viscosity": 2})
    # A swing: two ropes and a seat that stays straight.
    ropes = [{"name": "rope%d" % k, "through": [[x, 0, 0], [x, -1.5, 0]], "spans": 7,
              "radius": 0.01, "E": 2e7, "fixed": [{"at": 0}]} for k, x in ((0, -0.3), (1, 0.3))]
    seat = {"name": "seat", "through": [[-0.3, -1.5, 0], [0.3, -1.5, 0]], "spans": 7,
            "radius": 0.02, "E": 1e7, "velocity": [0, 0, 3],
            "fixed": [{"at": rounded(k / 7), "what": ["curvature"]} for k in range(8)]}
    rod_scene(folder, "swing", ropes + [seat], {"dt": 0.002, "duration": 1.6, "every": 0.32},
              connections=[{"a": "rod rope%d 1" % k, "b": "rod seat %d" % k,
                       "what": ["point", "frame"]} for k in (0, 1)])
    # Four ropes hold a net, on which a plate lies.
    grid = [[rounded(0.15 * (i - 2)), 0, rounded(0.15 * (j - 2))]
            for j in range(5) for i in range(5)]
    corners = (0, 4, 20, 24)
    ropes = [{"name": "rope%d" % k, "through": [[rounded(1.4 * grid[c][0]), 0.9,
                                                 rounded(1.4 * grid[c][2])], grid[c]],
              "spans": 5, "radius": 0.006, "E": 1e7, "fixed": [{"at": 0}]}
             for k, c in enumerate(corners)]
    below = (2, 6, 7, 8, 11, 12, 13, 16, 17, 18)
    rod_scene(folder, "net", ropes, {"dt": 0.002, "duration": 1.2, "every": 0.24},
              bodies=[{"name": "plate", "mass": 0.6, "inertia": [0.0055, 0.0105, 0.0055]}],
              nets=[{"name": "net", "points": grid, "springs": square_net(grid, 5, 400),
                     "mass": 0.4}],
              connections=[{"a": "rod rope%d 1" % k, "b": "net net %d" % c}
                      for k, c in enumerate(corners)] +
                     [{"a": "body plate %g 0 %g" % (grid[q][0], grid[q][2]),
                       "b": "net net %d" % q} for q in below])
    # Beads on a closed thread, all of them on a ball, slide off it.
    ball, bead, mass, height = 0.5, 0.03, 0.01, 0.3
    ring = math.sqrt(ball ** 2 - height ** 2)
    on_ring = lambda turn: [rounded(ring * math.cos(turn)), height,
                            rounded(ring * math.sin(turn))]
    bodies = [{"name": "ball", "inertia": [rounded(0.4 * (ball - bead) ** 2)] * 3,
               "keys": [{"time": 0}]}]
    joints = []
    for k in range(14):
        name = "bead%d" % k
        bodies.append({"name": name, "mass": mass, "inertia": [0.4 * mass * bead ** 2] * 3,
                       "at": on_ring(2 * math.pi * (k + 0.5 + 0.3 * math.sin(2.5 * k)) / 14)})
        joints += [{"a": "rod thread sliding", "b": "body %s 0 0 0" % name, "apart": 0.062},
                   {"a": "body ball 0 0 0", "b": "body %s 0 0 0" % name,
                    "what": ["distance"]}]
    rod_scene(folder, "necklace", [
        {"name": "thread", "through": [on_ring(2 * math.pi * k / 28) for k in range(28)],
         "closed": True, "spans": 1, "radius": 0.006, "E": 2e6}],
        {"dt": 0.002, "duration": 0.75, "every": 0.15, "viscosity": 0.05,
         "gravity": [2, -9.6, 0]}, bodies=bodies, connections=joints)


def drawing(folder):
    """Lines alone: a tree in a pot, its branches as polylines."""
    points, lines = [], []

    def line(*path):
        first = len(points)
        points.extend(path)
        lines.append(range(first, len(points)))

    def circle(x, y, r, around=24):
        return [(x + r * math.sin(2 * math.pi * k / around),
                 y - r * math.cos(2 * math.pi * k / around), 0.0) for k in range(around + 1)]

    def curve(a, b, bow, parts=8):
        dx, dy = b[0] - a[0], b[1] - a[1]
        return [(a[0] + t * dx - bow * math.sin(math.pi * t) * dy,
                 a[1] + t * dy + bow * math.sin(math.pi * t) * dx, 0.0)
                for t in (k / parts for k in range(parts + 1))]

    line((-0.45, 0.5, 0), (-0.32, 0, 0), (0.32, 0, 0), (0.45, 0.5, 0), (-0.45, 0.5, 0))
    trunk = curve((0, 0.5), (0.05, 1.3), 0.06) + curve((0.05, 1.3), (0, 2.1), -0.06)[1:]
    line(*trunk)
    for k, b, bow, r in ((8, (0.85, 1.75), -0.15, 0.16), (5, (-0.75, 1.5), 0.15, 0.14),
                         (11, (-0.5, 2.2), 0.12, 0.12)):
        a = trunk[k]
        line(*curve(a, b, bow))
        length = math.hypot(b[0] - a[0], b[1] - a[1])
        line(*circle(b[0] + r * (b[0] - a[0]) / length, b[1] + r * (b[1] - a[1]) / length, r))
    line(*circle(0.0, 2.35, 0.25))
    text = ["# a drawn tree in a pot, lines"]
    text += ["v %.6g %.6g %.6g" % p for p in points]
    text += ["l " + " ".join(str(i + 1) for i in path) for path in lines]
    write(folder, "drawing.obj", "\n".join(text) + "\n")
    scene(folder, "drawing", "drawing.obj", """cellwarp-handles 1
# The pot stands, wind takes the crown, then lets it swing back beyond the middle.
fixed  pot   box -0.6 -0.1 -1  0.6 0.45 1
handle crown sphere 0 2.35 0  0.3
frame 1
move crown rotate 0 0 1 -50 about 0 0.9 0
frame 2
move crown rotate 0 0 1 30 about 0 0.9 0
""")


def tower(folder, around=48, rows=60):
    """Open at its foot, with windows: a shell, unless it is closed."""
    points, faces = [], []
    for j in range(rows + 1):
        r = 0.5 + 0.06 * ((j // 15) % 2)
        points += [(r * math.cos(2 * math.pi * i / around), 4 * j / rows,
                    r * math.sin(2 * math.pi * i / around)) for i in range(around)]
    for j in range(rows):
        for i in range(around):
            if j % 15 in (6, 7, 8) and i % 12 in (4, 5):
                continue
            a, b = j * around + i, j * around + (i + 1) % around
            faces.append([a, a + around, b + around, b])
    points.append((0, 4.8, 0))
    faces += [[rows * around + i, len(points) - 1, rows * around + (i + 1) % around]
              for i in range(around)]
    used = sorted({i for face in faces for i in face})
    number = {i: k for k, i in enumerate(used)}
    write(folder, "tower.obj", obj([points[i] for i in used],
                                   [[number[i] for i in face] for face in faces],
                                   "a tower with windows, open at its foot"))
    scene(folder, "tower", "tower.obj", """cellwarp-handles 1
# Its foot stands, its top is turned.
fixed  foot  box -1 -1 -1  1 0.3 1
handle top   box -1 3.7 -1  1 5 1
frame 1
move top rotate 0 1 0 120
""", ',\n  "cells": {"fill": "closed"}')


def main():
    here = os.path.dirname(os.path.abspath(__file__))
    folder = sys.argv[1] if len(sys.argv) > 1 else os.path.join(here, "..", "samples")
    if folder.startswith("-"):
        sys.exit(__doc__)
    os.makedirs(folder, exist_ok=True)
    wanted = sys.argv[2:]
    for make in (bar, plate, block, creature, vase, cloud, hand, coil, chain, figure, drawing,
                 tower, soup, scan, hose, ring, posed, skeletons, flesh, rods, carried):
        if not wanted or make.__name__ in wanted:
            make(folder)
            print("made", make.__name__)


if __name__ == "__main__":
    main()
