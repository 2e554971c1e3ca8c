#!/usr/bin/env bash
# Makes the files whose sizes and errors are in docs/quoted.csv, below the directory $1, with
# the release build: databases tailored to scenes, and compact files and exports of
# configs/thesis.toml.
set -euo pipefail
out=$1
splitsnow=target/release/splitsnow
mkdir -p "$out/files"
for scene in igloo block sculpture thesis wet layered soot; do
    "$splitsnow" tailor "configs/scenes/$scene.toml" --out "$out/scenes/$scene"
done
"$splitsnow" build configs/thesis.toml --out "$out/thesis"
# name and compression options; the last line gives the file that `build` writes
while read -r name how; do
    # shellcheck disable=SC2086
    "$splitsnow" compress "$out/thesis" $how </dev/null
    cp "$out/thesis/snow.safetensors" "$out/files/$name.safetensors"
done <<END
plain_loose --max-rmse 0.02
log_quantised --basis log --precision quantised
log_quantised_loose --basis log --precision quantised --max-rmse 0.02
linear_quantised --precision quantised
linear_quantised_loose --precision quantised --max-rmse 0.02
plain
END
for end in nc csv npz; do
    format=${end/nc/netcdf}
    "$splitsnow" export "$out/thesis" --format "$format" --out "$out/files/compact.$end"
    "$splitsnow" export "$out/thesis" --from database --format "$format" --out "$out/files/database.$end"
done
