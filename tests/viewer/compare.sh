#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Scenes of Debian's assimp-testmodels by `tilegrad render` and by three.js in headless Chromium, side by side in one picture to
# be looked at. Wants the packages assimp-testmodels, libjs-three and chromium.
#   tests/viewer/compare.sh [PROGRAM [PICTURE]]
set -euo pipefail
readonly HERE=$(cd "$(dirname "$0")" && pwd)
readonly PROGRAM=$(realpath "${1:-$HERE/../../build/release/src/cli/tilegrad}")
readonly PICTURE=$(realpath -m "${2:-$HERE/../../out/viewer.png}")
readonly MODELS=/usr/share/assimp/models/glTF2 SIZE=300
readonly SCENES=(BoxTextured-glTF/BoxTextured.gltf 2CylinderEngine-glTF-Binary/2CylinderEngine.glb
  textureTransform/TextureTransformTest.gltf BoxTexcoords-glTF/boxTexcoords.gltf
  glTF-Sample-Models/AnimatedMorphCube-glTF/AnimatedMorphCube.gltf ClearCoat-glTF/ClearCoatTest.gltf)
WORK=$(mktemp -d)
trap 'rm -rf "$WORK"' EXIT

shoot() {  # shoot PAGE PICTURE WIDTH HEIGHT
  chromium --headless --no-sandbox --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader --hide-scrollbars \
    --allow-file-access-from-files --virtual-time-budget=20000 --window-size="$3,$4" --screenshot="$2" "file://$1" 2>/dev/null
}

for scene in "${SCENES[@]}"; do
  name=$(basename "$scene"); name=${name%.*}
  "$PROGRAM" render "$MODELS/$scene" --out "$WORK/$name.png" --size $SIZE --background 0.54 0.66 0.66 \
    --write-cameras "$WORK/$name.json" >/dev/null
  page=$WORK/$name.html
  sed -e "s|SCENE|file://$MODELS/$scene|" -e "s|THREE/|file:///usr/share/javascript/three/|" "$HERE/three.html" |
    sed -e "/CAMERA.frames/{s|CAMERA|($(tr -d '\n' <"$WORK/$name.json"))|}" >"$page"
  shoot "$page" "$WORK/$name.three.png" $SIZE $SIZE
done
printf '<body style="margin:0"><style>table{border-spacing:2px;float:left;font:14px sans-serif}td{padding:0}img{display:block}</style>' >"$WORK/all.html"
half=$(( (${#SCENES[@]} + 1) / 2 ))
i=0
for scene in "${SCENES[@]}"; do
  [ $((i % half)) != 0 ] || printf '<table><tr><th>tilegrad<th>three.js' >>"$WORK/all.html"
  name=$(basename "$scene"); name=${name%.*}
  printf '<tr><td><img src=%s.png><td><img src=%s.three.png>' "$name" "$name" >>"$WORK/all.html"
  i=$((i + 1))
  [ $((i % half)) != 0 ] || printf '</table>' >>"$WORK/all.html"
done
mkdir -p "$(dirname "$PICTURE")"
shoot "$WORK/all.html" "$PICTURE" $((4 * (SIZE + 2) + 8)) $((half * (SIZE + 2) + 24))
echo "$PICTURE"
