// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/cli/page.h"

#include "editor/cli/plot.h"

namespace cellwarp::core
{

namespace
{

constexpr const char* kStyle = R"(
:root { color-scheme: light dark; --line: #d9dce1; --soft: #5b6470; --page: #fff;
  --ink: #1c2026; --head: #f3f4f6; }
@media (prefers-color-scheme: dark) { :root { --line: #3a4048; --soft: #a3abb6;
  --page: #16191d; --ink: #e6e8eb; --head: #22262c; } }
@media print { :root { color-scheme: light; --line: #ccc; --soft: #444; --page: #fff;
  --ink: #000; --head: #eee; } figure, tr { break-inside: avoid; } }
body { margin: 0 auto; padding: 1.5rem; max-width: 1560px; background: var(--page);
  color: var(--ink); line-height: 1.45;
  font-family: system-ui, 'Segoe UI', 'Noto Sans', sans-serif; }
h1 { font-size: 1.5rem; margin: 0 0 .25rem; overflow-wrap: anywhere; }
h2 { font-size: 1.1rem; margin: 2rem 0 .5rem; }
p, li { max-width: 62rem; } .soft { color: var(--soft); font-size: .9rem; }
figure { margin: 0; } figcaption { color: var(--soft); font-size: .9rem; }
img { max-width: 100%; height: auto; border-radius: 6px; background: #fff; }
.plots { display: grid; gap: 1.5rem;
  grid-template-columns: repeat(auto-fit, minmax(min(560px, 100%), 1fr)); }
svg { width: 100%; height: auto; display: block; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .85rem; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .6rem; text-align: right; white-space: nowrap;
  border-bottom: 1px solid var(--line); }
th { background: var(--head); } .word { text-align: left; }
tr.begins td { border-top: 2px solid var(--soft); }
)";

} // namespace

std::string html_page(const std::string& title, const std::string& body)
{
    return "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
           "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
           "<title>" +
           in_markup(title) + "</title>\n<style>" + kStyle +
           "</style>\n</head>\n<body>\n" + body + "</body>\n</html>\n";
}

} // namespace cellwarp::core
