#!/usr/bin/env bash
# Makes the pictures of README.md with the program itself: docs/pictures/*.jpg. Takes some minutes on a CPU adapter,
# most of them for the one that is traced with 256 rays per voxel. With names, makes only pictures whose names begin
# with one of them: scripts/pictures.sh head occlusion
set -euo pipefail
cd "$(dirname "$0")/.."
cargo build --release --locked
program=target/release/spao-server
out=docs/pictures
head=data/visible-human-head.nrrd
small=tests/data/visible-human-head-128.nrrd
scene=$(mktemp --suffix=.json)
trap 'rm -f "$scene"' EXIT
wanted=("$@")

is_wanted() {
    [ ${#wanted[@]} -eq 0 ] && return 0
    local prefix
    for prefix in "${wanted[@]}"; do
        [[ $1 == "$prefix"* ]] && return 0
    done
    return 1
}

# picture NAME VOLUME WIDTH HEIGHT SCENE
picture() {
    is_wanted "$1" || return 0
    printf '{"rendering": {"background": "#0e1116"}, %s}' "$5" > "$scene"
    "$program" render "$2" --scene "$scene" --width "$3" --height "$4" -o "$out/$1.jpg"
    echo "$out/$1.jpg"
}

# camera EYE TARGET FIELD_OF_VIEW
camera() { printf '"camera": {"eye": [%s], "target": [%s], "up": [0, 0, 1], "fov_y_deg": %s}' "$1" "$2" "$3"; }

# occlusion JSON...
occlusion() { printf '"ambient_occlusion": {%s}' "$*"; }

bone='"transfer_function": {"preset": "ct_bone"}'
# Bone in a thin haze of muscle and skin.
haze='"transfer_function": {"opacity_unit_distance": 1, "points": [
    {"value": -700, "color": "#c98e6c", "opacity": 0}, {"value": -450, "color": "#e0a884", "opacity": 0.03},
    {"value": -200, "color": "#eebd98", "opacity": 0.05}, {"value": -80, "color": "#e8b78e", "opacity": 0.004},
    {"value": 20, "color": "#b5473c", "opacity": 0.006}, {"value": 90, "color": "#9f3a33", "opacity": 0.012},
    {"value": 180, "color": "#d9ae8c", "opacity": 0.08}, {"value": 320, "color": "#efe0c9", "opacity": 0.6},
    {"value": 700, "color": "#f8efe0", "opacity": 0.95}, {"value": 1800, "color": "#fffaf1", "opacity": 0.99}]}'
side='"lighting": {"direction": [0.45, -0.6, 0.65], "ambient": 0.45, "diffuse": 0.75}'
face=$(camera '440, -100, 1650' '250, 235, 1605' 25)
whole=$(camera '430, -170, 1665' '238, 242, 1617' 32)

picture head "$head" 960 640 "$haze, $side, $whole"

# What ambient occlusion adds: to bone in tissue, and to a surface without any.
bulb=$(camera '440, -200, 280' '128, 128, 128' 24)
for state in off on; do
    method=spao
    [ $state = off ] && method=off
    shade=$(occlusion "\"method\": \"$method\"")
    picture "occlusion_head_$state" "$head" 440 440 "$haze, $side, $shade, $(camera '430, -170, 1665' '238, 242, 1617' 31)"
    picture "occlusion_bulb_$state" procedural:mandelbulb:256 440 440 "$shade, $bulb"
done

# SPAO, figure 1.6: ray tracing, mipmaps, N-buffers; full sphere, at fixed exposures.
figure_1_6() {
    picture "figure_1_6_$1" "$small" 300 300 \
        "$bone, $face, \"lighting\": {\"exposure\": $2}, $(occlusion "$3, \"levels\": 5, \"normal_factor\": 0")"
}
figure_1_6 raytraced 2 '"method": "raytraced", "rays": 256'
figure_1_6 mipmap 2 '"structure": "mipmap"'
figure_1_6 n_buffer 2 '"structure": "n_buffer"'

# SPAO, figure 1.8: the normal factor, at one exposure.
for factor in 0 0.5 1 2; do
    picture "figure_1_8_${factor/./_}" "$head" 300 300 \
        "$bone, $face, \"lighting\": {\"exposure\": 2.2}, $(occlusion "\"normal_factor\": $factor")"
done
