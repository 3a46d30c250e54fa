#!/usr/bin/env bash
# Starts, stops and watches igi-worker on the machines of a list, over ssh.
#
#   deploy/lan/workers.sh start  HOSTS [--master HOST:PORT] [igi-worker's other flags]
#   deploy/lan/workers.sh stop   HOSTS        they finish the tile in hand, and say good-bye
#   deploy/lan/workers.sh status HOSTS
#   deploy/lan/workers.sh push   HOSTS [PROGRAM]   copies igi-worker there (target/release/igi-worker)
#
# HOSTS is a file with one machine a line, as ssh knows it (`lab1`, `me@lab2`); `#` begins a comment. The token is taken
# from IGI_TOKEN or the file IGI_TOKEN_FILE, and goes to the machines on standard input: no process list shows it.
# Without --master, workers look for their master by DNS-SD. IGI_SSH is the ssh to use (`ssh -p 2222`), IGI_WORKER the
# program there (`~/.igi/igi-worker` if it was pushed, else the one in its PATH).
# What stands in single quotes is for the shell of the other machine.
# shellcheck disable=SC2016
set -euo pipefail

usage() { sed -n '2,14s/^# \{0,1\}//p' "$0"; }
[[ ${1:-} == -h || ${1:-} == --help ]] && { usage; exit 0; }
[[ $# -ge 2 ]] || { usage >&2; exit 2; }
what=$1 list=$2
shift 2
[[ -r $list ]] || { echo "$0: cannot read the list of machines $list" >&2; exit 2; }
mapfile -t hosts < <(sed 's/#.*//; s/[[:space:]]//g; /^$/d' "$list")
[[ ${#hosts[@]} -gt 0 ]] || { echo "$0: $list names no machine" >&2; exit 2; }
read -ra ssh <<<"${IGI_SSH:-ssh -o BatchMode=yes -o ConnectTimeout=10}"

# Words for a shell on the other side.
quoted() { [[ $# -eq 0 ]] || printf '%q ' "$@"; }

# What runs on the machine; `sh`, because nobody knows its shell.
prelude='
set -eu
cd; umask 077; mkdir -p .igi; cd .igi
# After a restart of the machine, its number may be that of another process.
alive() { [ -s worker.pid ] && ps -o args= -p "$(cat worker.pid)" 2>/dev/null | grep -q -e "--token-file token"; }
'

script() {
    echo "$prelude"
    case $what in
        start)
            echo "worker=$(quoted "${IGI_WORKER:-}")"
            echo 'if [ -z "$worker" ]; then if [ -x igi-worker ]; then worker=./igi-worker; else worker=igi-worker; fi; fi'
            # The new token also for one that runs already: it reads it again when the old one is refused.
            echo "cat >token.new <<'END'"
            echo "$token"
            echo END
            echo 'mv token.new token'
            echo 'if alive; then echo "runs already ($(cat worker.pid))"; exit 0; fi'
            echo "nohup \"\$worker\" --token-file token $(quoted "$@") >worker.log 2>&1 </dev/null &"
            echo 'echo $! >worker.pid; sleep 1'
            echo 'if alive; then echo "started ($(cat worker.pid))"; else tail -n 3 worker.log; exit 1; fi'
            ;;
        stop)
            echo 'if ! alive; then echo "does not run"; exit 0; fi'
            echo 'kill -TERM "$(cat worker.pid)"; i=0'
            echo 'while alive; do i=$((i + 1)); [ $i -le 60 ] || { echo "does not end"; exit 1; }; sleep 1; done'
            echo 'rm -f worker.pid; echo stopped'
            ;;
        status)
            echo 'if alive; then echo "runs ($(cat worker.pid)): $(tail -n 1 worker.log)"'
            echo 'else echo "does not run: $(tail -n 1 worker.log 2>/dev/null || echo no log)"; exit 1; fi'
            ;;
    esac
}

token=
case $what in
    start)
        token=${IGI_TOKEN:-}
        [[ -n $token || -z ${IGI_TOKEN_FILE:-} ]] || token=$(<"$IGI_TOKEN_FILE")
        [[ -n $token ]] || { echo "$0: no token: set IGI_TOKEN to the one that the master shows, or IGI_TOKEN_FILE to the file that it names" >&2; exit 2; }
        ;;
    stop | status) ;;
    push)
        program=${1:-$(dirname "$0")/../../target/release/igi-worker}
        [[ -x $program ]] || { echo "$0: there is no $program: cargo build --release --bin igi-worker" >&2; exit 2; }
        ;;
    *) usage >&2; exit 2 ;;
esac

on() {
    local host=$1
    shift
    if [[ $what == push ]]; then
        "${ssh[@]}" "$host" 'mkdir -p ~/.igi && cat >~/.igi/igi-worker.new && chmod 755 ~/.igi/igi-worker.new && mv ~/.igi/igi-worker.new ~/.igi/igi-worker && echo pushed' <"$program"
    else
        script "$@" | "${ssh[@]}" "$host" sh
    fi
}

# All at once; each answer under its machine's name.
answers=$(mktemp -d)
trap 'rm -rf "$answers"' EXIT
pids=()
for index in "${!hosts[@]}"; do
    on "${hosts[$index]}" "$@" >"$answers/$index" 2>&1 &
    pids+=($!)
done
failed=0
for index in "${!hosts[@]}"; do
    wait "${pids[$index]}" || failed=$((failed + 1))
    sed "s|^|${hosts[$index]}: |" "$answers/$index"
done
[[ $failed -eq 0 ]] || { echo "$failed of ${#hosts[@]} machines failed" >&2; exit 1; }
