# shellcheck shell=sh
# SPDX-License-Identifier: Apache-2.0
# Part of ./dev and scripts/lint.sh: runs commands so that their progress is visible.

fail() {
  echo "dev: $1" >&2
  exit 1
}

# Until it is killed: prints the elapsed seconds and the last line of a log, every 10 s or in place in
# a terminal. With `silent` only where the log has not grown.
report_progress() { # log, always or silent
  started=$(date +%s)
  size=-1
  pause=10
  in_place=
  case $2 in
  silent) pause=7 ;;
  *) [ ! -t 1 ] || { pause=2 && in_place=yes; } ;;
  esac
  # The output of sleep is not that of ./dev, which would stay open for as long.
  while sleep $pause >/dev/null 2>&1 && kill -0 $$ 2>/dev/null; do
    before=$size
    size=$(wc -c <"$1")
    elapsed=$(($(date +%s) - started))
    if [ "$2" = silent ]; then
      [ "$size" != "$before" ] || printf '\n  %s s\n' $elapsed
      continue
    fi
    line=$(tail -c 2000 "$1" | tr '\r' '\n' | grep -v '^ *$' | tail -n 1 | cut -c1-90)
    if [ -n "$in_place" ]; then
      printf '\r\033[K  %s s: %s' $elapsed "$line"
    else
      echo "  $elapsed s: $line"
    fi
  done
}

stop_reporting() {
  kill "$reporter" 2>/dev/null || true
  wait "$reporter" 2>/dev/null || true
}

# Runs a command whose output goes to a log, and shows the log's last line while it runs; of the log
# itself the compiler's warnings and, where the command fails, the end.
quietly() { # what to say on failure, command
  failure=$1
  shift
  mkdir -p build
  log=build/step.$$.log # one for each process: CI runs several at once
  : >"$log"
  report_progress "$log" always &
  reporter=$!
  status=0
  "$@" >"$log" 2>&1 || status=$?
  stop_reporting
  [ ! -t 1 ] || printf '\r\033[K'
  if [ $status -ne 0 ]; then
    grep -v '^\[[0-9]*/[0-9]*\]' "$log" | tail -n 40 >&2
    fail "$failure; its output is in $log"
  fi
  grep ' warning: ' "$log" | sort -u | head -n 20 || true
  rm -f "$log"
}

# Runs a command whose output is shown and kept in a log, and shows the elapsed seconds where it is
# silent. Returns its status.
showing() { # log, command
  log=$1
  shift
  mkdir -p build
  : >"$log"
  report_progress "$log" silent &
  reporter=$!
  {
    status=0
    "$@" 2>&1 || status=$?
    echo $status >"$log.status"
  } | tee "$log"
  stop_reporting
  status=$(cat "$log.status")
  rm -f "$log.status"
  return "$status"
}
