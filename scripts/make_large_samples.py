#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
# By its path: numpy comes from Debian, for Debian's python3.
"""Makes samples that are too large to ship, in the space of the sample creature: a field
saved from samples/creature.json applies to them.

usage: make_large_samples.py FOLDER [scan|soup ...]   (default: both)

scan  big-scan.ply: a million points with colours and normals, seen by a scanner from nine
      places, with noise, missing echoes and holes
soup  big-soup.stl: a hundred thousand loose triangles in random order
"""
import os
import sys

import numpy

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from make_samples import creature_parts  # noqa: E402

SMOOTH = 0.045  # of the union of the limbs, as in the sample


def distance(p):
    """Of points to the creature, about."""
    parts = []
    for a, b, ra, rb in creature_parts():
        a, ab = numpy.array(a), numpy.subtract(b, a)
        t = numpy.clip((p - a) @ ab / max(1e-12, ab @ ab), 0.0, 1.0)
        parts.append(numpy.linalg.norm(p - a - t[:, None] * ab, axis=1) - (ra + t * (rb - ra)))
    parts = numpy.array(parts)
    least = parts.min(axis=0)
    return least - SMOOTH * numpy.log(numpy.exp((least - parts) / SMOOTH).sum(axis=0))


def normals(p):
    step = 1e-4 * numpy.eye(3)
    g = numpy.stack([distance(p + h) - distance(p - h) for h in step], axis=1)
    return g / numpy.linalg.norm(g, axis=1)[:, None]


def seen_from(eye, rng, rows, columns):
    """Where the rays of a scanner at eye meet the creature."""
    ahead = numpy.array([0.0, 1.2, -0.1]) - eye
    ahead /= numpy.linalg.norm(ahead)
    side = numpy.array([-ahead[2], 0.0, ahead[0]])
    side /= numpy.linalg.norm(side)
    up = numpy.cross(side, ahead)
    x, y = numpy.meshgrid(numpy.linspace(-0.42, 0.42, columns), numpy.linspace(-0.4, 0.4, rows))
    keep = rng.random(x.size) > 0.04  # the others give no echo
    x = (x.ravel() + rng.normal(0, 1e-4, x.size))[keep]
    y = y.ravel()[keep]
    rays = ahead + x[:, None] * side + y[:, None] * up
    rays /= numpy.linalg.norm(rays, axis=1)[:, None]
    t = numpy.full(len(rays), 2.2)
    for _ in range(60):
        d = distance(eye + t[:, None] * rays)
        t += d
        going = (d > 1e-3) & (t < 7)
        rays, t = rays[t < 7], t[t < 7]
        if not going.any():
            break
    rays, t = rays[distance(eye + t[:, None] * rays) < 1e-3], \
        t[distance(eye + t[:, None] * rays) < 1e-3]
    return eye + (t + rng.normal(0, 1e-3, len(t)))[:, None] * rays


def scan(folder, count=1000000):
    rng = numpy.random.default_rng(11)
    seen = []
    for k in range(9):
        yaw = numpy.radians(25 + 40 * k)
        eye = numpy.array([4.5 * numpy.sin(yaw), (1.9, 1.2, 0.6)[k % 3], 4.5 * numpy.cos(yaw)])
        seen.append(seen_from(eye, rng, 930, 990))
        print("seen from place", k + 1, "of 9:", len(seen[-1]), "points")
    p = numpy.concatenate(seen)
    if len(p) < count:
        sys.exit("too few points were seen: %d" % len(p))
    p = p[rng.permutation(len(p))[:count]]
    n = numpy.concatenate([normals(some) for some in numpy.array_split(p, 20)])
    stripe = 0.5 + 0.5 * numpy.sin(14 * p[:, 1] + 3 * p[:, 0])
    colour = numpy.stack([0.9 - 0.3 * stripe, 0.5 + 0.3 * stripe, 0.3 + 0.2 * stripe], axis=1)
    record = numpy.zeros(count, dtype=[("p", "<f4", 3), ("n", "<f4", 3), ("c", "u1", 3)])
    record["p"], record["n"], record["c"] = p, n, 255 * colour
    with open(os.path.join(folder, "big-scan.ply"), "wb") as file:
        file.write(("ply\nformat binary_little_endian 1.0\ncomment a creature, scanned\n"
                    "element vertex %d\n" % count +
                    "".join("property float %s\n" % name
                            for name in ("x", "y", "z", "nx", "ny", "nz")) +
                    "".join("property uchar %s\n" % name for name in ("red", "green", "blue")) +
                    "end_header\n").encode())
        file.write(record.tobytes())


def soup(folder, count=100000):
    """The sample's quads, each cut into eight triangles, moved onto the surface."""
    points, quads = [], []
    with open(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "samples",
                           "creature.obj")) as file:
        for line in file:
            words = line.split()
            if words[:1] == ["v"]:
                points.append([float(word) for word in words[1:4]])
            elif words[:1] == ["f"]:
                quads.append([int(word) - 1 for word in words[1:5]])
    corners = numpy.array(points)[numpy.array(quads)]  # quad, corner, axis
    a, b, c, d = (corners[:, k] for k in range(4))
    grid = [[((2 - i) * ((2 - j) * a + j * d) + i * ((2 - j) * b + j * c)) / 4
             for j in range(3)] for i in range(3)]
    triangles = []
    for i in range(2):
        for j in range(2):
            q = grid[i][j], grid[i + 1][j], grid[i + 1][j + 1], grid[i][j + 1]
            triangles += [numpy.stack(q[:3], axis=1), numpy.stack((q[0], q[2], q[3]), axis=1)]
    t = numpy.concatenate(triangles)
    rng = numpy.random.default_rng(3)
    t = t[rng.permutation(len(t))[:count]]
    flat = t.reshape(-1, 3)
    for _ in range(3):
        flat -= distance(flat)[:, None] * normals(flat)
    n = numpy.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
    n /= numpy.maximum(1e-30, numpy.linalg.norm(n, axis=1))[:, None]
    record = numpy.zeros(count, dtype=[("n", "<f4", 3), ("t", "<f4", (3, 3)), ("s", "<u2")])
    record["n"], record["t"] = n, t
    with open(os.path.join(folder, "big-soup.stl"), "wb") as file:
        file.write(b"loose triangles of a creature, in random order".ljust(80))
        file.write(numpy.uint32(count).tobytes() + record.tobytes())


def main():
    if len(sys.argv) < 2 or any(name not in ("scan", "soup") for name in sys.argv[2:]):
        sys.exit(__doc__)
    os.makedirs(sys.argv[1], exist_ok=True)
    for make in (scan, soup):
        if len(sys.argv) == 2 or make.__name__ in sys.argv[2:]:
            make(sys.argv[1])
            print("made", make.__name__)


if __name__ == "__main__":
    main()
