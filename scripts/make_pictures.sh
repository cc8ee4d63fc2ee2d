#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Makes the README's pictures from the samples: usage make_pictures.sh [CELLWARP] [FOLDER]
set -eu
here=$(cd "$(dirname "$0")/.." && pwd)
. "$here/scripts/packages.sh"
command -v pngquant >/dev/null || packages_install pngquant
python3 -c "import numpy" 2>/dev/null || packages_install python3-numpy
cellwarp=${1:-$here/build/cellwarp}
folder=${2:-$here/docs}
mkdir -p "$folder"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

pair() {  # sample, extension, more flags of render
    name=$1
    extension=$2
    shift 2
    "$cellwarp" deform "$here/samples/$name.json" -o "$work/bent-$name.$extension"
    "$cellwarp" render "$work/bent-$name.$extension" --compare "$here/samples/$name.$extension" \
        --size 480x400 -o "$folder/$name.png" --overwrite "$@"
}

pair bar obj --view 60 15
pair plate ply --up z --view -30 25
pair creature obj --view 25 15
"$cellwarp" render "$here/samples/block.json" --frame last --cells --up z --size 720x560 \
    --view -50 25 -o "$folder/block.png" --overwrite
pair vase obj
pair cloud ply --view 35 30
pair hand ply --view 20 10
pair coil obj --view 30 15
# Posed by rods, and what slides along curves.
posed() {  # sample, its frame, more flags of render
    name=$1
    "$cellwarp" render "$here/samples/$name.json" --frame "$2" -o "$folder/$name.png" --overwrite \
        --size 480x400 $3
}
posed hose last "--view 60 20"
posed tail last "--view 100 15"
posed batten last "--view 90 0"
"$cellwarp" render "$here/samples/spine.json" --strip=3 --size 320x360 --view 25 15 \
    -o "$folder/spine.png" --overwrite
"$cellwarp" render "$here/samples/ring.json" --strip=3 --size 320x280 --view 20 30 \
    -o "$folder/ring.png" --overwrite
# Flat.
"$cellwarp" render "$here/samples/figure.json" --strip=3 --size 260x300 --view 0 0 \
    -o "$folder/figure.png" --overwrite
"$cellwarp" render "$here/samples/drawing.json" --strip=3 --size 300x330 --view 0 0 \
    -o "$folder/drawing.png" --overwrite
# Closed, beside the same as a shell.
"$cellwarp" deform "$here/samples/tower.json" --fill shell -o "$work/shell.obj"
"$cellwarp" deform "$here/samples/tower.json" -o "$work/closed.obj"
"$cellwarp" render "$work/closed.obj" --compare "$work/shell.obj" --size 300x420 \
    --view 20 15 -o "$folder/tower.png" --overwrite
# Contact, beside the same without.
"$cellwarp" deform "$here/samples/hand.ply" --handles "$here/samples/touch.handles" \
    -o "$work/without.ply"
"$cellwarp" deform "$here/samples/touch.json" -o "$work/contact.ply"
"$cellwarp" render "$work/contact.ply" --compare "$work/without.ply" --size 400x440 \
    --view 0 5 -o "$folder/touch.png" --overwrite
# Posed by a pin of many samples.
"$cellwarp" render "$here/samples/pull.json" --strip=3 --size 320x260 --view 0 10 \
    -o "$folder/pull.png" --overwrite
# Posed by skeletons.
"$cellwarp" render "$here/samples/arm.json" --strip=3 --cells --size 320x280 --view 0 10 \
    -o "$folder/arm.png" --overwrite
"$cellwarp" render "$here/samples/walk.json" --strip=5 --size 230x330 --view 35 10 \
    -o "$folder/walk.png" --overwrite
"$cellwarp" render "$here/samples/fingers.json" --strip=3 --size 300x340 --view 25 5 \
    -o "$folder/fingers.png" --overwrite
"$cellwarp" render "$here/samples/wave.json" --strip=4 --size 280x330 --view 10 10 \
    -o "$folder/wave.png" --overwrite
"$cellwarp" render "$here/samples/reach.json" --strip=3 --size 300x330 --view 20 10 \
    -o "$folder/reach.png" --overwrite
# Flesh that follows skeletons.
flesh() {  # sample, frames, size of one, azimuth[/elevation], more flags of render
    name=$1
    case $4 in */*) above=${4#*/} ;; *) above=10 ;; esac
    "$cellwarp" render "$here/samples/flesh/$name.json" --strip="$2" --size "$3" \
        --view "${4%/*}" "$above" \
        -o "$folder/flesh-$name.png" --overwrite ${5:-}
}
flesh walk 8 200x300 50
flesh belly 8 180x270 70
flesh elbow 5 260x220 0
flesh tail 8 200x300 130
flesh limb 4 300x220 0 --cells
flesh limb_halved 4 300x220 0 --cells
flesh spin 5 240x110 20
flesh spin_free 5 240x110 20
flesh press 6 200x300 70
flesh detail 7 200x310 70 --cells
flesh drag 5 200x300 70 --cells
flesh rope 5 220x320 30
flesh suture 5 240x200 30/40
flesh flop 6 240x200 20
flesh reach 6 200x300 20
flesh pulled 5 200x300 70
for law in cells regions linear stvk neo; do
    flesh "joint_$law" 4 240x200 0
done
"$cellwarp" skeleton "$here/samples/creature.obj" -o "$work/skeleton.json"
"$cellwarp" render "$work/skeleton.json" --size 400x400 --view 25 10 \
    -o "$folder/skeleton.png" --overwrite
pair chain obj --view 35 10
pair soup stl --view 15 15
pair scan xyz --view 25 15
"$cellwarp" render "$here/samples/creature.json" --frame last --cells --size 900x640 \
    --view 25 15 -o "$folder/cells.png" --overwrite

# One deformation for other data of the same space.
"$here/scripts/make_large_samples.py" "$work/large"
"$cellwarp" deform "$here/samples/creature.json" -o "$work/field.obj" \
    --save-field "$work/creature.cwf"
large() {  # sample, extension
    "$cellwarp" apply "$work/creature.cwf" "$work/large/big-$1.$2" -o "$work/bent-big-$1.$2"
    "$cellwarp" render "$work/bent-big-$1.$2" --compare "$work/large/big-$1.$2" --size 480x400 \
        --view 25 15 -o "$folder/apply-$1.png" --overwrite
}
large scan ply
large soup stl

# Rods in time that carry a model.
carried() {  # scene, frames, size of one, azimuth, elevation
    "$cellwarp" render "$here/samples/rods/$1.json" --strip="$2" --size "$3" --view "$4" "$5" \
        -o "$folder/$1.png" --overwrite
}
carried tentacle 7 160x220 20 10
carried hung 6 180x300 10 5
carried stitch 4 320x240 20 50

# Rods, their frames side by side.
"$cellwarp" render "$here/samples/rods/cantilever.json" --frame last --size 640x320 --view 0 20 \
    -o "$folder/rods-cantilever.png" --overwrite
strip() {  # scene, frames, size of one, azimuth
    "$cellwarp" render "$here/samples/rods/$1.json" --strip="$2" --size "$3" \
        --view "${4:-0}" 20 \
        -o "$folder/rods-$1.png" --overwrite
}
"$cellwarp" render "$here/samples/rods/cable.json" --frame last --size 640x320 --view 0 20 \
    -o "$folder/rods-cable.png" --overwrite
strip pendulum 5 240x220
strip ring 6 200x200
strip stick 6 200x150
strip six 6 200x150
strip free 6 200x220
strip four 6 200x200 25
strip short 6 200x200 25
strip bundle 6 200x240 25
strip hole 6 200x260 30
strip thread 6 200x160
strip lace 6 200x260
strip suture 6 200x180 25
strip slipknot 6 200x160
strip swing 6 200x240 30
strip net 6 200x220 25
strip necklace 6 200x200 15
strip u 7 200x220
strip pushed 5 200x200 25
strip capstan 4 220x220
strip cut 6 200x200 15
strip knot 6 220x160
strip pile 6 200x200 25
strip intestine 6 200x200 20
strip drape 6 200x220 25
strip patch 6 220x200 25
strip block 6 200x200 30
strip seam 6 220x160 25

# A palette is enough for them, in a third of the bytes.
pngquant --force --ext .png --strip --skip-if-larger "$folder"/*.png
