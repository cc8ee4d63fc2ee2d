#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Puts the frames of a simulation side by side into one model, to be drawn as a strip.

usage: film_strip.py OUT.obj FRAME.obj...
"""
import sys


def main():
    vertices, faces, shift = [], [], 0.0
    for name in sys.argv[2:]:
        points, own = [], []
        with open(name, encoding="utf-8") as file:
            for line in file:
                words = line.split()
                if words and words[0] == "v":
                    points.append([float(x) for x in words[1:4]])
                elif words and words[0] == "f":
                    own.append([int(x) + len(vertices) for x in words[1:]])
        low, high = min(p[0] for p in points), max(p[0] for p in points)
        vertices += [[p[0] - low + shift, p[1], p[2]] for p in points]
        faces += own
        shift += 1.1 * (high - low) + 0.05
    with open(sys.argv[1], "w", encoding="utf-8") as out:
        out.writelines("v %.6g %.6g %.6g\n" % tuple(p) for p in vertices)
        out.writelines("f " + " ".join(map(str, face)) + "\n" for face in faces)


if __name__ == "__main__":
    main()
