#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Every source file is formatted by clang-format 14 and starts with its licence.
set -eu
cd "$(dirname "$0")/.."
rooms="io octree solver library editor tests"
files=$(find $rooms -name '*.h' -o -name '*.cpp' | sort)
clang-format --dry-run -Werror $files
for file in $files CMakeLists.txt $(find $rooms -name CMakeLists.txt -o -name '*.html') cmake/* scripts/*; do
    head -n 3 "$file" | grep -q 'SPDX-License-Identifier: GPL-3.0-or-later' ||
        { echo "$file: no SPDX line" >&2; exit 1; }
done
