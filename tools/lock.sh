#!/bin/sh
# Compile the locks from their .in files: one version of each package for Python 3.11 to 3.13, wheels only, hashed.
# Then try each lock, without installing anything, on every machine that tools/environment.py accepts.
set -eu
cd "$(dirname "$0")/.."
uv=${1:-uv}
compile() {
    "$uv" pip compile --quiet --universal --python-version 3.11 --fork-strategy fewest --generate-hashes \
        --only-binary :all: --no-emit-index-url --no-emit-find-links --custom-compile-command "make lock" "$@"
}
compile environment.in -o environment.txt
for extra in test lab; do
    compile -c environment.txt "tools/locks/$extra.in" -o "tools/locks/$extra.txt"
done
compile -c environment.txt -c tools/locks/test.txt tools/locks/bench.in -o tools/locks/bench.txt
compile tools/locks/uv.in -o tools/locks/uv.txt

nowhere=$(mktemp -d)
trap 'rm -rf "$nowhere"' EXIT
export MACOSX_DEPLOYMENT_TARGET=14.0
for lock in environment.txt tools/locks/*.txt; do
    for machine in x86_64-manylinux_2_28 aarch64-manylinux_2_28 aarch64-apple-darwin; do
        for python in 3.11 3.12 3.13; do
            "$uv" pip install --quiet --dry-run --target "$nowhere" --python-platform "$machine" \
                --python-version "$python" --no-deps --require-hashes --only-binary :all: -r "$lock" ||
                { echo "$lock cannot be installed on $machine with Python $python." >&2; exit 1; }
        done
    done
done
