#!/bin/sh
# Compile environment*.txt from environment*.in: one version of each package for Python 3.11 to 3.13, wheels only, hashed.
set -eu
cd "$(dirname "$0")/.."
uv=${1:-uv}
compile() {
    "$uv" pip compile --quiet --universal --python-version 3.11 --fork-strategy fewest --generate-hashes \
        --only-binary :all: --no-emit-index-url --no-emit-find-links --custom-compile-command "make lock" "$@"
}
compile environment.in -o environment.txt
for extra in test lab; do
    compile -c environment.txt "environment-$extra.in" -o "environment-$extra.txt"
done
