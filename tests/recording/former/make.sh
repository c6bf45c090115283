#!/usr/bin/env bash
# Record with the labcrane of former commits what test_former.py reads. Run it in a clone with the history:
#   tests/recording/former/make.sh [NAME ...]
# A recording is NAME.yaml run by the commit beside its name here, and is kept as NAME.h5.gz. Both recordings of signals
# are of signals.yaml, run in real time while signals.py sends EEG and gaze by LSL.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(git -C "$here" rev-parse --show-toplevel)
declare -A commits=([bullet]=a3555abb [groups]=20731b37 [arm]=8b5edea0 [track]=91aa6c0b
    [signals-1]=20731b37 [signals-2]=91aa6c0b)
work=$(mktemp -d)
trap 'rm -rf "$work"; git -C "$root" worktree prune' EXIT

recorded() { # STUDY BIN: run a study with the programs in BIN
    cd "$1"
    if ! grep -q '^streams:' protocol.yaml; then
        "$2/labcrane" simulate protocol.yaml --participants 1 --out data
        return
    fi
    mkfifo "$work/until"
    "$2/python" "$here/signals.py" <"$work/until" &
    exec 9>"$work/until" # it sends until this is closed
    "$2/labcrane" run protocol.yaml --participant P001 --session 1 --simulate --data data </dev/null
    exec 9>&-
    wait
    rm "$work/until"
}

if [ $# -eq 0 ]; then set -- bullet groups arm track signals-1 signals-2; fi
for each in "$@"; do
    git -C "$root" worktree add -q --detach "$work/$each" "${commits[$each]}"
    python3.11 -m venv "$work/$each-python"
    "$work/$each-python/bin/pip" install -q -e "$work/$each[dev]"
    cp -r "$work/$each/protocols/retrieval" "$work/$each-study" # the arm and its scenes
    cp "$here/${each%-[0-9]}.yaml" "$work/$each-study/protocol.yaml"
    recorded "$work/$each-study" "$work/$each-python/bin"
    gzip -n9 <"$(find "$work/$each-study/data" -name '*.h5')" >"$here/$each.h5.gz"
done
