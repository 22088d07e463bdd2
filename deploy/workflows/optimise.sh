#!/bin/bash
# Optimises a mesh on a server. It can be started again safely after any interruption:
#   SERVER=HOST:PORT optimise.sh IN.msh OUT.msh [OPTION OF varimesh submit]…
# Exit status: 0: OUT.msh is written and every element is certified valid. 4: it is written, but some elements are not
# certified valid. 3: the mesh or an option was refused; trying again does not help. 5: the server could not be reached in
# $ATTEMPTS attempts (default 5); if there is a job, it continues on the server, and the next start joins it.
set -uo pipefail
[ $# -ge 2 ] || { sed -n '2,6s/^# \{0,1\}//p' "$0" >&2; exit 3; }
in=$1 out=$2
shift 2
server=(--server "${SERVER:?set SERVER to the address of the server}")
[ -r "$in" ] || { echo "optimise.sh: cannot read the mesh $in" >&2; exit 3; }

# The same mesh with the same options has the same request id, and is the same job.
request=$({ cat "$in"; printf '%s\n' "$@"; } | sha256sum | cut -d ' ' -f 1)

for attempt in $(seq "${ATTEMPTS:-5}"); do
  if job=$(varimesh submit "$in" "${server[@]}" --request-id "$request" "$@"); then
    varimesh watch "$job" "${server[@]}" --quiet
    status=$?
    if [ $status = 0 ] || [ $status = 4 ]; then
      varimesh result "$job" "${server[@]}" -o "$out" --quiet
      status=$?
    fi
  else
    status=$?
  fi
  case $status in
    0 | 4) exit $status ;;       # written
    5) sleep "$attempt" ;;       # the server or the connection failed: try again
    130) exit 130 ;;             # interrupted; the job continues on the server
    *) exit 3 ;;                 # trying again would give the same result
  esac
done
exit 5
