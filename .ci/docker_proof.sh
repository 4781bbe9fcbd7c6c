#!/usr/bin/env bash
# Proves the containers: build, up until healthy, a move and an arm path over the published port, a clean stop, nothing left.
# Uses the machine's own engine where an image can be pulled; else one unpacked from Debian packages, with a stand-in
# for the base image made of this machine's files (scripts in $SHARED/ci/docker). Dockerfile and compose.yaml know nothing of it.
set -euo pipefail
cd "$(dirname "$0")/.."
base=python:3.11-slim-bookworm
check=.ci/docker_check.sh

if docker info >/dev/null 2>&1 && { docker image inspect "$base" >/dev/null 2>&1 || docker pull -q "$base"; }; then
  exec "$check"
fi

helpers=$(realpath -m "${SHARED:-../shared}/ci/docker")
[ -x "$helpers/with_engine.sh" ] || { echo "docker proof: no engine that can pull $base, and no helpers in $helpers" >&2; exit 69; }
engine=${ENGINE_DIR:-${TMPDIR:-/tmp}/rackhand-engine}
work=$(mktemp -d); trap 'rm -rf "$work"' EXIT
echo "docker proof: unpacking an engine into $engine"
"$helpers/get_engine.sh" "$engine"
echo "docker proof: making a stand-in for $base, with a wheelhouse"
python3 docker/requirements.py >"$work/requirements.txt"
python3 "$helpers/base_image.py" --requirements "$work/requirements.txt" "$work/base.tar" \
  2> >(grep -v 'is ignored: it is neither a file nor a directory' >&2)  # pip, of places where it finds no wheels
# In a stand-in nothing can be installed: what the Dockerfile would install is there already.
dpkg-query -L libgomp1 | grep '\.so' | tar -C / -rf "$work/base.tar" -T -
ENGINE_LOG=$work/engine.log "$helpers/with_engine.sh" "$engine" "$check" "$work/base.tar" ||
  { code=$?; tail -n 20 "$work/engine.log" 2>/dev/null; exit $code; }
