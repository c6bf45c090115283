#!/usr/bin/env bash
# A study day and tests on Windows: .ci/windows/tests.sh PYTHON [PYTEST'S WORDS], PYTHON as build.sh made it.
#
# Text is in the country's code page there, as people have it, unless a program says otherwise. What is
# not run is in the file left-out: a test, or a file of tests, and why, in a line each.
set -euo pipefail
here=$(realpath "$(dirname "$0")")
python=$(realpath "$1")
shift
cd "$here/../.."
left_out=()
while read -r test _; do
    case $test in
    '' | '#'*) ;;
    *) left_out+=(--deselect "$test") ;;
    esac
done <"$here/left-out"
export PYTHONUTF8=0
run() { "$python" -m pytest -n0 -q -p no:cacheprovider --durations=10 "${left_out[@]}" "$@"; }
if [ $# -gt 0 ]; then
    run "$@"
else
    run -m long tests/study_day
    run tests/{recording,governance,cli,core,design,launcher,protocol,registry,session,results,streams}
fi
