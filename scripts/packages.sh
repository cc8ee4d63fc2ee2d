#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Installs the packages that are missing, and says so. Sourced by run and test. The names
# are those of Debian 12; they are the same in Debian 13 and Ubuntu 24.04, where
# libembree-dev is Embree 4.
packages="g++ cmake ninja-build libeigen3-dev libsuitesparse-dev libopenblas-dev
    liblapacke-dev libtbb-dev libnanoflann-dev libcgal-dev libcli11-dev nlohmann-json3-dev libfmt-dev
    zlib1g-dev liblzf-dev libdraco-dev libmeshoptimizer-dev libxxhash-dev libembree-dev libstb-dev
    libglfw3-dev libimgui-dev libgl-dev fonts-dejavu-core xvfb xdotool libassimp-dev libgtest-dev
    python3 clang-format ccache"
missing=""
for package in $packages; do
    dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'ok installed' ||
        missing="$missing $package"
done
packages_install() {
    echo "installing: $*" >&2
    as_root=""
    if [ "$(id -u)" != 0 ]; then
        command -v sudo >/dev/null || {
            echo "error: installing packages needs root or sudo" >&2
            return 1
        }
        as_root=sudo
    fi
    # Lists that are old may do; where they do not, the reason is told at the end.
    lists=""
    $as_root apt-get update -q -o APT::Update::Error-Mode=any >&2 ||
        lists=" (apt-get update failed before, see above: the lists of packages are old)"
    $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -q "$@" >&2 || {
        echo "error: cannot install $*$lists" >&2
        return 1
    }
}

if [ -n "$missing" ]; then
    packages_install $missing
fi
