#!/usr/bin/env bash
# A standard move with curl alone; a move has ended when there is no current one.
# usage: examples/02_standard_move.sh http://localhost:8090 5.5 7.5
set -euo pipefail
url=$1 x=$2 y=$3
curl -sf -X POST "$url/chassis/moves" -H 'Content-Type: application/json' \
  -d "{\"type\": \"standard\", \"target_x\": $x, \"target_y\": $y}"
echo
until [ "$(curl -s -o /dev/null -w '%{http_code}' "$url/chassis/moves/current")" = 404 ]; do sleep 0.2; done
curl -sf "$url/chassis/moves?limit=1" | tee /dev/stderr | grep -q '"state":"succeeded"'
