#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Makes the README's pictures of the editor from the samples, on a display in memory:
# usage make_editor_pictures.sh [CELLWARP-EDITOR] [FOLDER]
set -eu
here=$(cd "$(dirname "$0")/.." && pwd)
editor=${1:-$here/build/cellwarp-editor}
folder=${2:-$here/docs}
mkdir -p "$folder"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

play() {  # script, flags and model of the editor
    script=$1
    shift
    XDG_STATE_HOME="$work" xvfb-run -a -s "-screen 0 2880x1880x24" \
        "$editor" --play "$script" "$@"
}

cat >"$work/bend" <<END
size 1400 900
wait
shot $folder/editor-bend.png
show ghost on
show cells on
shot $folder/editor-cells.png
quit
END
play "$work/bend" "$here/samples/creature.json"

cat >"$work/keys" <<END
size 1400 900
shot $folder/editor-welcome.png
show keys on
shot $folder/editor-keys.png
quit
END
play "$work/keys"
