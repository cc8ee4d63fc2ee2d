#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Makes the README's pictures of the editor from the samples, on a display in memory:
# usage make_editor_pictures.sh [CELLWARP-EDITOR] [FOLDER]
set -eu
here=$(cd "$(dirname "$0")/.." && pwd)
. "$here/scripts/packages.sh"
command -v pngquant >/dev/null || packages_install pngquant
editor=${1:-$here/build/cellwarp-editor}
folder=${2:-$here/docs}
mkdir -p "$folder"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

play() {  # script, flags and model of the editor
    script=$1
    shift
    # A state of its own: no folder of this machine is seen among the recent files.
    XDG_STATE_HOME=$(mktemp -d "$work/state.XXXXXX") xvfb-run -a -s "-screen 0 2880x1880x24" \
        "$editor" --play "$script" "$@"
}

cat >"$work/bend" <<END
size 1400 900
wait
region hand
tool move
drag 0.555vw 0.32vh 0.62vw 0.40vh 10
wait
show ghost on
shot $folder/editor-bend.png
show ghost off
show cells on
shot $folder/editor-cells.png
quit
END
play "$work/bend" "$here/samples/creature.json"

cat >"$work/rod" <<END
size 1400 900
key 3 alt
key home
tool box
drag 0.05vw 0.02vh 0.51vw 0.98vh 8
key j
key a alt
key d
move 0.50vw 0.60vh
press left
release left
move 0.525vw 0.66vh
press left
release left
move 0.565vw 0.68vh
press left
release left
move 0.605vw 0.655vh
press left
release left
move 0.64vw 0.615vh
press left
release left
key enter
wait
move 0.64vw 0.615vh
press left
release left
key u shift
wait
drag 0.64vw 0.615vh 0.59vw 0.52vh 12
wait
shot $folder/editor-rod.png
quit
END
play "$work/rod" "$here/samples/creature.obj"

cat >"$work/joints" <<END
size 1400 900
wait
region neck
tool rotate
key r
key z
text -20
key enter
wait
shot $folder/editor-joints.png
quit
END
play "$work/joints" "$here/samples/reach.json"

cat >"$work/film" <<END
size 1400 900
key 1 alt
key home
wait
film 12
frames 3
shot $folder/editor-film.png
quit
END
play "$work/film" "$here/samples/rods/hung.json"

cat >"$work/select" <<END
size 1400 900
key 1 alt
key home
wait
tool lasso
move 0.30vw 0.05vh
press left
move 0.70vw 0.05vh
move 0.68vw 0.42vh
move 0.34vw 0.42vh
shot $folder/editor-select.png
release left
quit
END
play "$work/select" --light "$here/samples/creature.obj"

# The smallest screen with the largest letters.
cat >"$work/small" <<END
size 1024 768
wait
tool brush
shot $folder/editor-small.png
quit
END
play "$work/small" --scale 2 "$here/samples/flesh/walk.json"

cat >"$work/keys" <<END
size 1400 900
shot $folder/editor-welcome.png
show keys on
frames 3
shot $folder/editor-keys.png
quit
END
(cd "$here" && play "$work/keys")

# A palette is enough for them, in a third of the bytes.
pngquant --force --ext .png --strip --skip-if-larger "$folder"/editor-*.png
