#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Scenes by `tilegrad render` and by three.js in headless Chromium, side by side in pictures to be looked at: those of Debian's
# assimp-testmodels (viewer.png), and small ones of our own about alpha, textures, skins and the axis that is up (cases.png). Wants the packages
# assimp-testmodels, libjs-three and chromium.
#   bench/viewer/compare.sh [PROGRAM [FOLDER]]
set -euo pipefail
readonly HERE=$(cd "$(dirname "$0")" && pwd)
readonly PROGRAM=$(realpath "${1:-$HERE/../../build/release/src/cli/tilegrad}")
readonly OUT=$(realpath -m "${2:-$HERE/../../out}")
readonly MODELS=/usr/share/assimp/models/glTF2
readonly SCENES=(BoxTextured-glTF/BoxTextured.gltf 2CylinderEngine-glTF-Binary/2CylinderEngine.glb
  textureTransform/TextureTransformTest.gltf BoxTexcoords-glTF/boxTexcoords.gltf
  glTF-Sample-Models/AnimatedMorphCube-glTF/AnimatedMorphCube.gltf ClearCoat-glTF/ClearCoatTest.gltf)
WORK=$(mktemp -d)
trap 'rm -rf "$WORK"' EXIT

shoot() {  # shoot PAGE PICTURE WIDTH HEIGHT
  chromium --headless --no-sandbox --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader --hide-scrollbars \
    --allow-file-access-from-files --virtual-time-budget=20000 --window-size="$3,$4" --screenshot="$2" "file://$1" 2>/dev/null
}

pair() {  # pair SCENE SIZE: NAME.png and NAME.three.png
  local name page up=y
  name=$(basename "$1"); name=${name%.*}
  [ "$name" != z_up ] || up=z
  "$PROGRAM" render "$1" --up $up --out "$WORK/$name.png" --size "$2" --background 0.54 0.66 0.66 --write-cameras "$WORK/$name.json" >/dev/null
  page=$WORK/$name.html
  sed -e "s|SCENE|file://$1|" -e "s|THREE/|file:///usr/share/javascript/three/|" "$HERE/three.html" |
    sed -e "/CAMERA.frames/{s|CAMERA|($(tr -d '\n' <"$WORK/$name.json"))|}" >"$page"
  shoot "$page" "$WORK/$name.three.png" "$2" "$2"
}

sheet() {  # sheet PICTURE SIZE SCENE...: two columns of pairs
  local picture=$1 size=$2 half i=0 scene name
  shift 2
  half=$(( ($# + 1) / 2 ))
  printf '<body style="margin:0"><style>table{border-spacing:2px;float:left;font:14px sans-serif}td{padding:0}img{display:block}</style>' >"$WORK/all.html"
  for scene in "$@"; do
    pair "$scene" "$size"
    [ $((i % half)) != 0 ] || printf '<table><tr><th>tilegrad<th>three.js' >>"$WORK/all.html"
    name=$(basename "$scene"); name=${name%.*}
    printf '<tr><td><img src=%s.png><td><img src=%s.three.png>' "$name" "$name" >>"$WORK/all.html"
    i=$((i + 1))
    [ $((i % half)) != 0 ] || printf '</table>' >>"$WORK/all.html"
  done
  shoot "$WORK/all.html" "$picture" $((4 * (size + 2) + 8)) $((half * (size + 2) + 24))
  echo "$picture"
}

mkdir -p "$OUT"
python3 "$HERE/make_cases.py" "$WORK"
sheet "$OUT/cases.png" 140 "$WORK"/{alpha_mask,alpha_blend,texture_transform,skin,z_up}.glb
sheet "$OUT/viewer.png" 300 "${SCENES[@]/#/$MODELS/}"
