#!/usr/bin/env bash
# Record with the labcrane of former commits what test_former.py reads. Run it in a clone with the history:
#   tests/recording/former/make.sh [NAME ...]
# A recording is NAME.yaml run by the commit beside its name here, and is kept as NAME.h5.gz.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(git -C "$here" rev-parse --show-toplevel)
declare -A commits=([bullet]=a3555abb [groups]=20731b37 [arm]=8b5edea0 [track]=91aa6c0b)
work=$(mktemp -d)
trap 'rm -rf "$work"; git -C "$root" worktree prune' EXIT
for name in "${@:-bullet groups arm track}"; do
    for each in $name; do
        git -C "$root" worktree add -q --detach "$work/$each" "${commits[$each]}"
        python3.11 -m venv "$work/$each-python"
        "$work/$each-python/bin/pip" install -q -e "$work/$each[dev]"
        cp -r "$work/$each/protocols/retrieval" "$work/$each-study" # the arm and its scenes
        cp "$here/$each.yaml" "$work/$each-study/protocol.yaml"
        (cd "$work/$each-study" && "$work/$each-python/bin/labcrane" simulate protocol.yaml --participants 1 --out data)
        gzip -n9 <"$(find "$work/$each-study/data" -name '*.h5')" >"$here/$each.h5.gz"
    done
done
