#!/bin/bash
# Optimises a mesh on a server and says with its exit status what became of it; safe to start again after anything:
#   SERVER=HOST:PORT optimise.sh IN.msh OUT.msh [OPTION OF varimesh submit]…
# 0: written, and every element is certified valid. 4: written, but some are not. 3: the mesh or an option was refused,
# which no repetition mends. 5: the server could not be reached in $ATTEMPTS attempts (default 5); its job, where there is
# one, runs on, and the next start joins it.
set -uo pipefail
[ $# -ge 2 ] || { sed -n '2,6s/^# \{0,1\}//p' "$0" >&2; exit 3; }
in=$1 out=$2
shift 2
server=(--server "${SERVER:?name the server in SERVER}")
[ -r "$in" ] || { echo "optimise.sh: there is no mesh $in" >&2; exit 3; }

# The same mesh with the same options is the same request, and the same job.
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
    5) sleep "$attempt" ;;       # server or transport: again
    130) exit 130 ;;             # interrupted; the job runs on
    *) exit 3 ;;                 # a repetition would end the same way
  esac
done
exit 5
