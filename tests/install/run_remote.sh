#!/bin/sh
# run_remote.sh VARIMESHD PROGRAM FOLDER MESH: starts a server and runs the example with it.
set -e
"$1" --listen "unix:$3/socket" --data "$3" --log-level error &
server=$!
trap 'kill $server && wait $server' EXIT
until [ -S "$3/socket" ]; do
  kill -0 $server
  sleep 0.1
done
"$2" "unix:$3/socket" "$4" "$3/optimised.msh"
grep -q Nodes "$3/optimised.msh"
