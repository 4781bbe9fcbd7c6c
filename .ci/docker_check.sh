#!/usr/bin/env bash
# usage: docker_check.sh [BASE.tar]   With an engine at hand: see docker_proof.sh.
# Where GO_AHEAD names a file, the images are built at once and started when that file is there: a build mostly waits for
# the disk, so it may run beside tests, and what is started has the machine to itself.
set -euo pipefail
cd "$(dirname "$0")/.."
export COMPOSE_PROJECT_NAME=rackhand-check
api=http://127.0.0.1:8090
say() { echo "$(date +%H:%M:%S) docker: $*"; }

finish() {
  code=$?
  if [ $code != 0 ]; then say "failed; the last lines of every service:"; docker compose ps -a; docker compose logs --tail 40 || true; fi
  docker compose down -v --timeout 10 >/dev/null 2>&1 || true
  exit $code
}
trap finish EXIT

if [ -n "${1:-}" ]; then
  docker import --change 'ENV PATH=/usr/local/bin:/usr/local/sbin:/usr/bin:/usr/sbin:/bin:/sbin' --change 'ENV LANG=C.UTF-8' \
    --change 'CMD ["python3"]' "$1" python:3.11-slim-bookworm >/dev/null
fi
docker version --format 'engine {{.Server.Version}}'; docker compose version

say "build"
log=$(mktemp)
docker compose --progress plain build >"$log" 2>&1 || { tail -n 60 "$log"; exit 1; }
rm "$log"
docker image ls --format '  {{.Repository}} {{.Size}}' | grep "$COMPOSE_PROJECT_NAME"

while [ -n "${GO_AHEAD:-}" ] && [ ! -e "$GO_AHEAD" ]; do sleep 1; done

say "up"
docker compose up -d --wait --wait-timeout 240
docker compose ps --format '  {{.Service}} {{.Status}}'

say "what runs is locked down"
for service in $(docker compose ps --services); do
  docker inspect "$(docker compose ps -q "$service")" --format \
    '{{.Config.User}} {{.HostConfig.ReadonlyRootfs}} {{.HostConfig.CapDrop}} {{.HostConfig.SecurityOpt}}' |
    grep -qx 'rackhand true \[ALL\] \[no-new-privileges:true\]' || { say "$service is not"; exit 1; }
done

say "a move and an arm path over the published port"
curl -fsS "$api/healthz"; echo
python3 .ci/drive.py "$api"

say "the live view over its published ports"
curl -fsSL -o /dev/null -w '  page: %{http_code}, %{size_download} bytes of %{url_effective}\n' http://127.0.0.1:9090/
# What the page asks for: an empty gRPC-web request for everything there is. It never ends, so it is cut off.
read_all=http://127.0.0.1:9876/rerun.sdk_comms.v1alpha1.MessageProxyService/ReadMessages
bytes=$(head -c 5 /dev/zero | curl -sS -o /dev/null -w '%{size_download}' --max-time 3 -H 'Content-Type: application/grpc-web+proto' \
  --data-binary @- "$read_all" 2>/dev/null || true)
echo "  data: $bytes bytes in 3 s"
[ "$bytes" -gt 50000 ] || { say "the viewer serves no scene"; exit 1; }

say "stop"
docker compose --progress quiet stop
for id in $(docker compose ps -aq); do
  ended=$(docker inspect "$id" --format '{{.Name}} ended with {{.State.ExitCode}}')
  echo "  $ended"
  [[ $ended == *" 0" ]] || { say "not a clean end"; exit 1; }
done

say "docker compose down"
docker compose --progress quiet down -v
left=$(docker ps -aq; docker volume ls -q; docker network ls -q --filter "label=com.docker.compose.project=$COMPOSE_PROJECT_NAME")
[ -z "$left" ] || { say "left behind: $left"; exit 1; }
say "all good: nothing left behind"
