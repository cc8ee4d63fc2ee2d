#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Opens the pages of reports in headless Chromium, and checks what they draw and do.

usage: report_page_test.py CELLWARP SAMPLES      exit code 77: there is no Chromium
"""
import csv
import html
import json
import math
import os
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

CELLWARP, SAMPLES = sys.argv[1:]
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
DATA = re.compile(r'(<script id="data" type="application/json">)(.*?)(</script>)', re.S)
FEW = ["--max-depth", "1", "--across", "8", "--gap", "0.1", "--runs", "1", "--no-pictures"]

# What is seen of a page. Functions are for the steps of a test, which run before.
PROBE = """
const all = (from, what) => [...from.querySelectorAll(what)];
const plots = () => all(document, "figure").filter(figure => figure.querySelector(".plot"));
const press = (target, key) => target.dispatchEvent(new KeyboardEvent("keydown", {key, bubbles: true}));
const tip = () => document.querySelector(".tip");
const rings = () => plots().map(plot => all(plot, ".ring").length);
const keys = () => plots().map(plot => all(plot, ".series").map(series => series.dataset.key));
const middle = box => [(box.left + box.right) / 2, (box.top + box.bottom) / 2];
const seen = {};
try { STEPS } catch (error) { seen.problem = String(error); }
seen.title = document.title;
seen.heading = document.querySelector("h1")?.textContent;
seen.headings = all(document, "h2").map(heading => heading.textContent);
seen.elements = [...new Set(all(document, "main *").map(element => element.localName))];
seen.failure = document.querySelector(".failure")?.textContent;
seen.text = document.querySelector("main").innerText;
seen.loaded = performance.getEntriesByType("resource").map(entry => entry.name);
seen.colours = [document.body, ...all(document, ".soft").slice(0, 1), ...all(document, ".legend .series")].map(
  element => { const style = getComputedStyle(element);
    return [style.backgroundColor, style.color, style.getPropertyValue("--of")]; });
seen.legend = all(document, ".legend button").map(button =>
  [button.textContent, button.getAttribute("aria-pressed")]);
seen.looks = all(document, ".legend .series").map(series => [series.getAttribute("class"),
  series.getAttribute("style"), series.querySelector(".mark").getAttribute("d")].join());
seen.plots = plots().map(figure => {
  const drawing = figure.querySelector(".plot");
  const number = (element, name) => Number(element.getAttribute(name));
  return {title: figure.querySelector("h3").textContent, hint: figure.querySelector("figcaption").textContent,
    words: drawing.textContent, label: drawing.getAttribute("aria-label"),
    frame: all(drawing, ".frame").map(at => ["x", "y", "width", "height"].map(name => number(at, name)))[0],
    ticks: all(drawing, "[data-tick]").map(tick => [tick.dataset.tick, number(tick, "x"), number(tick, "y"),
      [...tick.childNodes].map(node => node.textContent)]),
    names: all(drawing, ".name, .note").map(name => [name.textContent, name.getBoundingClientRect()]),
    series: all(drawing, ".series").map(series => ({key: series.dataset.key,
      ways: all(series, ".way").map(way => way.getAttribute("d")),
      marks: all(series, ".mark").map(mark => ({
        at: mark.getAttribute("transform").match(/[-0-9.]+/g).map(Number), shape: mark.getAttribute("d"),
        isHollow: mark.classList.contains("hollow"), colour: getComputedStyle(mark).fill,
        place: middle(mark.getBoundingClientRect())}))}))};
});
seen.tables = all(document, "table").map(table => ({
  head: all(table, "th").map(head => head.textContent), sorts: all(table, "th").map(head => head.ariaSort),
  rows: all(table, "tbody tr").map(row => [...row.cells].map(cell => cell.textContent)),
  starts: all(table, "tbody tr").map(row => row.className)}));
const out = document.createElement("pre");
out.id = "seen";
out.textContent = JSON.stringify(seen);
document.body.append(out);
"""
DISC = "M-4.5 0a"
BELOW = "M0 0l-5 -9h10z"
LEFT = "M0 0l9 -5v10z"


def run(arguments, code=0):
    done = subprocess.run([CELLWARP, *arguments], capture_output=True, text=True)
    assert done.returncode == code, done.stderr
    return done


def text_of(path):
    with open(path, encoding="utf-8", errors="surrogateescape") as file:
        return file.read()


def data_in(page):
    return json.loads(DATA.search(page).group(2))


def with_data(page, data):
    text = data if isinstance(data, str) else json.dumps(data)
    return DATA.sub(lambda found: found.group(1) + text.replace("<", "\\u003c") + found.group(3), page)


def browse(folder, page, steps="", options=()):
    """What is seen of a page after some steps, and what its scripts complain about."""
    path = os.path.join(folder, "seen.html")
    with open(path, "w", encoding="utf-8", errors="surrogateescape") as file:
        file.write(page + "<script>" + PROBE.replace("STEPS", steps) + "</script>")
    done = subprocess.run(
        [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
         "--user-data-dir=" + os.path.join(folder, "profile"), "--hide-scrollbars",
         "--enable-logging=stderr", "--window-size=1400,3200", *options, "--dump-dom",
         "file://" + path], capture_output=True, text=True, timeout=240)
    found = re.search(r'<pre id="seen">(.*?)</pre>', done.stdout, re.S)
    if not found:
        raise AssertionError("nothing was drawn: " + done.stderr[-2000:])
    seen = json.loads(html.unescape(found.group(1)))
    seen["complaints"] = [line for line in done.stderr.splitlines() if ":CONSOLE" in line]
    return seen


def picture_of(folder):
    """Rows of (red, green, blue) of the page that was seen last."""
    path = os.path.join(folder, "seen.png")
    subprocess.run(
        [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
         "--user-data-dir=" + os.path.join(folder, "profile"), "--hide-scrollbars",
         "--window-size=1400,3200", "--screenshot=" + path,
         "file://" + os.path.join(folder, "seen.html")], check=True, capture_output=True, timeout=240)
    with open(path, "rb") as file:
        raw = file.read()
    at, packed = 8, b""
    while at < len(raw):
        length, kind = struct.unpack(">I4s", raw[at:at + 8])
        if kind == b"IHDR":
            width, height, depth, colours = struct.unpack(">IIBB", raw[at + 8:at + 18])
        if kind == b"IDAT":
            packed += raw[at + 8:at + 8 + length]
        at += length + 12
    assert depth == 8 and colours in (2, 6), "a PNG of another kind"
    size = 3 if colours == 2 else 4
    stream, rows, last = zlib.decompress(packed), [], bytearray(width * size)
    for y in range(height):
        start = y * (width * size + 1)
        kind, row = stream[start], bytearray(stream[start + 1:start + 1 + width * size])
        for i in range(len(row)):
            left = row[i - size] if i >= size else 0
            corner = last[i - size] if i >= size else 0
            if kind == 1:
                row[i] = (row[i] + left) & 255
            elif kind == 2:
                row[i] = (row[i] + last[i]) & 255
            elif kind == 3:
                row[i] = (row[i] + (left + last[i]) // 2) & 255
            elif kind == 4:
                guess = left + last[i] - corner
                row[i] = (row[i] + min((abs(guess - left), 0, left), (abs(guess - last[i]), 1, last[i]),
                                       (abs(guess - corner), 2, corner))[2]) & 255
        rows.append(row)
        last = row
    return lambda x, y: tuple(rows[y][x * size:x * size + 3])


def digits(value):
    """Three of them, as the page has them."""
    return "%g" % float("%.3g" % value)


def rgb(text):
    if text.startswith("#"):
        text = text[1:] if len(text) == 7 else "".join(2 * c for c in text[1:])
        return tuple(int(text[i:i + 2], 16) for i in (0, 2, 4))
    return tuple(int(number) for number in re.findall(r"\d+", text)[:3])


def contrast(one, other):
    """Of WCAG: 21 of black and white."""
    def light(colour):
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4
                  for c in (part / 255 for part in colour)]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    high, low = sorted((light(one), light(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def value_of(label):
    """Of a tick: ["0.5"], ["1,000"] or ["2·10", "−5"]."""
    if len(label) == 1:
        return float(label[0].replace(",", ""))
    mantissa = label[0].split("·")[0] if "·" in label[0] else "1"
    return float(mantissa + "e" + label[1].replace("\u2212", "-"))


class Axis:
    """Places of values, as a reader of the outermost labels has them."""

    def __init__(self, plot, name):
        ticks = sorted((value_of(label), x if name == "x" else y - 4)
                       for axis, x, y, label in plot["ticks"] if axis == name)
        assert len(ticks) >= 2, plot["ticks"]
        (self.low, self.first), (self.high, self.last) = ticks[0], ticks[-1]

    def place(self, value):
        share = math.log(value / self.low) / math.log(self.high / self.low)
        return self.first + (self.last - self.first) * share


def plot_of(seen, title):
    return next(plot for plot in seen["plots"] if plot["title"] == title)


def floor_of(rows, key):
    honest = [row[key] for row in rows if row["kind"] == "uniform" and not row["is_limited"] and
              row["max_depth"] == 0 and row[key] > 0]
    return min(honest) / 100


def line_of(row):
    return "%s, %s" % (row["kind"], row["interpolator"])


def row_of(**values):
    """A row of report.json."""
    return {"kind": "uniform", "threshold": None, "max_depth": 0, "interpolator": "rbf",
            "max_iterations": 200, "is_limited": False, "stop": "converged", "max_error": 0.01,
            "rms_error": 0.001, "error_parts": {"finest": "rbf", "cells": {"largest": 0.01, "rms": 0.001},
                                                "field": None}, "cells": 100, "iterations": 10,
            "energy": 1.0, "gradient": 1e-7, "seconds": 0.5, "peak_mb": 50, **values}


class Pages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.folder = cls.place.name
        cls.reports = os.path.join(cls.folder, "reports")
        bar = os.path.join(SAMPLES, "bar.json")
        other = os.path.join(cls.folder, "other.obj")
        run(["deform", bar, "-o", other, "--across", "8", "--gap", "0.1", "--max-depth", "0"])
        run(["sweep", bar, "-o", cls.reports, *FEW, "--thresholds", "1e-2,1e-3,3e-4,1e-4",
             "--iterations", "2", "--against", other])
        cls.page = text_of(cls.reports + "/report.html")
        cls.data = data_in(cls.page)
        cls.rows = cls.data["report"]["rows"]
        cls.seen = browse(cls.folder, cls.page)

    @classmethod
    def tearDownClass(cls):
        cls.place.cleanup()

    def check(self, seen):
        self.assertEqual(seen["complaints"], [])
        self.assertIsNone(seen.get("failure"))
        self.assertIsNone(seen.get("problem"))
        self.assertEqual(seen["loaded"], [])
        for word in ("NaN", "undefined", "Infinity", "[object", "null"):
            self.assertNotIn(word, seen["text"])

    def of_rows(self, rows, steps="", **report):
        data = {**self.data, "findings": [], "report": {**self.data["report"], "rows": rows, **report}}
        seen = browse(self.folder, with_data(self.page, data), steps)
        self.check(seen)
        return seen

    def test_the_page_has_the_data_of_the_json_and_all_that_is_said(self):
        self.check(self.seen)
        report = json.loads(text_of(self.reports + "/report.json"))
        del report["version"]
        self.assertEqual(self.data["report"], report)
        self.assertIn("default-src 'none'; img-src data:;", self.page)  # no network, whatever it draws
        self.assertEqual(self.seen["title"], os.path.join(SAMPLES, "bar.json") + ": error against run time")
        self.assertEqual(self.seen["headings"], [
            "Error against run time", "Against a result from elsewhere", "Fields of the same poses",
            "All runs", "Machine and settings"] + (["Warnings"] if report["warnings"] else []))
        for words in self.data["findings"] + report["warnings"] + [
                "No pictures were asked for.", report["machine"]["processor"], report["model"],
                "times and memory are medians of 1 runs", "gradient 0.000001 (reference 1e-10)"]:
            self.assertIn(words, self.seen["text"])
        self.assertEqual([plot["title"] for plot in self.seen["plots"]], [
            "Largest error over seconds", "RMS error over seconds", "Largest error over cells",
            "Largest error over threshold", "Largest error over iterations",
            "Largest distance from elsewhere over seconds"])

    def test_every_run_is_a_point_at_its_place_on_logarithmic_axes(self):
        for title, x, y in (("Largest error over seconds", "seconds", "max_error"),
                            ("RMS error over seconds", "seconds", "rms_error"),
                            ("Largest error over cells", "cells", "max_error"),
                            ("Largest error over threshold", "threshold", "max_error"),
                            ("Largest distance from elsewhere over seconds", "seconds", "against_max")):
            plot = plot_of(self.seen, title)
            left, top, width, height = plot["frame"]
            axes, drawn = (Axis(plot, "x"), Axis(plot, "y")), {}
            rows = [row for row in self.rows if row["kind"] != "reference" and not row["is_limited"] and
                    row[x] is not None]
            self.assertGreaterEqual(len(rows), 8)
            for row in rows:
                drawn.setdefault(line_of(row), []).append(row)
            self.assertEqual([series["key"] for series in plot["series"]], list(drawn))
            for series in plot["series"]:
                self.assertEqual(len(series["marks"]), len(drawn[series["key"]]))
                for mark, row in zip(series["marks"], drawn[series["key"]]):
                    with self.subTest(title, series=series["key"], row=row[x]):
                        self.assertAlmostEqual(mark["at"][0], axes[0].place(row[x]), delta=0.2)
                        if row[y] < floor_of(self.rows, y):
                            self.assertEqual((mark["shape"], mark["at"][1]), (BELOW, top + height))
                        else:
                            self.assertAlmostEqual(mark["at"][1], axes[1].place(row[y]), delta=0.2)
                            self.assertEqual(mark["isHollow"], row["kind"] == "uniform")
                    self.assertTrue(left <= mark["at"][0] <= left + width)
                    self.assertTrue(top <= mark["at"][1] <= top + height)
                # The line goes through its marks in their order.
                corners = re.findall(r"[ML]([-0-9.]+) ([-0-9.]+)", "".join(series["ways"]))
                for mark in series["marks"]:
                    self.assertIn(mark["at"], [[float(a), float(b)] for a, b in corners])

    def test_limited_iterations_end_in_the_same_cells_without_limit(self):
        plot = plot_of(self.seen, "Largest error over iterations")
        x = Axis(plot, "x")
        for series in plot["series"]:
            last = [row for row in self.rows if line_of(row) == series["key"]]
            last = [row for row in last if (row["max_depth"], row["threshold"]) ==
                    (last[-1]["max_depth"], last[-1]["threshold"])]
            self.assertEqual(sorted(row["is_limited"] for row in last), [False, True])
            for mark, iterations in zip(series["marks"], sorted(row["iterations"] for row in last)):
                self.assertAlmostEqual(mark["at"][0], x.place(iterations), delta=0.2)

    def test_the_picture_has_the_colour_of_a_series_at_its_marks(self):
        seen, checked = browse(self.folder, self.page), 0
        pixel = picture_of(self.folder)
        marks = [mark for plot in seen["plots"] for series in plot["series"]
                 for mark in series["marks"]]
        for k, mark in enumerate(marks):
            x, y = (round(at) for at in mark["place"])
            is_alone = all(math.dist((x, y), other["place"]) > 14 for other in marks[:k] + marks[k + 1:])
            is_named = any(at["left"] - 4 < x < at["right"] + 4 and at["top"] - 4 < y < at["bottom"] + 4
                           for plot in seen["plots"] for _, at in plot["names"])
            if mark["shape"].startswith(DISC) and is_alone and not is_named:
                # Another line may cross the middle.
                self.assertIn(rgb(mark["colour"]), [pixel(x + dx, y + dy) for dx, dy in (
                    (0, 0), (2, 0), (-2, 0), (0, 2), (0, -2))])
                checked += 1
        self.assertGreaterEqual(checked, 4)

    def test_names_of_lines_and_points_cover_no_other(self):
        named = 0
        for plot in self.seen["plots"]:
            for k, (_, a) in enumerate(plot["names"]):
                for _, b in plot["names"][:k]:
                    self.assertFalse(a["left"] < b["right"] - 1 and b["left"] < a["right"] - 1 and
                                     a["top"] < b["bottom"] - 3 and b["top"] < a["bottom"] - 3,
                                     plot["names"])
            named += len(plot["names"])
        self.assertGreaterEqual(named, 8)
        self.assertIn("depth 0", plot_of(self.seen, "Largest error over seconds")["words"])

    def test_tables_have_all_rows_and_are_sorted_by_a_click(self):
        fields, runs = self.seen["tables"]
        self.assertEqual(len(runs["rows"]), len(self.rows))
        with open(self.reports + "/report.csv", newline="", encoding="utf-8") as file:
            for cells, row in zip(runs["rows"], csv.DictReader(file)):
                found = dict(zip(runs["head"], cells))
                self.assertTrue(found["kind"].startswith(row["kind"]))
                self.assertEqual(found["interpolator"], row["interpolator"])
                self.assertEqual(found["cells"].replace(",", ""), row["cells"])
                self.assertAlmostEqual(float(found["largest error"]), float(row["max_error"]),
                                       delta=0.006 * float(row["max_error"]))
                self.assertAlmostEqual(float(found["energy"]), float(row["energy"]),
                                       delta=1e-5 * float(row["energy"]))
        self.assertEqual(len(fields["rows"]), sum(not row["is_limited"] for row in self.rows))
        self.assertEqual(fields["starts"].count("begins"), 6)
        seen = browse(self.folder, self.page, """
            const runs = all(document, "table")[1];
            const head = all(runs, "th button").find(button => button.textContent === "cells");
            const cells = () => all(runs, "tbody tr").map(row =>
              Number(row.cells[all(runs, "th").indexOf(head.parentNode)].textContent.replace(",", "")));
            seen.orders = [cells()];
            for (let k = 0; k < 3; ++k) { head.click(); seen.orders.push(cells()); }""")
        first, rising, falling, again = seen["orders"]
        self.assertEqual(rising, sorted(first))
        self.assertEqual(falling, sorted(first, reverse=True))
        self.assertEqual(again, first)
        self.assertNotEqual(rising, first)

    def test_a_point_under_the_pointer_is_described_and_ringed_in_all_plots(self):
        seen = browse(self.folder, self.page, """
            const mark = all(plots()[0], '.series[data-key="adaptive, rbf"] .mark').pop();
            const [x, y] = middle(mark.getBoundingClientRect());
            const move = (x, y) => plots()[0].querySelector(".plot").dispatchEvent(
              new PointerEvent("pointermove", {clientX: x, clientY: y, bubbles: true}));
            seen.before = [tip().hidden, rings()];
            move(x, y);
            seen.at = [tip().innerText, rings(), tip().getBoundingClientRect()];
            seen.rows = all(document, "tbody tr.on").length;
            move(0, 0);
            seen.after = [tip().hidden, rings(), all(document, "tbody tr.on").length];
            all(document, "table")[1].querySelectorAll("tbody tr")[1].dispatchEvent(
              new PointerEvent("pointerenter"));
            seen.row = [tip().hidden, rings()];""")
        self.check(seen)
        row = [row for row in self.rows if line_of(row) == "adaptive, rbf" and not row["is_limited"]][-1]
        self.assertEqual(seen["before"], [True, [0] * 6])
        words, rings, place = seen["at"]
        self.assertTrue(words.startswith("adaptive 0.0001, rbf"), words)
        self.assertIn("{:,}".format(row["cells"]), words)
        self.assertIn(digits(row["seconds"]), words.split("\n"))
        self.assertEqual(rings, [1] * 6)
        self.assertTrue(place["left"] >= 0 and place["right"] <= 1400)
        self.assertEqual(seen["rows"], 2)
        self.assertEqual(seen["after"], [True, [0] * 6, 0])
        self.assertEqual(seen["row"], [True, [1, 1, 1, 0, 0, 1]])  # uniform 0

    def test_keys_walk_through_the_points(self):
        seen = browse(self.folder, self.page, """
            const plot = plots()[2].querySelector(".plot");
            seen.focus = plot.tabIndex;
            seen.names = ["ArrowRight", "ArrowRight", "ArrowDown", "End", "Home", "ArrowUp", "Escape"].map(
              key => { press(plot, key); return tip().hidden ? "" : tip().querySelector("b").textContent; });""")
        self.check(seen)
        self.assertEqual(seen["focus"], 0)
        self.assertEqual(seen["names"][:2], ["uniform 0, rbf", "uniform 1, rbf"])
        self.assertTrue(all(", rbf" in name and "adaptive" in name for name in seen["names"][2:5]))
        self.assertEqual(seen["names"][3:], ["adaptive 0.0001, rbf", "adaptive 0.01, rbf", "uniform 0, rbf", ""])

    def test_the_legend_hides_and_shows_lines_of_all_plots(self):
        seen = browse(self.folder, self.page, """
            const button = all(document, ".legend button")[1];
            seen.keys = [keys()];
            button.dispatchEvent(new PointerEvent("pointerenter"));
            seen.dim = all(plots()[0], ".series.dim").map(series => series.dataset.key);
            button.dispatchEvent(new PointerEvent("pointerleave"));
            seen.clear = all(document, ".dim").length;
            button.click();
            seen.keys.push(keys());
            seen.pressed = all(document, ".legend button").map(button => button.getAttribute("aria-pressed"));
            button.click();
            seen.keys.push(keys());""")
        self.check(seen)
        lines = ["uniform, rbf", "adaptive, rbf", "uniform, blend", "adaptive, blend"]
        self.assertEqual([name for name, _ in seen["legend"]], lines)
        before, hidden, after = seen["keys"]
        self.assertEqual(before[0], lines)
        self.assertEqual(hidden, [[key for key in plot if key != "adaptive, rbf"] for plot in before])
        self.assertEqual(after, before)
        self.assertEqual(seen["pressed"], ["true", "false", "true", "true"])
        self.assertEqual(seen["dim"], [key for key in lines if key != "adaptive, rbf"])
        self.assertEqual(seen["clear"], 0)

    def test_light_and_dark_pages_can_be_read(self):
        pages = [self.seen, browse(self.folder, self.page,
                                   options=["--blink-settings=preferredColorScheme=0"])]
        grounds = []
        for seen in pages:
            (ground, ink, _), (_, soft, _), *series = seen["colours"]
            grounds.append(sum(rgb(ground)))
            self.assertGreater(contrast(rgb(ground), rgb(ink)), 7)
            self.assertGreater(contrast(rgb(ground), rgb(soft)), 4.5)
            self.assertEqual(len(series), 4)
            for _, _, colour in series:
                self.assertGreater(contrast(rgb(ground), rgb(colour.strip())), 4.5)
        self.assertGreater(grounds[0], 600)
        self.assertLess(grounds[1], 150)

    def test_zeros_and_what_is_no_number_have_no_place_and_are_counted(self):
        rows = [row_of(kind="reference", max_depth=1, max_error=0, rms_error=0)]
        for seconds, error in ((1, 0.1), (2, 0.01), (3, 0), (0, 0.1), (4, None), (None, 0.1), (5, -1)):
            rows.append(row_of(seconds=seconds, max_error=error, max_depth=1, rms_error=None))
        seen = self.of_rows(rows)
        plot = plot_of(seen, "Largest error over seconds")
        marks = plot["series"][0]["marks"]
        self.assertEqual([mark["shape"] == BELOW for mark in marks], [False, False, True])
        self.assertEqual(plot["hint"], "4 of 7 points have no place on a logarithmic axis.")
        x, y = Axis(plot, "x"), Axis(plot, "y")
        for mark, (seconds, error) in zip(marks, ((1, 0.1), (2, 0.01))):
            self.assertAlmostEqual(mark["at"][0], x.place(seconds), delta=0.2)
            self.assertAlmostEqual(mark["at"][1], y.place(error), delta=0.2)
        self.assertIn("nothing to draw", plot_of(seen, "RMS error over seconds")["words"])
        self.assertIn("\u2013", [cell for row in seen["tables"][0]["rows"] for cell in row])

    def test_errors_below_the_floor_do_not_stretch_the_axis(self):
        seen = self.of_rows([row_of(seconds=1, max_error=0.02), row_of(
            seconds=2, max_depth=1, max_error=1e-12), row_of(
                seconds=2, kind="adaptive", threshold=1e-3, max_depth=1, max_error=0.01)])
        plot = plot_of(seen, "Largest error over seconds")
        self.assertEqual(plot["series"][0]["marks"][1]["shape"], BELOW)
        self.assertGreaterEqual(min(value_of(label) for axis, _, _, label in plot["ticks"] if axis == "y"),
                                2e-3)

    def test_one_point_has_axes_and_none_says_so(self):
        one = self.of_rows([row_of(seconds=3, max_error=3)])
        plot = plot_of(one, "Largest error over seconds")
        self.assertEqual(len(plot["series"][0]["marks"]), 1)
        mark = plot["series"][0]["marks"][0]
        self.assertAlmostEqual(mark["at"][0], Axis(plot, "x").place(3), delta=0.2)
        self.assertAlmostEqual(mark["at"][1], Axis(plot, "y").place(3), delta=0.2)
        failed = [row_of(kind="reference"), {**row_of(), "failure": "over <its> \"budget\"", "stop": "failed"}]
        for rows in ([], failed):
            none = self.of_rows(rows)
            for plot in none["plots"]:
                self.assertIn("nothing to draw", plot["words"])
            self.assertEqual(none["legend"], [])
            self.assertNotIn("Fields of the same poses", none["headings"])
        self.assertEqual(none["tables"][0]["rows"][1][-1], "over <its> \"budget\"")

    def test_decades_are_labelled_and_few_of_them_more_finely(self):
        wide = plot_of(self.of_rows([row_of(seconds=1e-3, max_error=1e-11), row_of(
            seconds=1e6, max_error=1e3, max_depth=1)]), "Largest error over seconds")
        for axis in "xy":
            for value in (value_of(label) for name, _, _, label in wide["ticks"] if name == axis):
                self.assertAlmostEqual(math.log10(value), round(math.log10(value)))
        narrow = plot_of(self.of_rows([row_of(seconds=1.1, max_error=0.2), row_of(
            seconds=4.5, max_error=0.3, max_depth=1)]), "Largest error over seconds")
        seconds = [value_of(label) for name, _, _, label in narrow["ticks"] if name == "x"]
        self.assertTrue({1, 2, 5} <= set(seconds), seconds)

    def test_every_departure_has_a_look_of_its_own(self):
        names = [None, "glue in the face", "measured borders", "smooth borders", "rigid steps", "a", "b", "c",
                 "d", "e", "f"]
        seen = self.of_rows([row_of(kind=kind, seconds=1 + k, threshold=1e-3 if kind == "adaptive" else None,
                                    max_depth=1, **({"without": name} if name else {}))
                             for kind in ("uniform", "adaptive") for k, name in enumerate(names)])
        self.assertEqual(len(set(seen["looks"])), 22)
        self.assertEqual(len(set(name for name, _ in seen["legend"])), 22)
        self.assertIn("uniform, rbf, without rigid steps", [name for name, _ in seen["legend"]])

    def test_odd_names_of_files_are_text(self):
        name = "a\"'&</script><!--<b>{{\u00fc\u96ea\u2028<img src=x onerror=alert(1)>.json"
        scene = os.path.join(self.folder, name.replace("/", "\u2215"))
        for name in ("bar.obj", "bar.handles"):
            shutil.copy(os.path.join(SAMPLES, name), self.folder)
        with open(scene, "w", encoding="utf-8") as file:
            json.dump({"cellwarp": 1, "model": "bar.obj", "handles": "bar.handles"}, file)
        folder = os.path.join(self.folder, "odd")
        run(["sweep", scene, "-o", folder, *FEW, "--thresholds", "1e-2", "--interpolators", "rbf"])
        seen = browse(self.folder, text_of(folder + "/report.html"))
        self.check(seen)
        self.assertEqual(seen["heading"], scene)
        self.assertNotIn("img", seen["elements"])
        self.assertNotIn("Fields of the same poses", seen["headings"])  # of one field
        hostile = "</script><script>document.title = 'mine'</script><!--"
        seen = self.of_rows([row_of(interpolator=hostile), row_of(failure=hostile, stop=hostile)],
                            scene=hostile, model=hostile, against=hostile, warnings=[hostile])
        self.assertEqual(seen["heading"], hostile)
        self.assertEqual(seen["title"], hostile + ": error against run time")
        self.assertEqual([name for name, _ in seen["legend"]], ["uniform, " + hostile])

    def test_data_that_cannot_be_drawn_is_said(self):
        for data in ("", "{", {"kind": "other"}, {**self.data, "report": {}}):
            seen = browse(self.folder, with_data(self.page, data))
            self.assertIn("This page cannot draw its data", seen["failure"])
            self.assertTrue(any("Uncaught" in line for line in seen["complaints"]))

    def test_cases_of_stability_lie_before_or_beyond_their_gates(self):
        folder = os.path.join(self.folder, "stability")
        run(["sweep", os.path.join(SAMPLES, "block.json"), "--stability", "-o", folder, "--only", "meet"])
        page = text_of(folder + "/stability.html")
        data = data_in(page)
        cases, gates = data["report"]["cases"], data["report"]["gates"]
        with open(folder + "/stability.csv", newline="", encoding="utf-8") as file:
            lines = list(csv.DictReader(file))
        self.assertEqual([line["name"] for line in lines], [case["name"] for case in cases])
        for line, case in zip(lines, cases):
            self.assertEqual(list(line), list(case))
            self.assertEqual(float(line["energy_rise"]), case["energy_rise"])
            self.assertEqual(line["constraint"], "")
        cases[1].update(handle_residual=2 * gates["handle_residual"], faults=["handles are missed"])
        seen = browse(self.folder, with_data(page, data))
        self.check(seen)
        self.assertEqual(seen["headings"], ["How near cases come to their gates", "All cases"])
        plot, x = seen["plots"][0], Axis(seen["plots"][0], "x")
        left = plot["frame"][0]
        for series, of in zip(plot["series"], (cases[:1] + cases[2:], cases[1:2])):
            values = [case[key] / gate for case in of for key, gate in gates.items() if case[key] is not None]
            self.assertEqual(len(series["marks"]), len(values))
            for mark, value in zip(series["marks"], values):
                if value < 1e-8:
                    self.assertEqual((mark["shape"], mark["at"][0]), (LEFT, left))
                else:
                    self.assertAlmostEqual(mark["at"][0], x.place(value), delta=0.2)
        beyond = [mark["at"][0] for series in plot["series"] for mark in series["marks"]
                  if mark["at"][0] > x.place(1)]
        self.assertEqual(len(beyond), 1)
        table = seen["tables"][0]
        self.assertEqual(table["starts"].count("group"), len({case["group"] for case in cases}))
        self.assertEqual(len(table["rows"]), len(cases) + table["starts"].count("group"))
        self.assertIn("\u26a0 " + cases[1]["name"], [row[0] for row in table["rows"]])
        self.assertIn("largest |R^T R - I|, at most 1e-12.", seen["text"])


if not CHROMIUM:
    print("skipped: pages of reports are drawn in Chromium, and there is none (apt install chromium)")
    sys.exit(77)
unittest.main(argv=sys.argv[:1], verbosity=2)
