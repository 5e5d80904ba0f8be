#!/usr/bin/env bash
# Makes the pictures of README.md with the program itself. Takes a few minutes on a CPU adapter: one of them is
# traced with 256 rays per voxel.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo build --release --locked
program=target/release/spao-server
out=docs/pictures
head=data/visible-human-head.nrrd
small=tests/data/visible-human-head-128.nrrd
scene=$(mktemp --suffix=.json)
trap 'rm -f "$scene"' EXIT

# picture NAME VOLUME WIDTH HEIGHT SCENE
picture() {
    printf '%s' "$5" > "$scene"
    "$program" render "$2" --scene "$scene" --width "$3" --height "$4" -o "$out/$1.jpg"
    echo "$out/$1.jpg"
}

bone='"transfer_function": {"preset": "ct_bone"}'
close='"camera": {"eye": [410, -60, 1690], "target": [255, 255, 1625], "up": [0, 0, 1], "fov_y_deg": 36}'

picture head "$head" 960 720 '{"camera": {"eye": [430, -110, 1700], "target": [255, 255, 1630], "up": [0, 0, 1], "fov_y_deg": 40}}'

# What ambient occlusion adds.
picture occlusion_off "$head" 400 400 "{$bone, $close, \"ambient_occlusion\": {\"method\": \"off\"}}"
picture occlusion_on "$head" 400 400 "{$bone, $close}"

# SPAO, figure 1.6: ray tracing, mipmaps, N-buffers; full sphere.
for method in '"method": "raytraced", "rays": 256' '"structure": "mipmap"' '"structure": "n_buffer"'; do
    name=$(sed 's/.*"\(raytraced\|mipmap\|n_buffer\)".*/\1/' <<< "$method")
    picture "figure_1_6_$name" "$small" 300 300 \
        "{$bone, $close, \"ambient_occlusion\": {$method, \"levels\": 5, \"normal_factor\": 0}}"
done

# SPAO, figure 1.8: the normal factor, at one exposure.
for factor in 0 0.5 1 2; do
    picture "figure_1_8_${factor/./_}" "$head" 300 300 \
        "{$bone, $close, \"lighting\": {\"exposure\": 2.2}, \"ambient_occlusion\": {\"normal_factor\": $factor}}"
done
