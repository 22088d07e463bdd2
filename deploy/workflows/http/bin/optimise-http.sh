#!/bin/bash
# Optimises a mesh on a server by HTTP, with curl and jq and without VariMesh. It can be started again safely after any
# interruption:
#   HTTP=https://varimesh.example optimise-http.sh IN.msh OUT.vtu [SPEC.json]
# SPEC.json is a JobSpec without its mesh, such as {"outputs": ["MESH_FORMAT_VTU"], "options": {"timeLimit": 60}}. If the
# server asks for tokens, VARIMESH_TOKEN has one. Exit status: 0: OUT is written and every element is certified valid.
# 4: it is written, but some elements are not certified valid. 3: the mesh or an option was refused, or the job failed;
# trying again does not help. 5: the server could not be reached, or has no room now; if there is a job, it continues, and the
# next start joins it.
set -uo pipefail
[ $# -ge 2 ] || { sed -n '2,9s/^# \{0,1\}//p' "$0" >&2; exit 3; }
in=$1 out=$2 spec=${3:-}
: "${HTTP:?set HTTP to the address of the server}"
[ -r "$in" ] || { echo "optimise-http.sh: cannot read the mesh $in" >&2; exit 3; }
answer=$(mktemp) || exit 5
trap 'rm -f "$answer" "$out.part"' EXIT
: > "$out.part" || { echo "optimise-http.sh: cannot write beside the result $out" >&2; exit 3; }
settings=$(if [ -n "$spec" ]; then cat "$spec"; else echo '{"outputs": ["MESH_FORMAT_VTU"]}'; fi) || exit 3

# The token is no argument of curl, since every user of the machine can read those.
token_header() { [ -z "${VARIMESH_TOKEN:-}" ] || printf 'Authorization: Bearer %s\n' "$VARIMESH_TOKEN"; }
# Asks, and writes what comes into a file: curl tries again by itself, and each answer takes the place of the one before.
ask() { # FILE CURL'S ARGUMENTS
  local file=$1 code
  shift
  code=$(curl -sS --fail-with-body --retry 5 --retry-connrefused -H @<(token_header) -o "$file" -w '%{http_code}' "$@") && return
  jq -r '.message // empty' "$file" >&2 2> /dev/null
  case $code in
    408 | 409 | 429 | 5??) exit 5 ;; # 409: an upload was cut, or somebody else goes on with it
    4??) exit 3 ;;
    *) exit 5 ;; # no answer, or half of one
  esac
}

digest=$(sha256sum < "$in" | cut -c1-64)
# The same mesh with the same spec has the same request id, and is the same job.
request=$(printf '%s %s' "$digest" "$settings" | sha256sum | cut -c1-64)
ask "$answer" -T "$in" -H "Content-Type: application/octet-stream" "$HTTP/v1/meshes?digest=$digest"
body=$(jq -c --arg digest "$digest" '. + {mesh: {digest: $digest}}' <<< "$settings") || exit 3
ask "$answer" --json "$body" "$HTTP/v1/jobs?requestId=$request"
job=$(jq -r .job.name "$answer")
echo "$HTTP/#/$job" >&2  # the page of the job

# The stream of events ends with the job. If it is cut, it is asked for again.
for attempt in 1 2 3 4 5 6 7 8; do
  (ask /dev/null -N "$HTTP/v1/$job/events?minInterval=5s")
  ask "$answer" "$HTTP/v1/$job"
  state=$(jq -r .job.state "$answer")
  case $state in
    JOB_STATE_SUCCEEDED) break ;;
    JOB_STATE_FAILED | JOB_STATE_CANCELLED)
      jq -r '.job.error.message // .job.state' "$answer" >&2
      exit 3 ;;
  esac
  sleep "$attempt"
done
[ "$state" = JOB_STATE_SUCCEEDED ] || exit 5
ask "$out.part" "$HTTP/v1/$job/result"
mv "$out.part" "$out" || exit 3
[ "$(jq -r '.job.metrics | (.after.certified.valid // 0 | tonumber) == (.mesh.elements | tonumber)' "$answer")" = true ] || exit 4
