# SPDX-License-Identifier: GPL-3.0-or-later
"""The plots of bench_report: logarithmic on both axes, every line named where it ends."""
import math
import os

import matplotlib
matplotlib.use("Agg")
import matplotlib.patheffects as patheffects  # noqa: E402
import matplotlib.pyplot as plt  # noqa: E402
import matplotlib.ticker as ticker  # noqa: E402

OWN, PEER, GREY = "#1f5fa8", "#c8501e", "#666666"
STAGES = (("cells", "material, cells", "#5b9bd5"), ("solve", "solve", "#3c9a75"),
          ("field", "release field", "#8f7fc0"))
PALETTE = (OWN, PEER, "#3c9a75", "#8f7fc0", "#b08a1e", GREY)

# Families of benchmarks that belong together: title, what the size counts, names.
PLOTS = (
    ("Solver over cells", "cells",
     ("solve", "factor", "newton_step", "solve_rest_factor", "multigrid_setup", "cg_step",
      "linearise")),
    ("Multigrid beside one factor at rest", "cells",
     ("solve", "solve_rest_factor", "multigrid_setup", "rest_factor_setup", "cg_step",
      "rest_factor_cg_step")),
    ("A frame over samples", "samples", ("frame", "frame solve", "frame blend")),
    ("One edit over cells", "cells", ("edit", "edit cells", "edit solve", "edit field")),
    ("A frame over cells", "cells", ("frame_cells", "frame_cells solve", "frame_cells blend")),
)
# What takes the place of another: dashed, in the colour of that one, by a shorter name.
STAND_INS = {"solve_rest_factor": ("solve", "rest factor"),
             "rest_factor_setup": ("multigrid_setup", "rest factor"),
             "rest_factor_cg_step": ("cg_step", "rest factor")}


def slope(points):
    """p of the best n^p through (n, seconds); None for less than two sizes."""
    logs = [(math.log(n), math.log(t)) for n, t in points if n > 0 and t > 0]
    if len({x for x, _ in logs}) < 2:
        return None
    x0 = sum(x for x, _ in logs) / len(logs)
    y0 = sum(y for _, y in logs) / len(logs)
    return sum((x - x0) * (y - y0) for x, y in logs) / sum((x - x0) ** 2 for x, _ in logs)


def new_axes(x_label, title):
    """Drawn at 1600 px, to be shown at 800: hence the large letters."""
    plt.rcParams.update({"font.size": 12, "font.family": "DejaVu Sans"})
    figure, axes = plt.subplots(figsize=(8, 4.8), dpi=200)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel(x_label)
    axes.set_title(title, loc="left", fontsize=12.5)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.grid(True, which="major", color="#e4e4e4", linewidth=0.8)
    axes.set_axisbelow(True)
    return figure, axes


def plain_number(value, _=None):
    if value >= 1e6:
        return "%g M" % (value / 1e6)
    return "{:,.0f}".format(value) if value >= 1 else "%g" % value


def duration(seconds, _=None):
    for unit, name in ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns")):
        if seconds >= 0.999 * unit:
            break
    return "{:,.4g} {}".format(seconds / unit, name)


def spread(places):
    """Heights of labels at (across, up), moved apart where they would cover each other."""
    line_height, text_width = 0.062, 0.3  # of the axes
    heights = [up for _, up in places]
    order = sorted(range(len(places)), key=lambda i: heights[i])
    for _ in range(100):
        for k, i in enumerate(order):
            for j in order[k + 1:]:
                push = line_height - (heights[j] - heights[i])
                if push > 0 and abs(places[i][0] - places[j][0]) < text_width:
                    heights[i] -= push / 2
                    heights[j] += push / 2
    return heights


def label_ends(axes, ends):
    """Names beside the ends (x, y, text, colour) of lines. The limits of the axes are final
    from here."""
    axes.set_xlim(axes.get_xlim())
    axes.set_ylim(axes.get_ylim())
    to_axes = axes.transData + axes.transAxes.inverted()
    places = [to_axes.transform(end[:2]) for end in ends]
    for (x, y, text, colour), (across, _), up in zip(ends, places, spread(places)):
        axes.annotate(text, (x, y), xytext=(across + 0.015, up), textcoords="axes fraction",
                      color=colour, va="center", annotation_clip=False, path_effects=[
                          patheffects.withStroke(linewidth=4, foreground="white")])


def save(figure, path):
    figure.savefig(path, bbox_inches="tight", pad_inches=0.12)
    plt.close(figure)


def line_of(results, value):
    """(vertices, value) of the scenes that have it, by size."""
    return sorted((r["vertices"], value(r)) for r in results if value(r) is not None)


def families_of(results):
    """Scenes of one shape in several sizes, and the others."""
    by_shape = {}
    for result in results:
        by_shape.setdefault(result["scene"].rstrip("0123456789km"), []).append(result)
    shapes = sorted(by_shape.values(), key=len, reverse=True)
    return shapes[0], [r for shape in shapes[1:] for r in shape]


def unfinished(results):
    return [r for r in results if "peer" in r and not r["peer"]["is_converged"]]


def draw_arrows(axes, results):
    """Where the peer ran out of time an arrow says that it takes longer."""
    for r in unfinished(results):
        x, y = r["vertices"], r["peer"]["seconds"]
        axes.annotate("", (x, 2.2 * y), (x, y), annotation_clip=False,
                      arrowprops={"arrowstyle": "->", "color": PEER, "linewidth": 1.8})
        axes.set_ylim(top=max(axes.get_ylim()[1], 2.5 * y))


def draw_peer(axes, family):
    """The peer to its stop, and one of its iterations."""
    points = [r for r in family if "peer" in r]
    if not points:
        return []
    line = line_of(points, lambda r: r["peer"]["seconds"])
    axes.plot(*zip(*line), color=PEER, linewidth=2.4, marker="o", markersize=5)
    one = line_of(points, lambda r: r["peer"]["iteration_seconds"])
    axes.plot(*zip(*one), color=PEER, linewidth=1.4, linestyle=(0, (5, 2)), marker="o",
              markersize=3)
    return [(*line[-1], "CGAL, ↑ unfinished" if unfinished(points) else "CGAL", PEER),
            (*one[-1], "one CGAL iteration", PEER)]


def draw_scene(axes, result):
    """A scene by itself, its name between its two points or above them."""
    values = [(result["cellwarp"]["edit"], OWN)]
    if "peer" in result:
        values.append((result["peer"]["seconds"], PEER))
    for seconds, colour in values:
        axes.plot(result["vertices"], seconds, color=colour, marker="D", markersize=6,
                  linestyle="none", markerfacecolor="white", markeredgewidth=1.6)
    low, high = min(values)[0], max(values)[0]
    axes.annotate(result["scene"], (result["vertices"], low if high > 5 * low else high),
                  xytext=(0, 8), textcoords="offset points", ha="center", color=GREY,
                  fontsize=11)


def plot_seconds(results, path):
    """Seconds of one edit against vertices. Scenes beside the largest family are points."""
    family, others = families_of(results)
    figure, axes = new_axes("vertices", "time for one edit")
    ends = draw_peer(axes, family)
    for stage, text, colour in STAGES:
        line = line_of(family, lambda r: r["cellwarp"][stage])
        axes.plot(*zip(*line), color=colour, linewidth=1.4, marker="o", markersize=3)
        ends.append((*line[-1], text, colour))
    line = line_of(family, lambda r: r["cellwarp"]["edit"])
    axes.plot(*zip(*line), color=OWN, linewidth=2.4, marker="o", markersize=5)
    ends.append((*line[-1], "cellwarp", OWN))
    for r in others:
        draw_scene(axes, r)
    draw_arrows(axes, results)
    axes.xaxis.set_major_formatter(ticker.FuncFormatter(plain_number))
    axes.yaxis.set_major_formatter(ticker.FuncFormatter(duration))
    label_ends(axes, ends)
    save(figure, path)


def usual_stop(points, tolerance):
    """The first point of the peer's curve that its stop test would end at."""
    return next((p for p in points if p["movement"] < tolerance), None)


def plot_error(curve, path):
    """Largest (full) and RMS (dashed) distance from the converged result."""
    figure, axes = new_axes("seconds", "%s: error of the vertices, of the diagonal" %
                            curve["scene"])
    # Below what the reference itself is off, a distance from it says nothing.
    floors = {"cellwarp": 0.0, "peer": curve["peer"]["reference"]["remaining"]}
    for who, name, colour in (("cellwarp", "cellwarp", OWN), ("peer", "CGAL", PEER)):
        for key, width, style, side, text in (
                ("largest", 2.2, "-", "bottom", name + ", largest"),
                ("rms", 1.5, (0, (4, 2)), "top", "RMS")):
            line = [(p["seconds"], p[key]) for p in curve[who]["points"]
                    if p["largest"] > floors[who] and p[key] > 0]
            if line:
                axes.plot(*zip(*line), color=colour, linewidth=width, linestyle=style,
                          marker="o" if who == "cellwarp" else None, markersize=5)
                axes.annotate(text, line[-1], xytext=(9, 0), textcoords="offset points",
                              color=colour, va=side, annotation_clip=False)
    stop = usual_stop(curve["peer"]["points"], 1e-4)
    if stop:
        axes.plot(stop["seconds"], stop["largest"], color=PEER, marker="o", markersize=8,
                  markerfacecolor="white", markeredgewidth=1.8)
        axes.annotate("the usual stop:\n1e-4 an iteration", (stop["seconds"], stop["largest"]),
                      xytext=(0, -62), textcoords="offset points", color=PEER, fontsize=11,
                      ha="center", va="top", arrowprops={
                          "arrowstyle": "-", "color": PEER, "linewidth": 0.8, "shrinkB": 5})
    axes.xaxis.set_major_formatter(ticker.FuncFormatter(plain_number))
    save(figure, path)


def plot_families(google, folder):
    """Plots of what PLOTS names, of all families if it names none of them: (title, file)."""
    by_name = {family["family"]: family for family in google["families"]}
    plots = [(title, size, [by_name[name] for name in names if name in by_name])
             for title, size, names in PLOTS if not by_name.keys().isdisjoint(names)]
    if not plots and by_name:
        plots = [(google["name"] + ": time against size", "size", google["families"])]
    drawn = []
    for title, size, families in plots:
        name = google["name"]
        if len(plots) > 1:
            name += "-" + title.lower().replace(" ", "-")
        draw_families(families, size, title, os.path.join(folder, name + ".png"))
        drawn.append((title, name + ".png"))
    return drawn


def styles_of(names):
    """Name, colour and whether it is a stand-in, for each family of a plot."""
    styles = {}
    for name in sorted(names, key=STAND_INS.__contains__):
        partner, text = STAND_INS.get(name, (None, None))
        if partner in styles:
            styles[name] = (text, styles[partner][1], True)
        else:
            text = name.split()[-1].replace("_", " ")  # of "frame blend" the part
            styles[name] = (text, PALETTE[len(styles) % len(PALETTE)], False)
    return [styles[name] for name in names]


def draw_families(families, size, title, path):
    """Measured seconds as points, the fitted power as a line; without one they are joined."""
    figure, axes = new_axes(size, title)
    ends = []
    styles = styles_of([family["family"] for family in families])
    for family, (text, colour, is_stand_in) in zip(families, styles):
        sizes, seconds = zip(*family["points"])
        axes.plot(sizes, seconds, color=colour, marker="o", markersize=6, linestyle="none",
                  markerfacecolor="white" if is_stand_in else colour)
        line = seconds
        if family["slope"] is not None:
            text += "  n$^{%.2f}$" % family["slope"]
            at = math.exp(sum(map(math.log, seconds)) / len(seconds))
            middle = math.exp(sum(map(math.log, sizes)) / len(sizes))
            line = [at * (n / middle) ** family["slope"] for n in sizes]
        axes.plot(sizes, line, color=colour, linewidth=1.6, zorder=1.5,
                  linestyle=(0, (4, 2)) if is_stand_in else "-")
        ends.append((sizes[-1], seconds[-1], text, colour))
    axes.xaxis.set_major_formatter(ticker.FuncFormatter(plain_number))
    axes.yaxis.set_major_formatter(ticker.FuncFormatter(duration))
    label_ends(axes, ends)
    save(figure, path)
